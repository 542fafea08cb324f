"""Fit of a Gaussian process to one output: its mean and standard deviation given the runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self, cast

import numpy as np
from scipy import linalg, optimize
from scipy.spatial.distance import cdist

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.units import DIMENSIONLESS
from uqpen.distributions.distribution import Distribution
from uqpen.surrogates.diagnostics import Diagnostic
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.separate_fits import OutputFit

if TYPE_CHECKING:
    import xarray as xr

# Matérn correlations, with a length for each input.
#
# References
# ----------
# Stein, M. L. (1999). Interpolation of Spatial Data. Springer.
# Rasmussen, C. E. & Williams, C. K. I. (2006). Gaussian Processes for Machine Learning. MIT Press.

# The smoothness ν of the correlations that can be chosen, by its name.
SMOOTHNESS = {"matern-5/2": 2.5, "matern-3/2": 1.5}
# Correlations that are computed together, so that they stay in the processor's cache.
_IN_CACHE = 2**15


def correlations(one: FloatArray, other: FloatArray, smoothness: float) -> FloatArray:
    """Return the correlations between two sets of points, shape (one, other).

    Parameters
    ----------
    one, other : ndarray, shape (point, input)
        Coordinates in units of the lengths.
    smoothness : float
        ν: 2.5 for processes with two derivatives, 1.5 with one.
    """
    found = np.empty((len(one), len(other)))
    rows = max(_IN_CACHE // max(len(other), 1), 1)
    for start in range(0, len(one), rows):
        part = found[start : start + rows]
        scaled = _scaled_distances(one[start : start + rows], other, smoothness)
        np.add(1, scaled, out=part)
        if smoothness != 1.5:
            np.multiply(scaled, scaled, out=(square := np.empty_like(scaled)))
            square /= 3
            part += square
        np.negative(scaled, out=scaled)
        part *= np.exp(scaled, out=scaled)
    return found


def correlations_and_slopes(points: FloatArray, smoothness: float) -> tuple[FloatArray, FloatArray]:
    """Return the correlations between points, and the slopes that their derivatives share.

    The derivative in the logarithm of the length of input k is the slope times the square of the
    difference in coordinate k.
    """
    scaled = _scaled_distances(points, points, smoothness)
    decay = np.exp(-scaled)
    if smoothness == 1.5:
        return (1 + scaled) * decay, 3 * decay
    return (1 + scaled + scaled**2 / 3) * decay, 5 / 3 * (1 + scaled) * decay


def _scaled_distances(one: FloatArray, other: FloatArray, smoothness: float) -> FloatArray:
    distances: FloatArray = cdist(one, other)
    distances *= np.sqrt(2 * smoothness)
    return distances


# Standardised inputs: the coordinates in which a Gaussian process is stationary.


@dataclass(frozen=True, eq=False)
class StandardisedInputs:
    """Map from the inputs to coordinates of mean 0 and variance 1 in the training runs.

    An input with labels has a coordinate for each of them instead, behind those of the others: so
    two of its labels are as far from each other as any two.
    """

    is_logarithm: IntArray  # (input,): 1 where the coordinate is of the input's logarithm
    location: FloatArray  # (input,): of the input, or of its logarithm
    scale: FloatArray  # (input,): of the same
    labels: IntArray  # (input,): number of its labels, or 0 for a number

    @classmethod
    def of_runs(
        cls, distributions: Sequence[Distribution], points: FloatArray, labels: Sequence[int] = ()
    ) -> Self:
        """Standardise the inputs of the training runs, or their logarithms where these are simpler.

        Parameters
        ----------
        distributions : sequence of Distribution
            One for each input.
        points : ndarray, shape (run, input)
            In SI units.
        labels : sequence of int
            The number of labels of each input; without any, all inputs are numbers.
        """
        coded = np.array(labels or [0] * len(distributions), dtype=np.int64)
        simpler = np.array([each.logarithm() is not None for each in distributions], dtype=np.int64)
        simpler[coded > 0] = 0
        raw = _logarithms(points, simpler)
        # An input that is the same in all runs tells nothing, at whatever scale.
        spread = np.where(np.ptp(raw, axis=0) > 0, raw.std(axis=0), 1.0)
        is_number = coded == 0
        return cls(
            simpler, np.where(is_number, raw.mean(axis=0), 0), np.where(is_number, spread, 1), coded
        )

    def coordinates(self, points: FloatArray) -> FloatArray:
        """Return the coordinates of points, shape (run, coordinate); NaN without a logarithm."""
        every = (_logarithms(points, self.is_logarithm) - self.location) / self.scale
        numbers = every[:, self.labels == 0]
        # Half of the squared distance of two labels is from each.
        coded = (
            (every[:, [place]] == np.arange(self.labels[place])) / math.sqrt(2)
            for place in np.flatnonzero(self.labels)
        )
        return np.hstack([numbers, *coded])

    @property
    def length_numbers(self) -> IntArray:
        """Number of the length that each coordinate has, shape (coordinate,): one for an input."""
        numbers, coded = np.flatnonzero(self.labels == 0), np.flatnonzero(self.labels)
        return np.concatenate([numbers, np.repeat(coded, self.labels[coded])])


def _logarithms(points: FloatArray, columns: IntArray) -> FloatArray:
    """Return points with some columns as their logarithms; NaN where there is none."""
    raw, chosen = np.array(points, dtype=np.float64), columns.astype(bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        raw[:, chosen] = np.log(raw[:, chosen])
    return raw


# Of a logarithm: a larger one has no lognormal deviation among floating-point numbers.
_LARGEST_DEVIATION = 15.0


@dataclass(frozen=True, eq=False)
class GaussianProcessFit(OutputFit):
    """Gaussian process given the runs of an output, or of its logarithm."""

    # (input,): as `input_labels`, the map from the inputs to coordinates; see `StandardisedInputs`.
    input_is_logarithm: IntArray
    input_location: FloatArray
    input_scale: FloatArray
    points: FloatArray  # (run, coordinate): those of the training runs, in units of `lengths`
    # (coordinate,): correlation lengths, in standard deviations of the input over the training
    # runs, or in distances of two labels.
    lengths: FloatArray
    nugget: float  # variance of the noise, as a share of that of the process
    weights: FloatArray  # (run,): factors of the correlations with the training runs in the mean
    # (term,): coefficients of the constant and, of a linear trend, of each coordinate.
    trend: FloatArray
    std: float  # standard deviation of the process, with the factor that runs left out give it
    std_factor: float  # that factor
    centre: float  # the fitted variable is `centre` plus `scale` times the process
    scale: float
    smoothness: float  # that of the Matérn correlations
    q2: float  # share of the variance predicted at runs left out
    of_logarithm: int  # 1 where the process is of the logarithm
    input_labels: IntArray

    def to_dataset(self) -> xr.Dataset:
        """Return its fields; see `OutputFit.to_dataset`. No labels are not written."""
        found = super().to_dataset()
        return found if self.input_labels.any() else found.drop_vars("input_labels")

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """Restore it from `to_dataset`; of repeated runs as a `RepeatedProcessFit`."""
        if "input_labels" not in dataset:
            none = np.zeros(dataset["input_scale"].shape, dtype=np.int64)
            dataset = dataset.assign(input_labels=("input_labels_0", none))
        if "noise_of_means" in dataset and cls is GaussianProcessFit:
            return cast(Self, RepeatedProcessFit.from_dataset(dataset))
        return super().from_dataset(dataset)

    @property
    def is_of_logarithm(self) -> bool:
        """True if it was fitted to the logarithm of the output."""
        return bool(self.of_logarithm)

    def predict(self, points: FloatArray) -> Prediction:
        """Predict the output of a run; see `OutputFit.predict`.

        The deviation contains the noise. Where the logarithm was fitted, the mean is the median of
        the output, as its own mean would hang on the tail of the process.
        """
        scaled = self.scaled_coordinates(points)
        kernel = correlations(scaled, self.points, self.smoothness)
        terms = self._terms(scaled)
        mean = self._mean(kernel, terms)
        deviation = self.scale * self.std * np.sqrt(self._variances(kernel, terms))
        return Prediction(*self._of_output(mean, deviation))

    def _of_output(self, mean: FloatArray, *deviations: FloatArray) -> tuple[FloatArray, ...]:
        """Return the mean of the fitted variable and deviations of it as those of the output."""
        if not self.of_logarithm:
            return mean, *deviations
        # A lognormal variable, of which the median is predicted.
        variances = (np.minimum(each, _LARGEST_DEVIATION) ** 2 for each in deviations)
        factors = (np.sqrt(np.expm1(each) * np.exp(each)) for each in variances)
        return np.exp(mean), *(np.exp(mean) * each for each in factors)

    def predict_mean(self, points: FloatArray) -> FloatArray:
        """Predict without the deviations, which take far longer; see `OutputFit.predict_mean`."""
        scaled = self.scaled_coordinates(points)
        kernel = correlations(scaled, self.points, self.smoothness)
        mean = self._mean(kernel, self._terms(scaled))
        return np.exp(mean) if self.of_logarithm else mean

    def diagnostics(self) -> Iterator[Diagnostic]:
        """Yield its error at runs left out, its noise, and the factor of its deviations."""
        yield Diagnostic("q2", self.q2, "Q², runs left out")
        yield Diagnostic("nugget", self.nugget, "nugget")
        yield Diagnostic("std_factor", self.std_factor, "factor of std")

    def noise_diagnostics(self, units: str) -> Iterator[Diagnostic]:
        """Yield what its nugget means where the model has noise of its own.

        The nugget is a share of the variance of the process, which may be far larger than that of
        the output. Where the logarithm was fitted, noise is a factor: it is that of the logarithm.
        """
        noise = self.std / self.std_factor * math.sqrt(self.nugget)
        of_logarithm = " of the logarithm" * bool(self.of_logarithm)
        shown = DIMENSIONLESS if self.of_logarithm else units
        yield Diagnostic("noise_std", self.scale * noise, f"noise std{of_logarithm}", shown)
        share = noise**2 / self._variance_of_runs
        yield Diagnostic("noise_share", share, f"noise share of variance{of_logarithm}")

    def scaled_coordinates(self, points: FloatArray) -> FloatArray:
        """Return the coordinates of points in units of `lengths`, as `points` has them."""
        inputs = StandardisedInputs(
            self.input_is_logarithm, self.input_location, self.input_scale, self.input_labels
        )
        return inputs.coordinates(points) / self.lengths

    def _terms(self, scaled: FloatArray) -> FloatArray:
        numbers = int((self.input_labels == 0).sum())
        return trend_terms((scaled * self.lengths)[:, :numbers], is_linear=len(self.trend) > 1)

    def _mean(self, kernel: FloatArray, terms: FloatArray) -> FloatArray:
        return self.centre + self.scale * (terms @ self.trend + kernel @ self.weights)

    def _variances(self, kernel: FloatArray, terms: FloatArray) -> FloatArray:
        """Return the variances given the runs, as shares of that of the process."""
        matrix = correlations(self.points, self.points, self.smoothness)
        matrix[np.diag_indices_from(matrix)] += self._noise_at_runs
        factor = linalg.cholesky(matrix, lower=True)
        among = linalg.solve_triangular(factor, self._terms(self.points), lower=True)
        known = linalg.solve_triangular(factor, kernel.T, lower=True)
        unknown = terms.T - among.T @ known
        trend = linalg.cholesky(among.T @ among, lower=True)
        by_trend = linalg.solve_triangular(trend, unknown, lower=True)
        left = 1 + self._noise_of_run - (known**2).sum(axis=0) + (by_trend**2).sum(axis=0)
        # What is left of 1 next to a run may be below 0 by rounding.
        return np.maximum(left, 0.0)

    @property
    def _noise_at_runs(self) -> FloatArray | float:
        """Variance of the noise of each training value, as a share of that of the process."""
        return self.nugget

    @property
    def _noise_of_run(self) -> float:
        """Variance of the noise in what `_variances` are of."""
        return self.nugget

    @property
    def _variance_of_runs(self) -> float:
        """Variance of the runs, over that of the training values."""
        return 1.0


@dataclass(frozen=True, eq=False)
class RepeatedProcessFit(GaussianProcessFit):
    """Gaussian process given the means over the repeats of points, whose noise is known.

    The logarithm of the variance of the noise of a run is `noise_level`, of the fitted variable.
    Where it varies with the inputs, the correlations with the points times `noise_weights` are
    added. `nugget` is the mean variance of the noise of a run, and `std_factor` is of the deviation
    of a run alone.
    """

    # (run,): variance of the noise of the mean at each point, as a share of that of the process
    noise_of_means: FloatArray
    noise_level: float
    noise_lengths: FloatArray  # (coordinate,): correlation lengths of the logarithm, as `lengths`
    noise_weights: FloatArray  # (run,); all are 0 for noise that is the same everywhere

    def predict(self, points: FloatArray) -> Prediction:
        """Predict a run, with the deviation of the mean given the inputs beside that of the run."""
        scaled = self.scaled_coordinates(points)
        kernel = correlations(scaled, self.points, self.smoothness)
        terms = self._terms(scaled)
        unit = (self.scale * self.std / self.std_factor) ** 2
        variances = unit * self._variances(kernel, terms)
        of_run = self.std_factor * np.sqrt(variances + self.noise_variances(scaled))
        # Of a process that errs less than it says, runs without noise show that.
        of_mean = np.minimum(np.sqrt(variances), of_run)
        return Prediction(*self._of_output(self._mean(kernel, terms), of_run, of_mean))

    def noise_variances(self, scaled: FloatArray) -> FloatArray:
        """Return the variance of the noise of a run at points, in units of the fitted variable.

        Parameters
        ----------
        scaled : ndarray, shape (run, coordinate)
            As `scaled_coordinates` gives them.
        """
        logarithm = np.full(len(scaled), self.noise_level)
        if self.noise_weights.any():
            own, others = (
                each * self.lengths / self.noise_lengths for each in (scaled, self.points)
            )
            logarithm += correlations(own, others, self.smoothness) @ self.noise_weights
        found: FloatArray = np.exp(logarithm)
        return found

    @property
    def _noise_at_runs(self) -> FloatArray:
        return self.noise_of_means

    @property
    def _noise_of_run(self) -> float:
        return 0.0

    @property
    def _variance_of_runs(self) -> float:
        own = (self.std / self.std_factor) ** 2
        return 1 + own * (self.nugget - float(self.noise_of_means.mean()))


def trend_terms(coordinates: FloatArray, *, is_linear: bool) -> FloatArray:
    """Return the terms of the trend at points, shape (run, term): 1 and, if linear, coordinates."""
    constant = np.ones((len(coordinates), 1))
    return np.hstack([constant, coordinates]) if is_linear else constant


# Likelihood of a Gaussian process: its lengths and its nugget from the runs.
#
# The coefficients of the trend and the variance follow from the other parameters. What is maximised
# is the restricted likelihood, which allows for the coefficients of the trend, and so does not take
# the variance too small where there are few runs.
#
# References
# ----------
# Santner, T. J., Williams, B. J. & Notz, W. I. (2018). The Design and Analysis of Computer
# Experiments, 2nd ed. Springer.

# Ranges of the lengths, for coordinates of variance 1, and of a nugget that is estimated.
_LENGTHS = (0.01, 300.0)
_NUGGETS = (1e-10, 10.0)
# Range of the variance of the process where the noise is known, for values of variance 1: that of a
# smooth one with a long length is far larger.
_VARIANCES = (1e-4, 1e8)

# First searches start from a long length for each input and one of these nuggets, and from lengths
# beside it, at most a factor of e away. The best of them is continued.
_STARTS = 3
_START_NUGGETS = (1e-6, 1e-2, 1e-6)
_START_VARIANCES = (10.0, 1.0, 100.0)
_FIRST_STEPS, _STEPS = 30, 200
# Of more runs than this, first searches take a part, and the last one fewer steps.
FEW_RUNS = 300
_STEPS_OF_MANY = 15
# A search ends where a step changes the likelihood by less than this share of its logarithm.
_TOLERANCE = 1e-8

# The value where correlations are singular to rounding: worse than any other.
_SINGULAR = 1e10


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters that the correlations depend on."""

    lengths: FloatArray  # (length,): in the units of the coordinates
    nugget: float  # variance of the noise, as a share of that of the process


