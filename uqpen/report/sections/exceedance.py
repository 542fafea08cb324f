"""How likely an output is to go beyond a value: its tail, by logarithms."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.cdfs import cdf_at
from uqpen.archive.read import group
from uqpen.figures.curves import Curve
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number
from uqpen.labels import EXCEEDANCE
from uqpen.report.blocks import Axis, Chart, Key
from uqpen.report.counting import counted
from uqpen.report.marks import Trace, band, dots, line, written
from uqpen.report.notes import bars_of
from uqpen.report.sections.evidence import left_out, sample_of, titled
from uqpen.summary.digits import percent, sensible
from uqpen.summary.table import OutputTable, exceedance_label

__all__ = ["exceedance"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# How far below the least probability that runs can tell the axis goes on.
_BELOW = 0.3
# Widths of the axis by which it is made longer, at the most, for a value that is asked for.
_FAR = 1.5
# Points of the line, at the most.
_MOST = 200


def exceedance(part: Part, output: str, curve: Curve) -> Iterator[Chart]:
    """The probability of exceeding each value, with those that the study asks for.

    Nothing where no run exceeds another.
    """
    values, tail = _tail(part, output, curve)
    if not values.size:
        return
    least = _BELOW / max(curve.runs, 10)
    traces, keys = _drawn(part, output, curve, values, np.maximum(tail, least))
    asked = group(part.tree, EXCEEDANCE, curve.name).get(output)
    notes = left_out(part, curve.name)
    if asked is not None:
        is_shown = _is_shown(part, output, asked, values)
        if is_shown.any():
            traces.append(_asked(part, output, asked[is_shown]))
            keys.append(Key("asked for beforehand", "ink", "circle"))
        notes = [*bars_of([asked[is_shown]]), *notes, *_not_shown(output, asked[~is_shown])]
    yield Chart(
        title=f"Probability that {titled(part, output)} is more than x",
        summary=_summary(output, asked, curve),
        x=Axis(part.axis(output)),
        y=Axis("P(more than x)", (np.log10(least).item(), 0.0), is_logarithmic=True),
        traces=tuple(traces),
        keys=tuple(keys),
        notes=tuple(notes),
        tables=_tables(curve, output, asked),
        height=280,
    )


def _drawn(
    part: Part, output: str, curve: Curve, values: FloatArray, tail: FloatArray
) -> tuple[list[Trace], list[Key]]:
    """What exceeds each value, with its band."""
    series = part.sources.index(curve.name)
    unit = after_number(part.unit(output))
    function = line(
        values,
        tail[:, 0],
        series,
        hover=f"P(more than %{{x:.4~g}}{written(unit)}) = %{{y:.3~g}}",
        name=curve.name,
        is_stepped=curve.is_stepped,
    )
    key = Key(curve.name, series, "line")
    if not curve.has_band:
        return [function], [key]
    # What is left above a value is least where the function is greatest.
    banded = band(values, tail[:, 2], tail[:, 1], series, is_stepped=curve.is_stepped)
    text = f"simultaneous {percent(curve.level)} band"
    return [*banded, function], [Key(text, series, "band"), key]


def _tail(part: Part, output: str, curve: Curve) -> tuple[FloatArray, FloatArray]:
    """Values that lie as far apart as the logarithms of what exceeds them, and that with its band.

    The archive's function has equally spaced ranks, of which few lie in the tail.
    """
    sample = sample_of(part, curve.name, output)
    left = np.arange(1, sample.size + 1)
    if sample.size > _MOST:
        left = np.geomspace(1, sample.size, _MOST).round().astype(np.int64)
    values = np.unique(sample.ordered[sample.size - left])
    told = 1 - cdf_at(sample, values).values
    # The largest value leaves nothing above it, which has no logarithm.
    above = told[:, 0] > 0
    shown: FloatArray = part.measure(output).from_si(values[above])
    return shown, told[above]


def _is_shown(part: Part, output: str, asked: xr.DataArray, values: FloatArray) -> BoolArray:
    """Which of the probabilities asked for have a logarithm, and lie where the tail can be seen."""
    places = part.measure(output).from_si(asked[f"{output}_threshold_value"].values)
    lower, upper = (values.min(), values.max()) if values.size else (-np.inf, np.inf)
    reach = _FAR * (upper - lower) or np.inf
    is_near = (places >= lower - reach) & (places <= upper + reach)
    return np.asarray(is_near & (asked.values[:, 0] > 0))


def _asked(part: Part, output: str, asked: xr.DataArray) -> Trace:
    """The probabilities that the study asks for."""
    places = part.measure(output).from_si(asked[f"{output}_threshold_value"].values)
    hovers = [f"{label} = {cells[0]}" for label, cells in _rows(output, asked)]
    # An end at 0 has no logarithm.
    bounds = np.where(asked.values > 0, asked.values, np.nan)
    return dots(bounds, places, "ink", hovers=hovers, name="asked", along="y")


def _not_shown(output: str, asked: xr.DataArray) -> list[str]:
    """Which of them are no dots, as a note; none where all are."""
    labels = [label for label, _ in _rows(output, asked)]
    return [f"In the table alone: {', '.join(labels)}."] if labels else []


def _summary(output: str, asked: xr.DataArray | None, curve: Curve) -> str:
    if asked is None:
        return f"It falls from 1 to what {counted(curve.runs, 'run')} of {curve.name} can tell."
    return "; ".join(f"{label}: {cells[0]}" for label, cells in _rows(output, asked)) + "."


def _rows(output: str, asked: xr.DataArray) -> list[tuple[str, list[str]]]:
    labels = [exceedance_label(str(text)) for text in asked[f"{output}_threshold"].values]
    return [(label, [sensible(*row)]) for label, row in zip(labels, asked.values, strict=True)]


def _tables(curve: Curve, output: str, asked: xr.DataArray | None) -> tuple[OutputTable, ...]:
    if asked is None:
        return ()
    title = f"Probabilities asked for, by {curve.name}"
    return (OutputTable(title, [curve.name], _rows(output, asked)),)
