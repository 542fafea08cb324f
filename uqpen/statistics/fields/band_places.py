"""The places of a field that a simultaneous band covers, and why it leaves out the others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import LEFT_OUT
from uqpen.core.model import Dimension
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.statistics import texts
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.weights import effective_sizes

__all__ = [
    "BandPlaces",
    "band_places",
    "mean_band_places",
    "reason_without_band",
    "runs_too_few",
]

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
    """The places of a field that a band covers.

    Parameters
    ----------
    reasons : tuple of str
        For each place of the field, flattened, why it is left out; empty where it is not.
    """

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
        return {LEFT_OUT: text} if text else {}


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
    deviations = np.nan_to_num(values - _mean_of_known(values))
    largest = np.abs(deviations).max(axis=0)
    squares = (deviations / np.where(largest > 0, largest, 1.0)) ** 2
    return effective_sizes(np.moveaxis(squares, 0, -1))


def _mean_of_known(values: FloatArray) -> FloatArray:
    is_known = ~np.isnan(values)
    return np.where(is_known, values, 0.0).sum(axis=0) / np.maximum(is_known.sum(axis=0), 1)


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