@dataclass(frozen=True, eq=False)
class ProcessData:
    """Runs that a Gaussian process is fitted to."""

    points: FloatArray  # (run, coordinate): of variance about 1
    values: FloatArray  # (run,): the output, of variance about 1
    trend: FloatArray  # (run, term): the terms of the trend at the points
    smoothness: float  # that of the Matérn correlations
    nugget: float | None = None  # A given nugget; None if it is estimated
    # (coordinate,): the number of the length of each; None where each has its own.
    length_numbers: IntArray | None = None
    # (run,): known variances of the noise of the values, over `noise_level`, which is their mean.
    # What is estimated then is the variance of the process: the nugget is the level over it.
    noise: FloatArray | None = None
    noise_level: float = 1.0

    def nuggets(self, nugget: float) -> FloatArray | float:
        """Return the variances of the noise of the values, as shares of that of the process."""
        return nugget if self.noise is None else nugget * self.noise

    def scaled(self, lengths: FloatArray) -> FloatArray:
        """Return the points in units of the lengths."""
        return self.points / (
            lengths if self.length_numbers is None else lengths[self.length_numbers]
        )

    def part(self, runs: IntArray) -> ProcessData:
        """Return some of the runs."""
        points, values, trend = self.points[runs], self.values[runs], self.trend[runs]
        noise = None if self.noise is None else self.noise[runs]
        return replace(self, points=points, values=values, trend=trend, noise=noise)


