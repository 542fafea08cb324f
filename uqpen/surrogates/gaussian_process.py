"""Gaussian process (kriging): outputs as processes with Matérn correlations, given the runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import digamma

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Model, Output
from uqpen.core.processors import one_blas_thread
from uqpen.core.settings import choice, choices, name, share
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import repeats_of
from uqpen.surrogates.gaussian_process_fit import (
    FEW_RUNS,
    SMOOTHNESS,
    ConditionedProcess,
    GaussianProcessFit,
    Parameters,
    ProcessData,
    RepeatedProcessFit,
    StandardisedInputs,
    correlations,
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


# Noise of the runs of a model that repeats points: that of a mean of runs is known from them.
#
# Where it varies with the inputs, a second process is fitted to the logarithm of the variances
# within points. The noise of these logarithms is nearly the same everywhere, if that of the runs is
# nearly normal: it is the nugget of the second process.
#
# References
# ----------
# Ankenman, B., Nelson, B. L. & Staum, J. (2010). Oper. Res. 58, 371-382 (stochastic kriging).

CONSTANT, VARYING = "constant", "varying"
FEWEST_REPEATS_FOR_VARYING = 4
"""With fewer, the variance at a point says too little for its logarithm."""

# Of a mean, as a share of the variance of the means: with less, correlations are singular.
_LEAST_NOISE = 1e-8


@dataclass(frozen=True, eq=False)
class RepeatNoise:
    """Noise of repeated runs, in units of the standard deviation of the points' means."""

    runs: FloatArray  # (run, repeat): NaN where a run has failed
    variances: FloatArray  # (run,): of the noise of a run at each point
    level: float  # the logarithm of the variance, without what varies
    # (length,): with weights: the process that the logarithm varies by; see `RepeatedProcessFit`
    lengths: FloatArray
    weights: FloatArray  # (run,)

    @classmethod
    def of_runs(
        cls, data: ProcessData, runs: FloatArray, rng: np.random.Generator, kind: str
    ) -> RepeatNoise | str:
        """Estimate the noise of a kind; return the reason where that is not possible."""
        freedom = (~np.isnan(runs)).sum(axis=1) - 1
        within = np.nanvar(runs, axis=1, ddof=1)
        numbers = data.length_numbers
        lengths = np.ones(data.points.shape[1] if numbers is None else int(numbers.max()) + 1)
        weights = np.zeros(len(runs))
        if kind == CONSTANT or not within.any():
            pooled = max(float(freedom @ within) / float(freedom.sum()), _LEAST_NOISE)
            return cls(runs, np.full(len(runs), pooled), math.log(pooled), lengths, weights)
        if not within.all():
            agree = f"at {int((within == 0).sum())} of {len(within)} points all runs agree"
            return f'{agree}, and noise = "{VARYING}" takes the logarithm of their variances'
        half = freedom / 2
        # Of a normal variable, this is the mean of the logarithm of s² over its variance.
        logarithm = np.log(within) - (digamma(half) - np.log(half))
        centre, scale = float(logarithm.mean()), float(logarithm.std())
        own = replace(data, values=(logarithm - centre) / scale, trend=data.trend[:, :1])
        own = replace(own, nugget=None)
        parameters = likeliest_parameters(own, rng)
        process = ConditionedProcess.of_runs(own, parameters)
        if process is None:
            return "the correlations of its noise are singular to rounding"
        weights = scale * process.weights
        level = centre + scale * float(process.coefficients[0])
        scaled = own.scaled(parameters.lengths)
        logarithm = level + correlations(scaled, scaled, own.smoothness) @ weights
        return cls(runs, np.exp(logarithm), level, parameters.lengths, weights)

    def of_means(self, data: ProcessData) -> ProcessData:
        """Return the points' means with their noise."""
        noise = np.maximum(self.variances / (~np.isnan(self.runs)).sum(axis=1), _LEAST_NOISE)
        level = float(noise.mean())
        return replace(data, noise=noise / level, noise_level=level)

    def left_out_runs(self, data: ProcessData, means: LeftOutErrors) -> LeftOutErrors:
        """Return the errors of runs, from those of the means at points that are left out."""
        assert data.noise is not None
        predicted = data.values - means.errors
        of_mean = means.deviations**2 - data.noise * data.noise_level
        deviations = np.sqrt(np.maximum(of_mean, 0.0) + self.variances)
        exists = ~np.isnan(self.runs)
        errors = self.runs - predicted[:, None]
        widths = np.broadcast_to(deviations[:, None], errors.shape)
        return LeftOutErrors(errors[exists], widths[exists])


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
    noise : str
        Of runs that the design repeats: ``"constant"``, the same for all inputs, or ``"varying"``
        with them, which takes four repeats at least and supposes that noise is nearly normal.

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
    noise: str = choice(CONSTANT, VARYING, default=CONSTANT)

    def check_repeats(self, repeats: int) -> Iterator[Problem]:
        """Yield the problems of noise that no repeats show, and of a nugget beside them."""
        if self.noise == VARYING and repeats < FEWEST_REPEATS_FOR_VARYING:
            found = f'"{VARYING}", beside {self.design} with repeats = {repeats}'
            least = f"repeats = {FEWEST_REPEATS_FOR_VARYING} or more there"
            expected = f'{least}, as fewer do not show how noise varies; or "{CONSTANT}"'
            yield Problem(("noise",), found, expected)
        if self.nugget is not None and repeats > 1:
            found = f"a nugget, beside {self.design} with repeats = {repeats}"
            yield Problem(("nugget",), found, "no nugget: repeats say how large the noise is")

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> SeparateFits:
        """Fit every output that has numbers; see `Surrogate.fit`."""
        distributions = [entry.distribution for entry in joint.random]
        labels = [entry.variable.unordered_labels for entry in joint.random]
        completed = runs.isel({RUN: np.flatnonzero(runs[STATUS].values == Status.OK)})

        def fit_one(
            output: Output, points: FloatArray, values: FloatArray, rng: np.random.Generator
        ) -> GaussianProcessFit | str:
            is_logarithm = self.transform.get(output.name) == "log"
            repeats = repeats_of(completed, output.name)
            values = values if repeats is None else repeats
            if is_logarithm and (problem := logarithm_problem(values[~np.isnan(values)])):
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
        values : ndarray, shape (run,) or (run, repeat)
            The output, in its SI unit; positive if its logarithm is fitted. Of several runs at
            each point there are two at least, and NaN where one has failed.
        """
        coordinates = inputs.coordinates(points)
        numbers = coordinates[:, : int((inputs.labels == 0).sum())]
        terms = trend_terms(numbers, is_linear=self.trend == _LINEAR)
        if problem := self._runs_problem(coordinates, terms.shape[1]):
            return problem
        every = np.log(values) if is_logarithm else values
        fitted = every if every.ndim == 1 else np.nanmean(every, axis=1)
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
        noise: RepeatNoise | None = None
        if every.ndim > 1:
            own = RepeatNoise.of_runs(data, (every - centre) / scale, rng, self.noise)
            if isinstance(own, str):
                return own
            noise, data = own, own.of_means(data)
        parameters = likeliest_parameters(data, rng)
        process = ConditionedProcess.of_runs(data, parameters)
        left_out = LeftOutErrors.of_runs(data, parameters, rng)
        if process is None or left_out is None:
            nugget = f"the nugget {parameters.nugget:g}"
            return f"its correlations are singular to rounding, with {nugget}"
        lengths = parameters.lengths[inputs.length_numbers]
        of_runs = left_out if noise is None else noise.left_out_runs(data, left_out)
        factor = of_runs.std_factor
        found = GaussianProcessFit(
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
        if noise is None:
            return found
        return RepeatedProcessFit(
            **vars(found) | {"nugget": float(noise.variances.mean() / process.variance)},
            noise_of_means=np.asarray(data.nuggets(parameters.nugget)),
            noise_level=noise.level + 2 * math.log(scale),
            noise_lengths=noise.lengths[inputs.length_numbers],
            noise_weights=noise.weights,
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
