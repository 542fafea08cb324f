"""Simultaneous bands of the mean curve and of quantile curves, over all places of a field."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import BAND_CONTENT, INTERVAL_LEVEL, LEFT_OUT_PLACES
from uqpen.core.model import Dimension
from uqpen.core.streams import Stream
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import quantile_estimates, sample_quantile
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.fields.field_sample import (
    FieldSample,
    ScalarAnalysis,
    along_field,
    at_each_place,
)
from uqpen.statistics.intervals import runs_needed, upper_rank
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.weights import effective_sizes

# The places of a field that a simultaneous band covers, and why it leaves out the others.

# With fewer, neither the scatter at a place nor its dependence on other places is known.
_FEWEST_RUNS = 20
# The curves of fewer replicates look more alike than they are.
_FEWEST_REPLICATES = 8
# Where fewer effective runs decide the variance, other runs would show another mean: of the many
# places of a field, some are always of this kind, and their intervals miss. With 5, bands of a
# travelling pulse cover in 92 %; with 10 in 95 %.
_FEWEST_EFFECTIVE_RUNS = 10
# Stretches of places along a curve that a text names one by one.
_MOST_STRETCHES = 4


@dataclass(frozen=True, eq=False)
class BandPlaces:
    """The places of a field that a band covers."""

    # For each place of the field, flattened, why it is left out; empty where it is not.
    reasons: tuple[str, ...]

    def without(self, condition: BoolArray, reason: str) -> BandPlaces:
        """Return the places without those of a condition, for a reason."""
        pairs = zip(self.reasons, condition.tolist(), strict=True)
        return BandPlaces(tuple(own or (reason if is_met else "") for own, is_met in pairs))

    @cached_property
    def covered(self) -> IntArray:
        """Positions of the places that the band covers."""
        return np.array([p for p, reason in enumerate(self.reasons) if not reason], dtype=np.int64)

    def left_out(self, dims: tuple[Dimension, ...]) -> dict[str, str]:
        """Return how many places are left out and why, along a curve also where, as an attribute.

        It is absent where none is left out.
        """
        by_reason: dict[str, list[int]] = {}
        for place, reason in enumerate(self.reasons):
            if reason:
                by_reason.setdefault(reason, []).append(place)
        text = "; ".join(
            texts.LEFT_OUT.format(
                places=len(places),
                of=len(self.reasons),
                reason=reason,
                extent=_extent(dims, places),
            )
            for reason, places in by_reason.items()
        )
        return {LEFT_OUT_PLACES: text} if text else {}


def reason_without_band(runs: Sample) -> str:
    """Return the reason why no simultaneous band of these runs is known; empty where one is."""
    if reason := runs.reason_without_intervals:
        return reason
    if reason := runs_too_few(runs):
        return reason
    if runs.weights is not None:
        return texts.NO_WEIGHTED_BAND
    if runs.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        return texts.NO_BAND_OF_ONE_SET
    if runs.error_model is ErrorModel.REPLICATED and runs.replicate_count < _FEWEST_REPLICATES:
        return texts.FEW_REPLICATES.format(replicates=_FEWEST_REPLICATES)
    return ""


def runs_too_few(runs: Sample) -> str:
    """Return the reason why the scatter of so few runs is not known; empty where it is."""
    return runs.too_few_runs if runs.size < _FEWEST_RUNS else ""


def band_places(field: FieldSample, reason: str = "") -> BandPlaces:
    """Return the places that a band covers: none for a reason, else those with enough scatter."""
    if reason:
        return BandPlaces((reason,) * field.matrix.shape[1])
    # The functions that pass over NaN need no copy of the field.
    varies = np.fmin.reduce(field.matrix, axis=0) < np.fmax.reduce(field.matrix, axis=0)
    is_reached = field.exists.sum(axis=0) >= _FEWEST_RUNS
    if field.runs.error_model is ErrorModel.REPLICATED:
        for replicate in range(field.runs.replicate_count):
            is_reached &= field.exists[field.runs.replicate == replicate].any(axis=0)
    few = texts.FEW_REACH.format(runs=_FEWEST_RUNS)
    return BandPlaces(
        tuple(
            few if not enough else "" if scatters else texts.CONSTANT_OUTPUT
            for enough, scatters in zip(is_reached.tolist(), varies.tolist(), strict=True)
        )
    )


def mean_band_places(field: FieldSample, reason: str = "") -> BandPlaces:
    """Return the places that a band of the mean covers: those that not only few runs decide.

    Replicates spread runs evenly, so that their scatter shows no jump that no run has met.
    Therefore their curves may not jump, either, from a place to the next one that differs.
    """
    found = band_places(field, reason)
    if not found.covered.size:
        return found
    few = texts.FEW_DECIDE_THE_MEAN.format(runs=_FEWEST_EFFECTIVE_RUNS)
    found = found.without(field.effective_runs < _FEWEST_EFFECTIVE_RUNS, few)
    if field.runs.error_model is ErrorModel.REPLICATED:
        jumps = texts.CURVES_MAY_JUMP.format(runs=_FEWEST_EFFECTIVE_RUNS)
        found = found.without(_runs_that_change(field) < _FEWEST_EFFECTIVE_RUNS, jumps)
    return found


@np.errstate(over="ignore", invalid="ignore")  # differences of the largest numbers
def _runs_that_change(field: FieldSample) -> FloatArray:
    """Return the effective runs that decide the changes to the next places, the fewest at each.

    Next are the places along each dimension at which some run differs; infinity without one.
    """
    shape = field.output.shape
    values, fewest = field.matrix.reshape(-1, *shape), np.full(shape, np.inf)
    for axis, size in enumerate(shape):
        along, found = np.moveaxis(values, axis + 1, 0), np.moveaxis(fewest, axis, 0)
        changes = [_effective_runs(along[k + 1] - along[k]) for k in range(size - 1)]
        for places in (range(size - 1), range(size - 2, -1, -1)):
            nearest = np.full(found.shape[1:], np.inf)
            for place in places:
                is_change = changes[place] > 0
                nearest = np.where(is_change, changes[place], nearest)
                behind = place + 1 if places.step > 0 else place
                found[behind] = np.minimum(found[behind], nearest)
    return fewest.ravel()


def _effective_runs(values: FloatArray) -> FloatArray:
    """Return the effective runs that decide the variance of values along runs; 0 without any."""
    is_known = ~np.isnan(values)
    sums = np.where(is_known, values, 0.0).sum(axis=0)
    deviations = np.nan_to_num(values - sums / np.maximum(is_known.sum(axis=0), 1))
    largest = np.abs(deviations).max(axis=0)
    squares = (deviations / np.where(largest > 0, largest, 1.0)) ** 2
    return effective_sizes(np.moveaxis(squares, 0, -1))


def _extent(dims: tuple[Dimension, ...], places: list[int]) -> str:
    """Return the stretches of places along a curve in words; empty for more dimensions."""
    if len(dims) != 1:
        return ""
    dimension = dims[0]
    unit = dimension.preferred_unit
    last = np.append(np.flatnonzero(np.diff(places) > 1), len(places) - 1)
    stretches = np.column_stack([np.append(0, last[:-1] + 1), last])
    template, joint = "{}", " to "
    if len(stretches) > _MOST_STRETCHES:
        template, joint, stretches = "between {}", " and ", stretches[[0, -1], [0, 1]][np.newaxis]
    shown = [
        joint.join(
            f"{scale(unit).from_si(dimension.values[places[each]]):.6g}"
            for each in dict.fromkeys(stretch)
        )
        for stretch in stretches.tolist()
    ]
    extent = ", ".join(shown) + (f" {unit}" if unit != DIMENSIONLESS else "")
    return f", {dimension.name} {template.format(extent)}"


# Deviations of the values of a field, or of functions of them, from their means.

# A function of values of shape (run, place) and of the positions of their places.
Influence = Callable[[FloatArray, IntArray], FloatArray | BoolArray]

# Places that are taken together, so that memory is bounded.
_PLACES = 256


def deviation_blocks(
    field: FieldSample, places: IntArray, influence: Influence
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield the deviations from their means at some places, in blocks.

    Parameters
    ----------
    field : FieldSample
        The field.
    places : ndarray of int, shape (place,)
        Positions of places that some run reaches.
    influence : callable
        Of the values at some places; whether they lie below a quantile, say.

    Yields
    ------
    places : ndarray of int, shape (block,)
        Those of the block.
    deviations : ndarray, shape (run, block)
        They are 0 where a curve has ended.
    """
    for start in range(0, len(places), _PLACES):
        block = places[start : start + _PLACES]
        found = influence(field.matrix[:, block], block)
        exists = field.exists[:, block]
        if exists.all():
            yield block, found - found.mean(axis=0)
        else:
            known = np.where(exists, found, 0.0)
            yield block, np.where(exists, known - known.sum(axis=0) / exists.sum(axis=0), 0.0)