@dataclass(frozen=True, eq=False)
class ConditionedProcess:
    """Gaussian process given its runs, at some lengths and nugget."""

    # (run, run): r⁻¹ - R⁻¹H (HᵀR⁻¹H)⁻¹ HᵀR⁻¹, with R the correlations and H the trend: all that a
    # likelihood needs of both.
    inverse: FloatArray
    weights: FloatArray  # (run,): it times the values
    coefficients: FloatArray  # (term,): of the trend, by generalised least squares
    variance: float  # that of the process
    # Mean square of what is left of the values, in units of all their variance, less 1: 0 where the
    # variance follows from the values.
    excess: float
    log_determinants: float  # ln det R + ln det HᵀR⁻¹H

    @classmethod
    def of_runs(
        cls, data: ProcessData, parameters: Parameters, correlation: FloatArray | None = None
    ) -> ConditionedProcess | None:
        """Condition a process on its runs; None where they are singular to rounding.

        Parameters
        ----------
        correlation : ndarray, shape (run, run), optional
            Between the runs without the nugget, if it is known. It is overwritten.
        """
        if correlation is None:
            scaled = data.scaled(parameters.lengths)
            correlation = correlations(scaled, scaled, data.smoothness)
        correlation[np.diag_indices_from(correlation)] += data.nuggets(parameters.nugget)
        factor, fault = linalg.lapack.dpotrf(correlation.T, lower=True, overwrite_a=True)
        if fault:
            return None
        log_determinant = 2 * np.log(np.diag(factor)).sum()
        # Solved, not multiplied by the inverse: what is left of the values stays near rounding.
        solved = linalg.cho_solve((factor, True), np.column_stack([data.values, data.trend]))
        by_values, by_trend = solved[:, 0], solved[:, 1:]
        trend = linalg.cholesky(data.trend.T @ by_trend, lower=True)
        coefficients = linalg.cho_solve((trend, True), data.trend.T @ by_values)
        weights = by_values - by_trend @ coefficients
        variance = float(data.values @ weights) / (len(data.values) - len(trend))
        if not variance > 0:
            return None
        excess = 0.0
        if data.noise is not None:
            left, variance = variance, data.noise_level / parameters.nugget
            excess = left / variance - 1
        lower, _ = linalg.lapack.dpotri(factor, lower=True, overwrite_c=True)
        projected = linalg.solve_triangular(trend, by_trend.T, lower=True)
        return cls(
            inverse=np.tril(lower) + np.tril(lower, -1).T - projected.T @ projected,
            weights=weights,
            coefficients=coefficients,
            variance=variance,
            excess=excess,
            log_determinants=float(log_determinant + 2 * np.log(np.diag(trend)).sum()),
        )


