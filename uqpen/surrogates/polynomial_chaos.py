"""Polynomial chaos: outputs as sums of polynomials orthonormal for the joint distribution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Input, Model, Output
from uqpen.core.settings import choice, choices, count, name, number
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.basis import ProductBasis
from uqpen.surrogates.chaos_model import PolynomialChaosModel
from uqpen.surrogates.expansion import Expansion
from uqpen.surrogates.fit_noise import FitNoise, estimate_fit_noise
from uqpen.surrogates.surrogate import Surrogate
from uqpen.surrogates.term_selection import (
    HIGHEST_ORDER,
    FitPoints,
    Terms,
    projection_terms,
    regression_terms,
)
from uqpen.surrogates.training import TrainingRuns

__all__ = ["PolynomialChaos"]


# Polynomials of higher orders than this are noise between any two runs.
_HIGHEST_ORDER_GIVEN = 50

_FAILED_NODES = "least-squares, as nodes of its rule were lost"


@dataclass(frozen=True)
class PolynomialChaos(Surrogate):
    """Sum of products of polynomials, each orthonormal for the distribution of its input.

    Parameters
    ----------
    design : str
        The design whose runs it is fitted to.
    order : int, optional
        The highest order of its terms; without it, the one that best predicts runs left out.
    truncation : float
        Terms of degrees k have (Σ k^q)^(1/q) at most the order. 1 takes all up to a total degree,
        less leaves out interactions of high degree.
    method : str
        ``"sparse"`` keeps the terms that lower the leave-one-out error; ``"least-squares"`` all of
        them; ``"projection"`` integrates over the nodes of a quadrature.
    transform : mapping of str to str
        Outputs that are fitted as their logarithm (``"log"``).
    check : str, optional
        A design whose runs show how good it is.

    References
    ----------
    Xiu, D. & Karniadakis, G. E. (2002). SIAM J. Sci. Comput. 24, 619-644.
    Blatman, G. & Sudret, B. (2011). J. Comput. Phys. 230, 2345-2367.
    """

    fitted_class: ClassVar = PolynomialChaosModel

    design: str = name()
    order: int | None = count(maximum=_HIGHEST_ORDER_GIVEN, default=None)
    truncation: float = number(above=0, at_most=1, default=1.0)
    method: str = choice("sparse", "least-squares", "projection", default="sparse")
    transform: Mapping[str, str] = choices("log")
    check: str | None = name(default=None)

    @property
    def needs_quadrature(self) -> bool:
        """True if its design must be an integration rule."""
        return self.method == "projection"

    @one_blas_thread()
    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> PolynomialChaosModel:
        """Fit every output that has numbers; see `Surrogate.fit`."""
        inputs = _inputs(model, joint)
        training = TrainingRuns.from_runs(runs, model, joint)
        # A rule's nodes are exact for polynomials of the inputs, not of their logarithms.
        basis = ProductBasis.from_distribution(
            joint, self.order or HIGHEST_ORDER, logarithms=not self.needs_quadrature
        )
        expansions: dict[str, Expansion] = {}
        reasons: dict[str, str] = {}
        for output in model.outputs:
            found = self._expansion(output, training, basis, stream)
            if isinstance(found, Expansion):
                expansions[output.name] = found
            else:
                reasons[output.name] = found
        return PolynomialChaosModel(
            name=name,
            inputs=inputs,
            outputs=tuple(expansion.output for expansion in expansions.values()),
            basis=basis,
            expansions=expansions,
            reasons=reasons,
            fixed=training.fixed,
            truncation=self.truncation,
            design=self.design,
            counts={status: training.counts[status] for status in Status},
            is_independent=joint.is_independent,
            original=model,
        )

    def _expansion(
        self, output: Output, training: TrainingRuns, basis: ProductBasis, stream: Stream
    ) -> Expansion | str:
        """Return the expansion of one output, or the reason why there is none."""
        is_logarithm = self.transform.get(output.name) == "log"
        if output.categories:
            return "it has kinds, not numbers"
        if output.dims:
            return "it has dimensions, and surrogates take only scalar outputs"
        problem = training.problem or _fit_problem(training.outputs[output.name], is_logarithm)
        if problem:
            return problem
        values = training.outputs[output.name]
        fitted = np.log(values) if is_logarithm else values
        points = FitPoints(basis, training.inputs, self.truncation)
        # Scaled to size one, so that neither units nor a large mean cost any digits.
        centre, spread = float(fitted.mean()), float(fitted.std())
        rng = stream.generator("folds", output.name)
        method, terms = self._terms(points, (fitted - centre) / spread, training, rng)
        if isinstance(terms, str):
            return terms
        is_constant = ~terms.indices.any(axis=1)
        noise = FitNoise.without_refits(len(basis.univariate_bases))
        if not training.is_quadrature:
            matrix, rng = points.matrix(terms.indices), stream.generator("refits", output.name)
            noise = estimate_fit_noise(matrix, terms.indices, fitted, rng)
        return Expansion(
            output=output,
            indices=terms.indices,
            coefficients=terms.coefficients * spread + np.where(is_constant, centre, 0.0),
            is_logarithm=is_logarithm,
            order=terms.order,
            method=method,
            leave_one_out=terms.leave_one_out,
            cross_validation=terms.cross_validation,
            smallest=float(values.min()),
            largest=float(values.max()),
            noise=noise,
        )

    def _terms(
        self,
        points: FitPoints,
        values: FloatArray,
        training: TrainingRuns,
        rng: np.random.Generator,
    ) -> tuple[str, Terms | str]:
        """Return the method, and the terms or the reason why there are none."""
        if not self.needs_quadrature:
            return self.method, regression_terms(points, values, self.method, self.order, rng)
        if training.weights is None:
            # A rule with failed nodes is no rule: its weights would integrate them as 0.
            terms = regression_terms(points, values, "least-squares", self.order, rng)
            return _FAILED_NODES if training.is_quadrature else "least-squares", terms
        return self.method, projection_terms(points, training.weights, values, self.order)


def _inputs(model: Model, joint: JointDistribution) -> tuple[Input, ...]:
    """Return the model's inputs, and random ones that only other models of the study take."""
    taken = {variable.name for variable in model.inputs}
    others = (entry.variable for entry in joint.random if entry.variable.name not in taken)
    return (*model.inputs, *others)


def _fit_problem(values: FloatArray, is_logarithm: bool) -> str:
    """Return the reason why no terms can be fitted to an output; empty if they can."""
    if not np.isfinite(values).all():
        return f"it is not finite in {int((~np.isfinite(values)).sum())} runs that came back"
    if (values == values[0]).all():
        return f"it does not vary: it is {values[0]:g} in every run"
    if is_logarithm and not (values > 0).all():
        return f"it has no logarithm where it is not positive: its least value is {values.min():g}"
    return ""
