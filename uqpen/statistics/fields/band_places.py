"""The places of a field that a simultaneous band covers, and why it leaves out the others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import IntArray
from uqpen.core.model import Dimension
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.statistics import texts
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.sample import ErrorModel, Sample

__all__ = ["LEFT_OUT", "BandPlaces", "band_places", "reason_without_band", "runs_too_few"]

# Attribute of a band: the places that it leaves out.
LEFT_OUT = "left_out"

# With fewer, neither the scatter at a place nor its dependence on other places is known.
_FEWEST_RUNS = 20
# The curves of fewer replicates look more alike than they are.
_FEWEST_REPLICATES = 8


@dataclass(frozen=True, eq=False)
class BandPlaces:
    """The places of a field that a band covers.

    Parameters
    ----------
    reasons : tuple of str
        For each place of the field, flattened, why it is left out; empty where it is not.
    """

    reasons: tuple[str, ...]

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


def _extent(dims: tuple[Dimension, ...], places: list[int]) -> str:
    """Return the range of places along a curve in words; empty for fields of more dimensions."""
    if len(dims) != 1:
        return ""
    dimension = dims[0]
    ends = (dimension.values[places[0]], dimension.values[places[-1]])
    unit = dimension.preferred_unit
    shown = [f"{scale(unit).from_si(value):.6g}" for value in dict.fromkeys(ends)]
    ends_text = " to ".join(shown) + (f" {unit}" if unit != DIMENSIONLESS else "")
    return f", {dimension.name} {ends_text}"