# The level at which the intervals at all places of a field hold at once.
#
# A simultaneous band consists of the intervals at each place, at a common level above the stated
# one. The level follows from how the errors at the places depend on each other: they are simulated,
# and the furthest of all places counts.

# The rank of the level among one more than these is a whole number for 90, 95 and 99 %.
_DRAWS = 999
# More runs are added up in so many groups, which show the dependence between places as well.
_MOST_GROUPS = 1024
# Numbers that are simulated together, so that memory is bounded: 32 MB.
_MOST_VALUES = 2**22


def simultaneous_level(runs: Sample, deviations: Iterable[FloatArray]) -> float:
    """Return the level at which intervals at all places hold at once with the sample's level.

    Parameters
    ----------
    runs : Sample
        All runs of a field. Replicates, where there are any, are the only independent groups.
    deviations : iterable of ndarray, shape (run, place)
        Influence of each run on the estimate at each place, in blocks of places. At each place
        they add up to zero, and are 0 in runs that do not reach it.

    Returns
    -------
    float
        At least the sample's level.

    Notes
    -----
    The errors of independent runs are simulated as sums of the deviations times independent normal
    numbers, relative to their standard deviation (Gaussian multiplier bootstrap: Chernozhukov, V.,
    Chetverikov, D. & Kato, K. (2014). Ann. Statist. 42, 1787-1818). Of a few replicates each error
    has a standard deviation of its own, so that one of them is often too small: as many normal
    curves as there are replicates are simulated, with the correlation of their means, and the mean
    of these curves relative to their own standard deviation counts.
    """
    is_replicated = runs.error_model is ErrorModel.REPLICATED
    group = runs.replicate  # of many runs neighbouring ones are together
    if not is_replicated:
        group = np.arange(runs.size) * min(runs.size, _MOST_GROUPS) // max(runs.size, 1)
    groups = int(group[-1]) + 1 if group.size else 0
    draws = max(_DRAWS, math.ceil(runs.level / (1 - runs.level)))
    copies = groups if is_replicated else 1
    normal = _normal_numbers(draws * copies, groups)
    largest = np.zeros(draws)
    for correlated in _correlated(deviations, group, groups, most=_MOST_VALUES // len(normal)):
        # A matrix product is right here: the level is a simulated one, to three digits.
        curves = (normal @ correlated).reshape(draws, copies, -1)
        scores = _studentised(curves) if is_replicated else curves[:, 0]
        np.maximum(largest, np.abs(scores).max(axis=1, initial=0.0), out=largest)
    rank = math.ceil(round(runs.level * (draws + 1), 6))
    critical = float(np.sort(largest)[rank - 1])
    beyond = special.stdtr(groups - 1, -critical) if is_replicated else special.ndtr(-critical)
    return max(1 - 2 * float(beyond), runs.level)


def _correlated(
    deviations: Iterable[FloatArray], group: IntArray, groups: int, *, most: int
) -> Iterator[FloatArray]:
    """Yield the sums of deviations over groups, of shape (group, place), with a norm of 1.

    Places without scatter between groups are left out.
    """
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], np.arange(groups))
    for block in deviations:
        sums = np.add.reduceat(block[order], starts, axis=0)
        largest = np.abs(sums).max(axis=0)
        sums = sums[:, largest > 0] / largest[largest > 0]  # so that no square overflows
        sums /= np.sqrt((sums**2).sum(axis=0))
        step = max(most, 1)
        yield from (sums[:, first : first + step] for first in range(0, sums.shape[1], step))


