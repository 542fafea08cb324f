"""The estimates at each place of a curve, in a sentence that a slider selects."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.charts.chart import PlaceColumn, PlaceReadout
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import NOTE
from uqpen.results.archive_view import output_title
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.statistic_entries import THRESHOLD_PROBABILITIES
from uqpen.results.table import entry_label, quantile_label
from uqpen.results.texts import unit_suffix

__all__ = ["place_readout"]


def place_readout(curve: CurveEstimates) -> PlaceReadout:
    """Return the estimates at each place; that of the largest standard deviation is first."""
    unit = unit_suffix(curve.view.unit(curve.dimension))
    return PlaceReadout(
        output=output_title(curve.view, curve.output),
        dimension=str(curve.view.attributes(curve.dimension).get("long_name", curve.dimension)),
        values=curve.places,
        heads=[f"{number_text(place, 6)}{unit}" for place in curve.places.tolist()],
        columns=list(_columns(curve)),
        start=_first_place(curve),
    )


def _first_place(curve: CurveEstimates) -> int:
    """Return where runs differ most, or where the mean is largest if no deviation is known."""
    for statistic in ("std", "mean"):
        bounds = curve.bounds(statistic)
        if bounds is not None and np.isfinite(bounds[:, 0]).any():
            return int(np.nanargmax(bounds[:, 0]))
    return 0


def _columns(curve: CurveEstimates) -> Iterator[PlaceColumn]:
    """Yield each statistic at the places."""
    unit = unit_suffix(curve.view.unit(curve.output))
    for statistic, label in (("mean", "mean"), ("std", "sd")):
        if (bounds := curve.bounds(statistic)) is not None:
            yield _column(label, unit, bounds, _notes(curve, statistic))
    for number, (p, bounds) in enumerate(curve.entries("quantile").items()):
        yield _column(quantile_label(p), unit, bounds, _notes(curve, "quantile", number))
    for probability in THRESHOLD_PROBABILITIES:
        for number, (text, bounds) in enumerate(curve.entries(probability.name).items()):
            label = f"{entry_label(probability, text)} ="
            yield _column(label, "", bounds, _notes(curve, probability.name, number))
    if (bounds := curve.bounds("reached")) is not None:
        yield _column("share of runs that get this far", "", bounds, _notes(curve, "reached"))


def _notes(curve: CurveEstimates, statistic: str, entry: int = 0) -> list[str]:
    """Return the note on an entry of a statistic at each place."""
    array = curve.array(statistic)
    if array is None or NOTE not in array.coords:
        return [""] * curve.places.size
    notes = array.coords[NOTE].transpose(curve.dimension, ...).values
    return list(map(str, notes.reshape(curve.places.size, -1)[:, entry]))


def _column(label: str, unit: str, estimates: FloatArray, notes: list[str]) -> PlaceColumn:
    """Return the estimates with their intervals, and the reasons where there is none."""
    lacks = np.isfinite(estimates[:, 0]) & ~np.isfinite(estimates[:, 1:]).any(axis=1)
    reasons = {at: notes[at] for at in np.flatnonzero(lacks).tolist() if notes[at]}
    return PlaceColumn(label, unit, [estimate_text(*row) for row in estimates.tolist()], reasons)
