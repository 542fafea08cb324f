"""Gaussian process (kriging): outputs as processes with Matérn correlations, given the runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Model, Output
from uqpen.core.processors import one_blas_thread
from uqpen.core.settings import choice, choices, name, share
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.gaussian_process_fit import (
    FEW_RUNS,
    SMOOTHNESS,
    ConditionedProcess,
    GaussianProcessFit,
    Parameters,
    ProcessData,
    StandardisedInputs,
    improve_parameters,
    likeliest_parameters,
    trend_terms,
)
from uqpen.surrogates.output_surrogate import fit_separately
from uqpen.surrogates.separate_fits import SeparateFits
from uqpen.surrogates.surrogate import Surrogate, components_setting
from uqpen.surrogates.training import logarithm_problem

if TYPE_CHECKING:
    import xarray as xr

# Errors of a Gaussian process at runs left out, and the factor that they give its deviations.
#
# At each run the process is conditioned on all the others, in closed form. Its lengths and its
# nugget are found without a fifth of the runs, to which the run belongs. Parameters that have seen
# a run would make its error look too small.
#
# References
# ----------
# Dubrule, O. (1983). Mathematical Geology 15, 687-699.

# Parts of the runs, and steps of the search for the parameters without one of them.
_FOLDS = 5
_STEPS = 8

# Intervals of this coverage have to hold the runs left out: half of their width is 1.96 std.
_COVERAGE, _HALF_WIDTH = 0.95, 1.959964


@dataclass(frozen=True, eq=False)
class LeftOutErrors:
    """Errors at runs left out."""

    errors: FloatArray  # (run,): of the prediction from the other runs
    deviations: FloatArray  # (run,): their standard deviations by the process

    @classmethod
    def of_runs(
        cls, data: ProcessData, parameters: Parameters, rng: np.random.Generator
    ) -> LeftOutErrors | None:
        """Leave out each run; None where the others are singular to rounding.

        Of many runs the parameters are those of all runs, which a fifth of them hardly changes.
        """
        count = len(data.values)
        fold = rng.permutation(count) % (_FOLDS if count <= FEW_RUNS else 1)
        errors, deviations = np.empty((2, count))
        for number in range(fold.max() + 1):
            out, others = fold == number, np.flatnonzero(fold != number)
            found = parameters
            if len(others):
                found = improve_parameters(data.part(others), parameters, _STEPS)
            process = ConditionedProcess.of_runs(data, found)
            if process is None:
                return None
            precisions = np.diag(process.inverse)[out]
            errors[out] = process.weights[out] / precisions
            deviations[out] = np.sqrt(process.variance / precisions)
        return cls(errors, deviations)

    def q2(self, values: FloatArray) -> float:
        """Return one minus the mean square error over the variance of the values."""
        return 1 - float(np.mean(self.errors**2) / np.var(values))

    @property
    def std_factor(self) -> float:
        """Factor of the deviations with which 95 % intervals hold 95 % of the runs left out."""
        standardised = np.abs(self.errors) / self.deviations
        # As many of n + 1 errors: that of a further run is as likely to be of any rank.
        return float(np.quantile(standardised, _COVERAGE, method="weibull")) / _HALF_WIDTH


# A fit takes time in the cube of the runs, and its predictions in the square of them.
_MOST_RUNS = 2000

# Runs beyond the terms of the trend, for a variance and its correlations.
_SPARE_RUNS = 3

# With less, correlations of smooth processes are singular to rounding.
_LEAST_NUGGET = 1e-12

_LINEAR = "linear"


@dataclass(frozen=True)
class GaussianProcess(Surrogate):
    """Gaussian process with Matérn correlations, and a length for each input.

    Any two texts of an input are equally far from each other: their codes have no order.

    Parameters
    ----------
    design : str
        The design whose runs it is fitted to; 2000 completed runs at most.
    kernel : str
        ``"matern-5/2"`` for outputs that are smooth, ``"matern-3/2"`` for rougher ones.
    trend : str
        ``"constant"``, or ``"linear"`` in all inputs but those of texts.
    nugget : float, optional
        Variance of the noise, as a share of that of the process; 0 for a process that goes
        through all runs, as near as rounding lets it. Without it, it is estimated.
    transform : mapping of str to str
        Outputs that are fitted as their logarithm (``"log"``).
    check : str, optional
        A design whose runs show how good it is.
    components : float or int
        The principal components of a field that are kept: the share of its variance that they have
        at least, or their number.

    References
    ----------
    Sacks, J., Welch, W. J., Mitchell, T. J. & Wynn, H. P. (1989). Statist. Sci. 4, 409-423.
    Santner, T. J., Williams, B. J. & Notz, W. I. (2018). The Design and Analysis of Computer
    Experiments, 2nd ed. Springer.
    """

    design: str = name()
    kernel: str = choice(*SMOOTHNESS, default="matern-5/2")
    trend: str = choice("constant", _LINEAR, default="constant")
    nugget: float | None = share(expected="a share of the variance, from 0 to 1", default=None)
    transform: Mapping[str, str] = choices("log")
    check: str | None = name(default=None)
    components: float = components_setting()

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> SeparateFits:
        """Fit every output that has numbers; see `Surrogate.fit`."""
        distributions = [entry.distribution for entry in joint.random]
        labels = [entry.variable.unordered_labels for entry in joint.random]

        def fit_one(
            output: Output, points: FloatArray, values: FloatArray, rng: np.random.Generator
        ) -> GaussianProcessFit | str:
            is_logarithm = self.transform.get(output.name) == "log"
            if is_logarithm and (problem := logarithm_problem(values)):
                return problem
            inputs = StandardisedInputs.of_runs(distributions, points, labels)
            return self.fit_values(inputs, points, values, rng, is_logarithm=is_logarithm)

        return fit_separately(self, fit_one, name, runs, model, joint, stream)

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> SeparateFits:
        """Restore a Gaussian process; see `Surrogate.restore`."""
        return SeparateFits.from_tree(tree, name, original, GaussianProcessFit)

    @one_blas_thread()
    def fit_values(
        self,
        inputs: StandardisedInputs,
        points: FloatArray,
        values: FloatArray,
        rng: np.random.Generator,
        *,
        is_logarithm: bool = False,
    ) -> GaussianProcessFit | str:
        """Fit one output or its logarithm; return the reason where that is not possible.

        Parameters
        ----------
        inputs : StandardisedInputs
            The map from the inputs to coordinates.
        points : ndarray, shape (run, input)
            In SI units.
        values : ndarray, shape (run,)
            The output, in its SI unit; positive if its logarithm is fitted.
        """
        coordinates = inputs.coordinates(points)
        numbers = coordinates[:, : int((inputs.labels == 0).sum())]
        terms = trend_terms(numbers, is_linear=self.trend == _LINEAR)
        if problem := self._runs_problem(coordinates, terms.shape[1]):
            return problem
        fitted = np.log(values) if is_logarithm else values
        # Scaled to size one, so that neither units nor a large mean cost any digits.
        centre, scale = float(fitted.mean()), float(fitted.std())
        data = ProcessData(
            points=coordinates,
            values=(fitted - centre) / scale,
            trend=terms,
            smoothness=SMOOTHNESS[self.kernel],
            nugget=None if self.nugget is None else max(self.nugget, _LEAST_NUGGET),
            length_numbers=inputs.length_numbers if inputs.labels.any() else None,
        )
        parameters = likeliest_parameters(data, rng)
        process = ConditionedProcess.of_runs(data, parameters)
        left_out = LeftOutErrors.of_runs(data, parameters, rng)
        if process is None or left_out is None:
            return (
                f"its correlations are singular to rounding, with the nugget {parameters.nugget:g}"
            )
        factor = left_out.std_factor
        lengths = parameters.lengths[inputs.length_numbers]
        return GaussianProcessFit(
            input_is_logarithm=inputs.is_logarithm,
            input_location=inputs.location,
            input_scale=inputs.scale,
            points=coordinates / lengths,
            lengths=lengths,
            nugget=parameters.nugget,
            weights=process.weights,
            trend=process.coefficients,
            std=factor * float(np.sqrt(process.variance)),
            std_factor=factor,
            centre=centre,
            scale=scale,
            smoothness=data.smoothness,
            q2=left_out.q2(data.values),
            of_logarithm=int(is_logarithm),
            input_labels=inputs.labels,
        )

    def _runs_problem(self, coordinates: FloatArray, terms: int) -> str:
        """Return the reason why a process cannot be fitted to these runs; empty if it can."""
        runs = len(coordinates)
        if runs > _MOST_RUNS:
            return f"{runs} completed runs are more than the {_MOST_RUNS} that it takes"
        if runs < terms + _SPARE_RUNS:
            least = terms + _SPARE_RUNS
            return f"{runs} completed runs are too few: a {self.trend} trend needs {least} of them"
        if self.nugget == 0 and len(np.unique(coordinates, axis=0)) < runs:
            return "some runs have the same inputs, and nugget = 0 leaves no room between them"
        return ""