@lru_cache(maxsize=1)
def _normal_numbers(rows: int, columns: int) -> FloatArray:
    """Return the numbers of the simulation, the same for all bands of a field: 8 MB at most."""
    generator = Stream(0, "analyses", "simultaneous bands").generator()
    return generator.standard_normal((rows, columns))


def _studentised(curves: FloatArray) -> FloatArray:
    """Return the means of curves over their standard errors, shape (draw, place)."""
    count = curves.shape[1]
    sums = curves.sum(axis=1)
    squares = np.einsum("dcp,dcp->dp", curves, curves)
    variance = np.maximum(squares - sums**2 / count, 0.0) / (count - 1)
    found: FloatArray = sums / np.sqrt(count * variance)
    return found


def mean_band(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the mean of a field with a band that holds at all places at once.

    Yields
    ------
    name : str
        ``mean_band``.
    estimate : DataArray
        Along the dimensions of the field and ``bound``. The attribute ``pointwise_level`` is the
        level at each place.

    Notes
    -----
    A place where few runs decide the variance has no bounds.
    """
    places = mean_band_places(field, reason_without_band(field.runs))
    level = _level(field, places, lambda values, _: values)
    array = _at_level(sample_moments, field, quantity, level)
    yield "mean_band", _band(array, Estimate.from_array(array), field, places, level)


def quantile_band(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the requested quantiles of a field, each with a band that holds at all places.

    Yields
    ------
    name : str
        ``quantile_band``.
    estimate : DataArray
        Along the dimensions of the field, ``probability`` and ``bound``. The attribute
        ``pointwise_level`` is the level at each place, by probability.
    """
    places = band_places(field, reason_without_band(field.runs))
    array = _at_level(quantile_estimates, field, quantity, field.runs.level)
    curves = array.values[..., 0].reshape(len(places.reasons), -1).T
    levels = [_level(field, places, partial(_is_below, curve)) for curve in curves]
    found = Estimate.from_array(array)
    if places.covered.size:
        alone = [replace(quantity, quantiles=(p,)) for p in quantity.quantiles]
        wide = Estimate.stacked(
            Estimate.from_array(_at_level(quantile_estimates, field, one, level)[..., 0, :])
            for one, level in zip(alone, levels, strict=True)
        )
        # The error over replicates may suffice at the lower of the levels alone. The formula in its
        # place at the higher one may be narrower at an end. NaN stays: an end that does not exist.
        lower, upper = np.minimum(found.lower, wide.lower), np.maximum(found.upper, wide.upper)
        found = replace(wide, value=found.value, lower=lower, upper=upper)
    yield "quantile_band", _band(array, found, field, places, np.array(levels))


def _level(field: FieldSample, places: BandPlaces, influence: Influence) -> float:
    blocks = deviation_blocks(field, places.covered, influence)
    return simultaneous_level(field.runs, (deviations for _, deviations in blocks))


def _is_below(curve: FloatArray, values: FloatArray, places: IntArray) -> BoolArray:
    return values <= curve[places]


def _at_level(
    analysis: ScalarAnalysis, field: FieldSample, quantity: QuantityOfInterest, level: float
) -> xr.DataArray:
    """Return the first statistic of an analysis at each place, with intervals at a level."""
    at_level = replace(field, runs=replace(field.runs, level=level))
    return next(at_each_place(analysis, at_level, quantity, most=1))[1]


def _band(
    array: xr.DataArray, found: Estimate, field: FieldSample, places: BandPlaces, level: Any
) -> xr.DataArray:
    """Return an array with estimates as a band, without bounds at places that it leaves out."""
    own = [1] * (found.value.ndim - len(field.dims))
    reasons = np.array(places.reasons, dtype=object).reshape(*field.output.shape, *own)
    without = replace(Estimate.without_bounds(found.value), note=reasons)
    found = found.replace_at(reasons != "", without)
    found = found.replace_at(found.has_bounds, found.with_method(texts.SIMULTANEOUS))
    band = array.copy(deep=False, data=found.bounds)
    band.attrs["long_name"] += ", simultaneous bounds"
    band.attrs |= {INTERVAL_LEVEL: field.runs.level, **places.left_out(field.dims)}
    if places.covered.size:
        band.attrs["pointwise_level"] = level
    return band.assign_coords({name: (band.dims[:-1], text) for name, text in found.texts.items()})


# Tolerance bands: bands that hold a share of all curves as a whole, with confidence.


# The band of multiple 1 goes from the second of these quantiles to the last but one. With 0.05 and
# 0.95, bands of skewed curves are wider; with the extremes, those of heavy tails at many runs.
_PROBABILITIES = 0.0, 0.01, 0.5, 0.99, 1.0
# A distance is at least this share of the range. Else values that coincide at one end of a place
# let the band of all places grow without limit.
_LEAST_SHARE = 0.05
# Where fewer effective runs decide the variance, the runs do not show how far a curve may go. With
# 4, one band in 300 of a travelling pulse is still a thousand times as high as the pulse.
_FEWEST_BAND_RUNS = 5


@dataclass(frozen=True, eq=False)
class BandShape:
    """A family of bands around a median curve; a multiple of its distances gives one of them."""

    median: FloatArray  # (place,): the median curve; NaN where no run reaches, as both next
    below: FloatArray  # (place,): the distance to the low quantile
    above: FloatArray  # (place,): the distance to the high quantile
    # Whether the distance of a value y below a median m is m ln(m / y), and not m - y. Both are
    # equal near the median, but no multiple of the former leads to zero.
    is_positive: bool
    # (place,): whether few runs decide the spread at a place. Its distances are then the largest
    # ones of the field, but for those of the logarithm.
    is_widest: BoolArray

    @classmethod
    def of(cls, field: FieldSample, *, is_positive: bool) -> BandShape:
        """Return the shape that the runs of a field have."""
        quantiles = np.full((field.matrix.shape[1], len(_PROBABILITIES)), np.nan)
        for places, runs in field.samples():
            quantiles[places] = sample_quantile(runs, _PROBABILITIES)
        lowest, low, median, high, highest = quantiles.T
        below = _distance_below(median, low, is_positive=is_positive)
        least = _LEAST_SHARE * (highest - lowest)
        below, above = np.maximum(below, least), np.maximum(high - median, least)
        is_widest = field.effective_runs < _FEWEST_BAND_RUNS
        if is_widest.any():
            above = np.where(is_widest, np.nanmax(above), above)
        if is_widest.any() and not is_positive:
            below = np.where(is_widest, np.nanmax(below), below)
        return cls(median, below, above, is_positive, is_widest)

    def multiples(self, values: FloatArray, places: IntArray) -> FloatArray:
        """Return the multiples whose bands end at the values at some places, shape (run, place)."""
        median = self.median[places]
        below = _distance_below(median, values, is_positive=self.is_positive)
        found: FloatArray = np.where(
            values < median, below / self.below[places], (values - median) / self.above[places]
        )
        return found

    def ends(self, multiple: float) -> tuple[FloatArray, FloatArray]:
        """Return the lower and the upper end of the band of a multiple."""
        # Where the band leaves a place out, a distance may be infinite.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            below, upper = multiple * self.below, self.median + multiple * self.above
            if not self.is_positive:
                return self.median - below, upper
            return self.median * np.exp(-below / self.median), upper


def _distance_below(median: FloatArray, values: FloatArray, *, is_positive: bool) -> FloatArray:
    """Return how far values lie below their median."""
    if not is_positive:
        return median - values
    # A place that the band leaves out may have no positive values.
    with np.errstate(divide="ignore", invalid="ignore"):
        found: FloatArray = median * np.log(median / values)
    return found


# Content of the band that is always estimated.
_CONTENT = 0.95
# One run in so many is for the shape of the band.
_THIRD = 3
# Places that are taken together, so that memory is bounded.
_BAND_PLACES = 256


def tolerance_band(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the bands that hold a share of all curves, each curve at all of its places.

    One run in three, or one replicate in three, gives a median and the distances from it to a low
    and to a high quantile. A band goes to a multiple of these distances. The least multiple that
    holds each other run is its score, and the band's multiple is an order statistic of the scores
    (Wilks 1941). If the same runs gave both, the band would be too narrow. A curve that ends counts
    as far as it goes. If all runs are positive, so is the band. Where few runs decide the spread,
    the distances are those of the place that has the largest ones.

    Yields
    ------
    name : str
        ``tolerance_band``.
    estimate : DataArray
        Along the dimensions of the field, ``band_content`` and ``bound``. The estimate is the
        median of the runs that give the distances. The coordinate ``band_content_runs_needed`` is
        the least number of independent runs with a band.
    """
    runs = field.runs
    reason = texts.NOT_WEIGHTED if runs.weights is not None else runs.reason_without_intervals
    first, others = _parts(field)
    places = band_places(first, reason or runs_too_few(first.runs))
    shape = BandShape.of(first, is_positive=_is_positive(field, places))
    scores = _scores(shape, others, places)
    contents = sorted({_CONTENT, *quantity.tolerance_interval_contents})
    needed = [_runs_needed(content, runs.level) for content in contents]
    ranks = upper_rank(others.runs.size, contents, runs.level).tolist()
    multiples = [math.nan if math.isnan(rank) else scores[int(rank) - 1] for rank in ranks]
    is_independent = runs.error_model is ErrorModel.INDEPENDENT
    label = "discrete" if is_independent else "conservative"
    note = np.where(shape.is_widest, texts.WIDEST_DISTANCES, "")
    how = texts.MULTIPLES_OF_DISTANCES, label, note
    bands = [
        Estimate(shape.median, *shape.ends(multiple), *how).remove_bounds_at(
            np.isnan(multiple), texts.TOLERANCE_BAND_NEEDS.format(runs=fewest)
        )
        for multiple, fewest in zip(multiples, needed, strict=True)
    ]
    for why in set(filter(None, places.reasons)):
        bands = [band.remove_bounds_at(np.array(places.reasons) == why, why) for band in bands]
    array = Estimate.stacked(bands).to_array(
        BAND_CONTENT,
        units=quantity.output.unit,
        long_name=f"band that holds curves of {quantity.output.title} with a probability",
        coordinates=_content_coordinates(contents, needed),
        level=runs.level,
    )
    yield (
        "tolerance_band",
        along_field(array, field.output, runs.level).assign_attrs(places.left_out(field.dims)),
    )


def _parts(field: FieldSample) -> tuple[FieldSample, FieldSample]:
    """Return the runs for the shape of a band, and the others for its multiple.

    The runs of a replicate stay together: they know of each other.
    """
    runs = field.runs
    is_replicated = runs.error_model is ErrorModel.REPLICATED
    group = runs.replicate if is_replicated else np.arange(runs.size)
    is_shape = group % _THIRD == 0
    return _chosen(field, is_shape), _chosen(field, ~is_shape)


def _chosen(field: FieldSample, mask: BoolArray) -> FieldSample:
    runs = field.runs
    return replace(field, runs=replace(runs, values=runs.values[mask], used=runs.used[mask]))


def _runs_needed(content: float, level: float) -> int:
    """Return the least number of independent runs; two in three of them have scores."""
    return math.ceil(runs_needed(content, level) * _THIRD / (_THIRD - 1))


def _is_positive(field: FieldSample, places: BandPlaces) -> bool:
    """Return whether all runs are positive at all places of a band.

    If as many curves were not as a band may lose, a run would show it: almost certainly.
    """
    lowest = np.fmin.reduce(field.matrix, axis=0, initial=np.inf)
    return bool((lowest[places.covered] > 0).all())


def _scores(shape: BandShape, others: FieldSample, places: BandPlaces) -> FloatArray:
    """Return the ascending scores of the runs that did not make the shape."""
    scores = np.zeros(others.runs.size)
    for start in range(0, len(places.covered), _BAND_PLACES):
        block = places.covered[start : start + _BAND_PLACES]
        multiples = shape.multiples(others.matrix[:, block], block)
        np.fmax(scores, np.fmax.reduce(multiples, axis=1), out=scores)
    return np.sort(scores)


def _content_coordinates(contents: list[float], needed: list[int]) -> dict[str, Any]:
    """Return the contents as coordinates, with the least numbers of runs."""
    described = {"units": "1", "long_name": "probability that the band holds a curve"}
    of_runs = {"units": "1", "long_name": texts.RUNS_NEEDED_FOR_BAND}
    return {
        BAND_CONTENT: (BAND_CONTENT, np.array(contents), described),
        f"{BAND_CONTENT}_runs_needed": (BAND_CONTENT, needed, of_runs),
    }
