"""Noise of a model: statistics of points whose runs were repeated.

A run of such a model is Y = f(x, ω). The inputs x decide its mean m(x) and its variance v(x); the
noise ω is drawn anew in each run. Var Y = Var m + E v, and the noise share is E v / Var Y.

The point is the unit of every error: its repeats have the inputs in common. All parts are unbiased:
E v is the mean of the variances s² within points, and Var m the variance of their means ȳ less
the noise of these, s²/r, of a point with r repeats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import INPUT, INPUT_SHARE, OF_MEAN
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.intervals import fieller_margins, student_quantile
from uqpen.statistics.moments.sample_moments import mean_estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import (
    DOUBTFUL_KURTOSIS,
    FEWEST_EFFECTIVE_RUNS,
    ErrorModel,
    Sample,
    SampleShape,
)
from uqpen.statistics.sensitivity.given_data import LocalRegressions, SampledVariable, VarianceParts
from uqpen.statistics.sensitivity.input_measures import (
    input_array,
    input_coordinate,
    reason_of_input,
)
from uqpen.statistics.sensitivity.local_regression import ResidualVariance
from uqpen.statistics.standard_errors import mean_margins, standard_error

# With fewer points, shares of the noise covered in 86 to 94 %.
ENOUGH_POINTS = 100
# With fewer points there are no indices: with 40 points they covered in 43 to 90 %.
_FEWEST_POINTS = 48
# Parts of an input's values, each with some points at least, in which the noise is shown.
_MOST_PARTS, _POINTS_OF_PART = 10, 30


class VariancePart(NamedTuple):
    """Part of the variance of the runs, over that variance."""

    value: float
    influence: FloatArray  # (point,): of each point, but for a constant


@dataclass(frozen=True)
class RepeatedSample:
    """A sample of points, each with two completed runs at least."""

    means: Sample  # its values are the means over the repeats of each point
    # (point,): the variance of the repeats of each point, over that of all runs.
    scatter: FloatArray
    repeats: IntArray  # (point,): the number of completed repeats of each point
    runs: SampleShape  # of all runs, as if each were by itself

    @classmethod
    def of(cls, points: Sample, values: FloatArray) -> RepeatedSample:
        """Return the sample of some repeats.

        Parameters
        ----------
        points : Sample
            The points; its values are not read.
        values : ndarray, shape (point, repeat)
            NaN where no run completed. A point with fewer than two that did is left out.
        """
        exists = ~np.isnan(values)
        enough, used = exists.sum(axis=1) >= 2, points.used
        if not enough.all():
            # Samples over the same points have one array of their numbers, and so the bins of the
            # inputs, in common.
            values, exists, used = values[enough], exists[enough], used[enough]
        flat = values[exists]
        everything = np.arange(flat.size)
        runs = SampleShape(
            Sample(
                values=flat,
                used=everything,
                missing=everything[:0],
                columns=InputColumns.none(flat.size),
                replicates=np.zeros(flat.size, dtype=np.int64),
                sampling=points.sampling,
            )
        )
        # Deviations over the largest, whose squares neither overflow nor vanish.
        deviations = np.zeros(values.shape)
        deviations[exists] = runs.deviations
        repeats = exists.sum(axis=1)
        centre = deviations.sum(axis=1) / np.maximum(repeats, 1)
        squares = (np.where(exists, deviations - centre[:, None], 0.0) ** 2).sum(axis=1)
        variance = float((runs.deviations**2).mean()) if flat.size else math.nan
        scatter = squares / (repeats - 1) / (variance or 1.0)
        own = runs.mean + centre * runs.scale
        means = replace(points, values=own, used=used)
        return cls(means, scatter, repeats, runs)

    @cached_property
    def deviations(self) -> FloatArray:
        """Deviations of the points' means, over the standard deviation of all runs."""
        shape = self.means.shape
        return shape.deviations * float(shape.scale / (self.unit or 1.0))

    @property
    def unit(self) -> float:
        """The standard deviation of all runs."""
        return float(self.runs.std)

    @cached_property
    def noise(self) -> VariancePart:
        """E v."""
        return VariancePart(float(self.scatter.mean()), self.scatter)

    @cached_property
    def noise_of_means(self) -> VariancePart:
        """The mean of v / r."""
        own = self.scatter / self.repeats
        return VariancePart(float(own.mean()), own)

    @cached_property
    def between(self) -> VariancePart:
        """The variance of the points' means, about the mean of the distribution."""
        squares = self.deviations**2
        return VariancePart(float(squares.mean()) + self._error_of_mean**2, squares)

    @cached_property
    def _error_of_mean(self) -> float:
        """Standard error of the mean; that of independent draws where the design allows none."""
        error, freedom = standard_error(self.means, self.deviations)
        return float(error if freedom else self.deviations.std() / math.sqrt(self.means.size))

    @cached_property
    def of_mean(self) -> VariancePart:
        """Var m."""
        between, noise = self.between, self.noise_of_means
        return VariancePart(between.value - noise.value, between.influence - noise.influence)

    @cached_property
    def whole(self) -> VariancePart:
        """Var Y."""
        mean, noise = self.of_mean, self.noise
        return VariancePart(mean.value + noise.value, mean.influence + noise.influence)

    @property
    def reason(self) -> str:
        """Reason why no interval is known for any part of the variance; empty where one is."""
        if not self.means.size:
            return texts.NO_REPEATED_POINT
        if reason := self.means.reason_without_intervals:
            return reason
        if not self.unit > 0:
            return texts.CONSTANT_OUTPUT
        # As for a standard deviation, few runs of a heavy tail decide each of the parts. The
        # repeats of a point do not add to their number.
        kurtosis = float(self.runs.kurtosis)
        effective = self.means.size / kurtosis
        if kurtosis > DOUBTFUL_KURTOSIS and effective < FEWEST_EFFECTIVE_RUNS:
            tail = texts.HEAVY_TAIL.format(kurtosis=kurtosis, runs=effective)
            return texts.NO_INTERVAL_AS.format(reason=tail)
        return ""

    @property
    def note(self) -> str:
        """Note on few points, or on a tail that they may not show."""
        if self.means.size < ENOUGH_POINTS:
            return texts.FEW_POINTS.format(points=ENOUGH_POINTS)
        return texts.DOUBTFUL_TAIL if self.means.shape.is_small else ""

    def share_of_noise(self) -> Estimate:
        """Estimate the share of the noise in the variance of the output."""
        noise, whole = self.noise, self.whole
        value = noise.value / whole.value if whole.value > 0 else math.nan
        if self.reason:
            return Estimate.without_bounds(value, self.reason)
        if not noise.value > 0:
            return Estimate.without_bounds(0.0, texts.NO_NOISE_SEEN)
        influence = (noise.influence - value * whole.influence) / whole.value
        margins = mean_margins(self.means, influence, is_heavy=False)
        ends = value - float(margins.below), value + float(margins.above)
        method = texts.DELTA_METHOD.format(error_model=self.means.error_model)
        return Estimate(value, *ends, method, self.label, self.note)

    @property
    def label(self) -> str:
        """Label of an interval."""
        is_single = self.means.error_model is ErrorModel.SINGLE_STRATIFIED_SET
        return "conservative" if is_single else "nominal"

    def root(self, part: VariancePart) -> Estimate:
        """Estimate the standard deviation whose square is a part of the variance."""
        value = math.sqrt(max(part.value, 0.0)) * self.unit
        if self.reason:
            return Estimate.without_bounds(value, self.reason)
        if not part.influence.any():
            return Estimate.without_bounds(value, texts.NO_NOISE_SEEN)
        # Few points have most of the noise, where it is skewed: both ends move out by the furthest.
        found = mean_margins(self.means, part.influence, is_heavy=False)
        below, above = float(found.below), float(found.above)
        if part is self.of_mean:
            # It may be 0, so it has no logarithm whose error is known.
            lower, upper = max(part.value - below, 0.0), max(part.value + above, 0.0)
            ends = math.sqrt(lower) * self.unit, math.sqrt(upper) * self.unit
            method = texts.ROOT_OF_INTERVAL
        else:
            # The error of the mean counts as well: of an output with two values that are equally
            # frequent, no run has an influence on the variance otherwise.
            quantile = student_quantile(self.means.degrees_of_freedom, self.means.level)
            of_mean = (quantile * self._error_of_mean) ** 2 if part is self.whole else 0.0
            exponents = [(each + of_mean) / (2 * part.value) for each in (below, above)]
            ends = value * math.exp(-exponents[0]), value * math.exp(exponents[1])
            method = texts.DELTA_ON_LOGARITHM
        method = method.format(error_model=self.means.error_model)
        return Estimate(value, *ends, method, self.label, self.note)

    def std(self) -> Estimate:
        """Estimate the standard deviation of the output, as `sample_moments` does from runs."""
        found = self.root(self.whole)
        if self.means.shape.hidden_tail:
            return Estimate.without_bounds(found.value, self.means.shape.hidden_tail)
        return found.remove_bounds_at(bool(self.reason), self.reason, texts.SEE_HALF_SPREAD)

    def first_order(self, column: int, *, is_of_mean: bool) -> Estimate:
        """Estimate the first-order index of an input, by its number.

        Parameters
        ----------
        column : int
        is_of_mean : bool
            True for the share of Var m that the input explains, else for that of Var Y.
        """
        if self.means.size < _FEWEST_POINTS:
            few = texts.TOO_FEW_POINTS.format(points=self.means.size)
            return Estimate.without_bounds(math.nan, few)
        if not self.unit > 0:
            return Estimate.without_bounds(math.nan, texts.CONSTANT_OUTPUT)
        if reason := reason_of_input(self.means, column):
            return Estimate.without_bounds(math.nan, reason)
        # Whatever noise the variance has besides that of the means ȳ, no input explains it.
        added = -self.noise_of_means.influence
        if not is_of_mean:
            added = added + self.scatter
        total = self.between.value + float(added.mean())
        if not total > 0:
            return Estimate.without_bounds(math.nan, texts.NOISE_HIDES_IT)
        lines = self._lines(column)
        parts = VarianceParts(
            np.asarray(total),
            lines.variance + added.mean(),
            self.between.influence + added,
            lines.influence + added,
            lines.pair_noise,
        )
        halved = partial(self._halved_share, column, float(added.mean()), total)
        found = SampledVariable(self.means).estimates(parts, halved)
        return self._by_fieller(found, parts) if is_of_mean else found

    def along(self, column: int) -> Estimate:
        """Estimate the deviation of the noise in parts of an input's values, shape (part,).

        The parts are of equal probability. Equal values are in one part.
        """
        parts = min(max(self.means.size // _POINTS_OF_PART, 1), _MOST_PARTS)
        if self.means.columns.is_coded(column):
            return Estimate.without_bounds(np.full(parts, math.nan), texts.CODES_WITHOUT_ORDER)
        ranks = self.means.run_inputs.ordering(column).mean_ranks
        number = np.ceil(ranks * parts / self.means.size).astype(np.int64) - 1
        found = []
        for part in range(parts):
            at = number == part
            if np.count_nonzero(at) < _POINTS_OF_PART:
                few = texts.TOO_FEW_POINTS.format(points=np.count_nonzero(at))
                found.append(Estimate.without_bounds(math.nan, few))
                continue
            value = float(self.scatter[at].mean())
            influence = np.where(at, self.scatter - value, 0.0) / at.mean()
            found.append(self.root(VariancePart(value, influence)))
        return Estimate.stacked(found)

    def _lines(self, column: int, *, halved: bool = False) -> ResidualVariance:
        """Return the points' means about the lines of an input's bins, which both indices need."""
        key = column, halved
        if key not in self._made:
            bins = LocalRegressions(self.means).bins(column, halved=halved)
            self._made[key] = ResidualVariance(bins, self.deviations)
        return self._made[key]

    @cached_property
    def _made(self) -> dict[tuple[int, bool], ResidualVariance]:
        return {}

    def _halved_share(self, column: int, added: float, total: float, _: BoolArray) -> FloatArray:
        """Return the share that bins of half the size explain."""
        left = self._lines(column, halved=True).variance + added
        return np.atleast_1d(1 - left / total)

    def _by_fieller(self, found: Estimate, parts: VarianceParts) -> Estimate:
        """Return an index with Fieller's set, as noise leaves the variance of m uncertain."""
        if self.reason or not found.has_bounds.all():
            return found.remove_bounds_at(bool(self.reason), self.reason)
        total = float(parts.total)
        ratio = float(parts.left) / total
        of_index = (ratio * parts.squares - parts.left_influence) / total
        of_total = parts.squares / total
        own, freedom = standard_error(self.means, of_total)
        together, apart = (
            float(standard_error(self.means, of_index + sign * of_total)[0]) for sign in (1, -1)
        )
        quantile = student_quantile(freedom, self.means.level)
        error = float(found.value - found.lower) / quantile
        below, above = fieller_margins(error, (together**2 - apart**2) / 4, own, quantile)
        method = texts.FIELLER.format(error_model=self.means.error_model)
        upper = np.minimum(np.maximum(found.value + above, found.upper), 1.0)
        replaced = replace(found, lower=found.value - below, upper=upper, method=method)
        return replaced.remove_bounds_at(~np.isfinite(below), texts.NOISE_HIDES_IT)


def noise_statistics(sample: RepeatedSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Statistics of a model with noise, from points whose runs were repeated.

    Yields
    ------
    name : str
        ``mean``, ``std``; ``noise_share``, ``noise_std``, ``mean_given_inputs_std``, of the parts
        of the variance.
    estimate : DataArray
        Along ``bound``.
    """
    if quantity.output.categories:
        return
    title, unit, level = quantity.output.title, quantity.output.unit, sample.means.level
    for name, units, found, long_name in (
        ("mean", unit, mean_estimate(sample.means, quantity), "mean of {}"),
        ("std", unit, sample.std(), "standard deviation of {}"),
        ("noise_share", "1", sample.share_of_noise(), "share of the noise in the variance of {}"),
        ("noise_std", unit, sample.root(sample.noise), "standard deviation of the noise of {}"),
        (
            "mean_given_inputs_std",
            unit,
            sample.root(sample.of_mean),
            "standard deviation of the mean of {} given the inputs",
        ),
    ):
        counted = found if name == "noise_share" else found.with_method(texts.CLUSTERS)
        counted = found.replace_at(found.has_bounds, counted)
        yield name, counted.to_array(units=units, long_name=long_name.format(title), level=level)


def first_order_with_noise(sample: RepeatedSample, quantity: QuantityOfInterest) -> NamedArrays:
    """First-order indices of a model with noise, from points whose runs were repeated.

    Yields
    ------
    name : str
        ``first_order``, of the whole output, and ``mean_first_order``, of its mean given the
        inputs.
    estimate : DataArray
        Along ``input`` and ``bound``.
    """
    title, inputs = quantity.output.title, sample.means.inputs
    if quantity.output.categories or not inputs:
        return
    note = texts.INCLUDES_CORRELATION if sample.means.dependence else ""
    for prefix, of in (("", title), (OF_MEAN, f"the mean of {title} given the inputs")):
        found = [
            sample.first_order(column, is_of_mean=bool(prefix)).with_note(note)
            for column in range(len(inputs))
        ]
        long_name = f"first-order Sobol' indices of {of}"
        array = input_array(found, inputs, long_name, level=sample.means.level)
        yield f"{prefix}first_order", array


def noise_along_inputs(sample: RepeatedSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Noise of a model by where an input is, from points whose runs were repeated.

    Yields
    ------
    name : str
        ``noise_std_along``, the standard deviation of the noise.
    estimate : DataArray
        Along ``input_share``, ``input`` and ``bound``: in parts of equal probability of each input,
        by the probability below their middle.
    """
    inputs, title = sample.means.inputs, quantity.output.title
    if quantity.output.categories or not inputs or not sample.means.size:
        return
    found = Estimate.stacked([sample.along(column) for column in range(len(inputs))])
    parts = len(found.value)
    yield (
        "noise_std_along",
        found.replace_at(found.has_bounds, found.with_method(texts.CLUSTERS)).to_array(
            INPUT_SHARE,
            INPUT,
            units=quantity.output.unit,
            long_name=f"standard deviation of the noise of {title} in parts of an input's values",
            coordinates={
                INPUT_SHARE: (np.arange(parts) + 0.5) / parts,
                **input_coordinate(inputs),
            },
            level=sample.means.level,
        ),
    )