def negative_log_likelihood(data: ProcessData, parameters: Parameters) -> tuple[float, FloatArray]:
    """Return minus twice the restricted log-likelihood, but for a constant, and its gradient.

    Returns
    -------
    value : float
    gradient : ndarray, shape (length + 1,)
        In the logarithms of the lengths and of the nugget.
    """
    scaled = data.scaled(parameters.lengths)
    correlation, slopes = correlations_and_slopes(scaled, data.smoothness)
    process = ConditionedProcess.of_runs(data, parameters, correlation)
    if process is None:
        return _SINGULAR, np.zeros(len(parameters.lengths) + 1)
    freedom = len(data.values) - data.trend.shape[1]
    value = freedom * (math.log(process.variance) + process.excess) + process.log_determinants
    change = process.inverse
    change -= np.outer(process.weights, process.weights / process.variance)
    by_nugget = parameters.nugget * np.trace(change)
    if data.noise is not None:  # a larger nugget is a smaller variance of the process
        by_nugget = parameters.nugget * (data.noise @ np.diag(change)) + freedom * process.excess
    # A sum over pairs of w (x - x')² is one over points: 2 x² Σ w - 2 x w x'. A point is no pair.
    change *= slopes
    np.fill_diagonal(change, 0.0)
    by_length = 2 * (change.sum(axis=1) @ scaled**2 - (scaled * (change @ scaled)).sum(axis=0))
    if data.length_numbers is not None:
        by_length = np.bincount(data.length_numbers, by_length)
    return value, np.append(by_length, by_nugget)


