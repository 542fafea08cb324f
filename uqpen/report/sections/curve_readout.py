"""The estimates at each place of a curve, in a sentence that a slider selects."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import NOTE
from uqpen.report.place_selection import PlaceReadout
from uqpen.report.sections.leading_design import output_title
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.digits import estimate_text
from uqpen.results.table import below_label, exceedance_label, quantile_label
from uqpen.results.texts import unit_suffix

__all__ = ["place_readout"]


def place_readout(curve: CurveEstimates) -> PlaceReadout:
    """Return the estimates at each place; the place of the largest mean is shown first."""
    mean = curve.bounds("mean")
    is_known = mean is not None and np.isfinite(mean[:, 0]).any()
    return PlaceReadout(
        output=output_title(curve.view, curve.output),
        dimension=str(curve.view.attributes(curve.dimension).get("long_name", curve.dimension)),
        values=curve.places.tolist(),
        texts=_texts(curve),
        start=int(np.nanargmax(mean[:, 0])) if mean is not None and is_known else 0,
    )


def _texts(curve: CurveEstimates) -> list[str]:
    columns = list(_columns(curve))
    unit = unit_suffix(curve.view.unit(curve.dimension))
    texts = []
    for number, place in enumerate(curve.places.tolist()):
        found = [f"{label} {column[number]}" for label, column in columns if column[number]]
        found_text = "; ".join(found) or "no run gets this far"
        texts.append(f"At {place:.6g}{unit}: {found_text}.")
    return texts


def _columns(curve: CurveEstimates) -> Iterator[tuple[str, list[str]]]:
    """Yield the label of each statistic, and its texts by place; empty where there is none."""
    unit = unit_suffix(curve.view.unit(curve.output))
    for statistic, label in (("mean", "mean"), ("std", "sd")):
        if (bounds := curve.bounds(statistic)) is not None:
            yield label, _cells(bounds, _notes(curve, statistic), unit)
    for number, (p, bounds) in enumerate(curve.entries("quantile").items()):
        yield quantile_label(p), _cells(bounds, _notes(curve, "quantile", number), unit)
    for statistic, written in (("exceedance", exceedance_label), ("below", below_label)):
        for number, (text, bounds) in enumerate(curve.entries(statistic).items()):
            yield f"{written(str(text))} =", _cells(bounds, _notes(curve, statistic, number))
    if (bounds := curve.bounds("reached")) is not None:
        yield "share of runs that get this far", _cells(bounds, _notes(curve, "reached"))


def _notes(curve: CurveEstimates, statistic: str, entry: int = 0) -> list[str]:
    """Return the note on an entry of a statistic at each place."""
    array = curve.array(statistic)
    if array is None or NOTE not in array.coords:
        return [""] * curve.places.size
    notes = array.coords[NOTE].transpose(curve.dimension, ...).values
    return list(map(str, notes.reshape(curve.places.size, -1)[:, entry]))


def _cells(estimates: FloatArray, notes: list[str], unit: str = "") -> list[str]:
    """Return the estimate at each place with its interval, or with the reason for none."""
    cells = []
    for bounds, note in zip(estimates.tolist(), notes, strict=True):
        text = f"{estimate_text(*bounds)}{unit}" if np.isfinite(bounds[0]) else ""
        is_without = bool(text and note) and not np.isfinite(bounds[1:]).any()
        cells.append(f"{text} (no interval: {note})" if is_without else text)
    return cells
