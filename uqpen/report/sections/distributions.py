"""How each output is distributed: its distribution function, its histogram, its quantiles."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from uqpen.analyses.quantiles import quantiles
from uqpen.archive.read import group
from uqpen.figures.curves import Curve
from uqpen.figures.distributions import CUT, curves_of, ends_of, thresholds_of
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, capitalized
from uqpen.labels import INTERVAL_LEVEL, SHARES
from uqpen.report.blocks import Axis, Block, Chart, Charts, Heading, Key, Reading, Table
from uqpen.report.marks import Trace, dash_of
from uqpen.report.sections.evidence import called, leading, left_out, question_of, sample_of, titled
from uqpen.report.sections.exceedance import exceedance
from uqpen.report.sections.functions import Grid, band_of, function_of, reached, read_at
from uqpen.report.sections.histograms import histogram, shares
from uqpen.report.shapes import upright
from uqpen.summary.digits import percent
from uqpen.summary.table import OutputTable, quantile_label

__all__ = ["distributions"]

FloatArray = npt.NDArray[np.float64]

# Quantiles in the table, where the runs tell them.
_QUANTILES = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
# Probabilities at which the numbers behind a distribution function are shown.
_SHOWN = np.linspace(0, 1, 21)


def distributions(part: Part) -> Iterator[Block]:
    """Distribution function with its band, histogram and quantiles of each output."""
    design = leading(part)
    if design is None:
        return
    for output in part.numbers:
        if curves := _curves(part, output, design):
            yield Heading(called(part, output))
            yield _cdf(part, output, curves)
            runs = histogram(part, output, design)
            yield Charts((runs, *exceedance(part, output, curves[0])))
            yield Table(_quantile_table(part, output, design))
    for output in part.kinds:
        if output in group(part.tree, SHARES, design):
            yield Heading(called(part, output))
            yield shares(part, output, design)


def _curves(part: Part, output: str, design: str) -> list[Curve]:
    """The functions that all sources tell, that of the leading design first."""
    found = curves_of(part, output)
    return sorted(found, key=lambda curve: curve.name != design)


def _cdf(part: Part, output: str, curves: list[Curve]) -> Chart:
    lower, upper, is_cut = ends_of(part, output, curves[0])
    grid = Grid.between(lower, upper)
    first = read_at(part, output, curves[0], grid)
    lead = part.sources.index(first.name)
    steps = curves[0].is_stepped
    traces: list[Trace] = list(band_of(first, lead, is_stepped=steps))
    keys: list[Key] = []
    if first.has_band:
        text = f"simultaneous {percent(first.level)} band of {first.name}"
        keys.append(Key(text, lead, "band"))
    traces.append(function_of(first, lead, "solid", is_stepped=steps, width=2.5))
    keys.append(Key(first.name, lead, "line"))
    for curve in curves[1:]:
        series = part.sources.index(curve.name)
        dash = dash_of(series)
        drawn, steps = read_at(part, output, curve, grid), curve.is_stepped
        traces.append(function_of(drawn, series, dash, is_stepped=steps, width=1.5, has_band=False))
        keys.append(Key(curve.name, series, "line", dash))
    asked = [each for each in thresholds_of(part, output).values() if lower <= each <= upper]
    begin = asked[0] if asked else reached(curves[0], 0.95)
    return Chart(
        title=f"Probability that {titled(part, output)} is at most x",
        summary=_summary(part, output, curves[0]),
        x=Axis(part.axis(output), (lower, upper)),
        y=Axis("P(at most x)", (0.0, 1.0)),
        traces=tuple(traces),
        shapes=tuple(upright(place, "quiet", "dot") for place in asked),
        keys=tuple(keys),
        notes=(*left_out(part, curves[0].name), *([f"{capitalized(CUT)}."] if is_cut else [])),
        tables=(_cdf_table(part, output, curves[0]),),
        height=380,
        is_compared=True,
        reading=_reading(part, output, first, grid, begin),
    )


def _summary(part: Part, output: str, curve: Curve) -> str:
    """The function in a sentence."""
    low, middle, high = (reached(curve, p) for p in (0.05, 0.5, 0.95))
    said = after_number(part.unit(output))
    return (
        f"By {curve.name} it rises from 5 % at {low:.4g}{said} through one half at "
        f"{middle:.4g}{said} to 95 % at {high:.4g}{said}. The table below has the numbers."
    )


def _cdf_table(part: Part, output: str, curve: Curve) -> OutputTable:
    """The function at some probabilities, with its band."""
    with_band = ", with its simultaneous band" * curve.has_band
    title = f"Distribution function by {curve.name}{with_band}"
    table = OutputTable(title, [part.axis(output), "P(at most)", "band"])
    ranks = np.unique(np.round(_SHOWN * (curve.values.size - 1)).astype(np.int64))
    for rank in ranks.tolist():
        estimate, lower, upper = curve.band[rank]
        ends = f"{lower:.4f} … {upper:.4f}" if curve.has_band else "–"
        cells = [f"{curve.values[rank]:.4g}", f"{estimate:.4f}", ends]
        table.rows.append((percent(round(rank / (curve.values.size - 1), 6)), cells))
    if not curve.has_band:
        table.mark(f"no band: {curve.note}")
    return table


def _reading(part: Part, output: str, curve: Curve, grid: Grid, begin: float) -> Reading:
    """What is read off at thresholds that are round numbers."""
    return Reading(
        output=output,
        unit=after_number(part.unit(output)).lstrip(),
        source=curve.name,
        level=curve.level,
        note=curve.note,
        first=float(grid.values[0]),
        step=grid.step,
        decimals=grid.decimals,
        start=int(np.argmin(np.abs(grid.values - begin))),
        bounds=[_exact(row) for row in curve.band.tolist()],
    )


def _exact(row: list[float]) -> list[float | None]:
    return [round(value, 9) if math.isfinite(value) else None for value in row]


def _quantile_table(part: Part, output: str, design: str) -> OutputTable:
    """Quantiles and their intervals, worked out from the archive's runs."""
    convert = part.measure(output).from_si
    asked = question_of(part, output, _QUANTILES)
    ((_, told),) = quantiles(sample_of(part, design, output), asked)
    level = float(told.attrs[INTERVAL_LEVEL])
    has_any = bool(np.isfinite(told.values[:, 1:]).any())
    with_intervals = f", with {percent(level)} intervals" * has_any
    table = OutputTable(f"Quantiles by {design}{with_intervals}", [part.axis(output)])
    for position, p in enumerate(_QUANTILES):
        table.rows.append((quantile_label(p), [table.cell(told[position], convert)]))
    return table