def likeliest_parameters(data: ProcessData, rng: np.random.Generator) -> Parameters:
    """Search for the parameters of the largest likelihood.

    The search starts more than once, as a likelihood may have several maxima.
    """
    count, inputs = data.points.shape
    inputs = inputs if data.length_numbers is None else int(data.length_numbers.max()) + 1
    is_large = count > FEW_RUNS
    some = data.part(rng.choice(count, FEW_RUNS, replace=False)) if is_large else data
    shifts = np.vstack([np.zeros(inputs), rng.uniform(-1, 1, (_STARTS - 1, inputs))])
    nuggets: tuple[float, ...] = _START_NUGGETS
    if data.noise is not None:
        nuggets = tuple(data.noise_level / each for each in _START_VARIANCES)
    starts = (
        Parameters(2 * math.sqrt(inputs) * np.exp(shift), nugget)
        for shift, nugget in zip(shifts, nuggets, strict=True)
    )
    found = [improve_parameters(some, start, _FIRST_STEPS) for start in starts]
    best = min(found, key=lambda each: negative_log_likelihood(some, each)[0])
    return improve_parameters(data, best, _STEPS_OF_MANY if is_large else _STEPS)


def improve_parameters(data: ProcessData, start: Parameters, steps: int) -> Parameters:
    """Search from some parameters on, for a number of steps at most."""
    is_free = data.nugget is None
    inputs = len(start.lengths)
    nuggets = _NUGGETS
    if data.noise is not None:
        nuggets = data.noise_level / _VARIANCES[1], data.noise_level / _VARIANCES[0]

    def parameters(logarithms: FloatArray) -> Parameters:
        nugget = math.exp(logarithms[-1]) if data.nugget is None else data.nugget
        return Parameters(np.exp(logarithms[:inputs]), nugget)

    def objective(logarithms: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = negative_log_likelihood(data, parameters(logarithms))
        return value, gradient[: len(logarithms)]

    found = optimize.minimize(
        objective,
        np.log([*start.lengths, *[start.nugget] * is_free]),
        jac=True,
        method="L-BFGS-B",
        bounds=np.log([*[_LENGTHS] * inputs, *[nuggets] * is_free]),
        options={"maxiter": steps, "ftol": _TOLERANCE},
    )
    return parameters(found.x)
