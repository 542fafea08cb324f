"""How several models differ at the same points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from uqpen.figures.curves import Curve, span
from uqpen.figures.distributions import CUT
from uqpen.figures.models import curves_of_models
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, capitalized
from uqpen.report.blocks import Axis, Block, Chart, Heading, Key, Table
from uqpen.report.marks import Trace, dash_of
from uqpen.report.sections.evidence import called, leading, titled
from uqpen.report.sections.functions import Grid, band_of, function_of, reached, read_at
from uqpen.summary.digits import percent
from uqpen.summary.tables import difference_tables

__all__ = ["models"]


def models(part: Part) -> Iterator[Block]:
    """Distribution functions by each of several models, and the models' differences."""
    if not part.model:
        return
    design = leading(part)
    for output in part.numbers if design else ():
        if curves := curves_of_models(part, output, design or ""):
            yield Heading(called(part, output))
            yield _chart(part, output, design or "", curves)
    for table in difference_tables(part.archive):
        yield Table(table)


def _chart(part: Part, output: str, design: str, curves: list[Curve]) -> Chart:
    parts = {each.model: each for each in part.others}
    lower, upper, is_cut = span([curve.values for curve in curves])
    grid = Grid.between(lower, upper)
    traces: list[Trace] = []
    keys: list[Key] = []
    for curve in curves:
        series = list(parts).index(curve.name)
        dash = dash_of(series)
        by_design = replace(curve, name=design)
        drawn = replace(read_at(parts[curve.name], output, by_design, grid), name=curve.name)
        traces += band_of(drawn, series, is_stepped=curve.is_stepped)
        traces.append(function_of(drawn, series, dash, is_stepped=curve.is_stepped))
        keys.append(Key(curve.name, series, "line", dash))
    notes = [f"no band of {curve.name}: {curve.note}" for curve in curves if not curve.has_band]
    if banded := [curve for curve in curves if curve.has_band]:
        notes.append(f"Shades: simultaneous {percent(banded[0].level)} bands, each for itself.")
    notes += [f"{capitalized(CUT)}."] if is_cut else []
    return Chart(
        title=f"Probability that {titled(part, output)} is at most x, by {design}",
        summary=" ".join(
            f"By {curve.name} half lies at or below "
            f"{reached(curve, 0.5):.4g}{after_number(part.unit(output))}."
            for curve in curves
        ),
        x=Axis(part.axis(output), (lower, upper)),
        y=Axis("P(at most x)", (0.0, 1.0)),
        traces=tuple(traces),
        keys=tuple(keys),
        notes=tuple(notes),
        height=340,
        is_compared=True,
    )
