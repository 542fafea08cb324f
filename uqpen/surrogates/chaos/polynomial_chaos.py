"""Polynomial chaos: outputs as sums of polynomials orthonormal for the joint distribution."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.model import Model, Output
from uqpen.core.processors import one_blas_thread
from uqpen.core.settings import choice, choices, count, name, number
from uqpen.core.streams import Stream
from uqpen.distributions.input_group import ChaospyJoint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.chaos.basis import ProductBasis
from uqpen.surrogates.chaos.chaospy_engine import ChaospyExpansion, input_problems
from uqpen.surrogates.chaos.expansion import (
    Expansion,
    FitNoise,
    PolynomialChaosModel,
    estimate_fit_noise,
)
from uqpen.surrogates.chaos.term_selection import (
    HIGHEST_ORDER,
    TRUNCATIONS,
    FitPoints,
    Terms,
    chosen_terms,
    projection_terms,
    regression_terms,
)
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.surrogates.surrogate import Surrogate, components_setting
from uqpen.surrogates.training import TrainingRuns, logarithm_problem

if TYPE_CHECKING:
    import xarray as xr

# Polynomials of higher orders than this are noise between any two runs.
_HIGHEST_ORDER_GIVEN = 50

_UQPEN, _CHAOSPY = "uqpen", "chaospy"


def label_problem(joint: JointDistribution) -> str:
    """Return which inputs are texts without an order, so that none has polynomials."""
    inputs = [each.variable for each in joint.random if each.variable.unordered_labels]
    named = ", ".join(f"{each.name} ({len(each.labels)} texts)" for each in inputs)
    return f"polynomials of {named}, whose codes have no order" if named else ""


_FAILED_NODES = "least-squares, as nodes of its rule were lost"


class CandidateTerms(NamedTuple):
    """Truncation and order of the terms that a fit chooses from; None for the best ones."""

    truncation: float | None
    order: int | None


@dataclass(frozen=True)
class PolynomialChaos(Surrogate):
    """Sum of products of polynomials, each orthonormal for the distribution of its input.

    Parameters
    ----------
    design : str
        The design whose runs it is fitted to.
    order : int, optional
        The highest order of its terms; without it, the one that best predicts runs left out.
    truncation : float, optional
        q: terms of degrees k have (Σ k^q)^(1/q) at most the order. 1 takes all up to a total
        degree, less leaves out interactions of high degree. Without it, a sparse fit of each output
        takes the one that best predicts runs left out; other fits take 1.
    method : str
        ``"sparse"`` keeps the terms that best predict runs left out or, with a stated truncation,
        those that lower the leave-one-out error; ``"least-squares"`` all of them; ``"projection"``
        integrates over the nodes of a quadrature.
    transform : mapping of str to str
        Outputs that are fitted as their logarithm (``"log"``).
    check : str, optional
        A design whose runs show how good it is.
    engine : str
        ``"uqpen"``, or ``"chaospy"`` for polynomials and coefficients by chaospy. The terms are
        chosen alike, and the fitted surrogate needs no chaospy.
    components : float or int
        The principal components of a field that are kept: the share of its variance that they have
        at least, or their number.

    References
    ----------
    Xiu, D. & Karniadakis, G. E. (2002). SIAM J. Sci. Comput. 24, 619-644.
    Blatman, G. & Sudret, B. (2011). J. Comput. Phys. 230, 2345-2367.
    """

    design: str = name()
    order: int | None = count(maximum=_HIGHEST_ORDER_GIVEN, default=None)
    truncation: float | None = number(above=0, at_most=1, default=None)
    method: str = choice("sparse", "least-squares", "projection", default="sparse")
    transform: Mapping[str, str] = choices("log")
    check: str | None = name(default=None)
    engine: str = choice(_UQPEN, _CHAOSPY, default=_UQPEN)
    components: float = components_setting()

    def check_settings(self) -> Iterator[Problem]:
        """Yield a problem of settings that are valid by themselves."""
        if self.engine == _CHAOSPY and self.method == "sparse":
            expected = 'method = "least-squares" or "projection", which chaospy has'
            yield Problem(("method",), '"sparse"', expected)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        """Yield the inputs that have no polynomials, or that the engine does not know."""
        if unknown := [
            name
            for group in joint.groups
            if not group.marginals and not (isinstance(group, ChaospyJoint) and group.declared)
            for name in group.inputs
        ]:
            found = f"polynomials of {', '.join(unknown)}"
            expected = (
                "inputs with distributions of their own, or joined by chaospy in the study file, "
                'as polynomials are of these; "gaussian-process" takes any inputs'
            )
            yield Problem((), found, expected)
        if unordered := label_problem(joint):
            yield Problem((), unordered, 'kind = "gaussian-process", which needs no order')
        if self.engine == _CHAOSPY and joint.implicit_inputs:
            found = f'"{_CHAOSPY}" with {", ".join(joint.implicit_inputs)} of a joint distribution'
            yield Problem(("engine",), found, f'engine = "{_UQPEN}", whose polynomials it takes')
        elif self.engine == _CHAOSPY:
            yield from input_problems(joint, logarithms=not self.needs_quadrature)

    @property
    def needs_quadrature(self) -> bool:
        """True if its design must be an integration rule."""
        return self.method == "projection"

    @one_blas_thread()
    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> PolynomialChaosModel:
        """Fit every output that has numbers; see `Surrogate.fit`."""
        training = TrainingRuns.from_runs(runs, model, joint)
        # A rule's nodes are exact for polynomials of the inputs, not of their logarithms.
        logarithms, degree = not self.needs_quadrature, self.order or HIGHEST_ORDER
        if self.engine == _CHAOSPY:
            engine = ChaospyExpansion.from_distribution(joint, logarithms=logarithms)
            basis = engine.basis(degree)
        else:
            engine = None
            basis = ProductBasis.from_distribution(joint, degree, logarithms=logarithms)
        expansions: dict[str, Expansion] = {}
        reasons: dict[str, str] = {}
        for output in model.all_outputs:
            found = self._expansion(output, training, basis, stream, engine)
            if isinstance(found, Expansion):
                expansions[output.name] = found
            else:
                reasons[output.name] = found
        return PolynomialChaosModel(
            **training.described(name, self.design),
            outputs=tuple(expansion.output for expansion in expansions.values()),
            basis=basis,
            expansions=expansions,
            reasons=reasons,
        )

    def candidate_terms(self, output: str) -> CandidateTerms:
        """Return the truncation and the order of an output, as far as they are given."""
        return CandidateTerms(self.truncation, self.order)

    def for_refits(self, fitted: FittedSurrogate) -> Surrogate:
        """Return settings with the truncations and the orders that the fit has found."""
        if not isinstance(fitted, PolynomialChaosModel):
            return self
        candidates = {
            name: CandidateTerms(each.truncation, each.order)
            for name, each in fitted.expansions.items()
        }
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        return _RefittedChaos(**given, candidates=candidates)

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> PolynomialChaosModel:
        """Restore a polynomial chaos; see `Surrogate.restore`."""
        return PolynomialChaosModel.from_tree(tree, name, original)

    def _expansion(
        self,
        output: Output,
        training: TrainingRuns,
        basis: ProductBasis,
        stream: Stream,
        engine: ChaospyExpansion | None,
    ) -> Expansion | str:
        """Return the expansion of one output, or the reason why there is none."""
        is_logarithm = self.transform.get(output.name) == "log"
        if problem := training.output_problem(output):
            return problem
        values = training.outputs[output.name]
        if is_logarithm and (problem := logarithm_problem(values)):
            return problem
        fitted = np.log(values) if is_logarithm else values
        candidates = self.candidate_terms(output.name)
        points = FitPoints(basis, training.inputs, candidates.truncation or 1.0)
        # Scaled to size one, so that neither units nor a large mean cost any digits.
        centre, spread = float(fitted.mean()), float(fitted.std())
        rng = stream.generator("folds", output.name)
        standard = (fitted - centre) / spread
        method, terms = self._terms(points, standard, training, candidates, rng)
        if isinstance(terms, str):
            return terms
        if engine is not None:
            weights = training.weights if method == "projection" else None
            found = engine.coefficients(points, standard, terms, weights)
            method, terms = f"{method}, by chaospy", replace(terms, coefficients=found)
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
            truncation=terms.truncation,
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
        candidates: CandidateTerms,
        rng: np.random.Generator,
    ) -> tuple[str, Terms | str]:
        """Return the method, and the terms or the reason why there are none."""
        order = candidates.order
        if self.method == "sparse" and self.truncation is None:
            given = () if candidates.truncation is None else (candidates.truncation,)
            return self.method, chosen_terms(points, values, order, rng, given or TRUNCATIONS)
        if not self.needs_quadrature:
            return self.method, regression_terms(points, values, self.method, order, rng)
        if training.weights is None:
            # A rule with failed nodes is no rule: its weights would integrate them as 0.
            terms = regression_terms(points, values, "least-squares", self.order, rng)
            return _FAILED_NODES if training.is_quadrature else "least-squares", terms
        return self.method, projection_terms(points, training.weights, values, self.order)


@dataclass(frozen=True)
class _RefittedChaos(PolynomialChaos):
    """Settings of a fit to a part of the runs: it chooses terms anew, from given candidates."""

    candidates: Mapping[str, CandidateTerms] = field(default_factory=dict)

    def candidate_terms(self, output: str) -> CandidateTerms:
        """Return the truncation and the order of an output."""
        return self.candidates.get(output) or super().candidate_terms(output)
