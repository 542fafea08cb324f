"""How several models differ at the same points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.figures.curves import Curve, span
from uqpen.figures.distributions import CUT
from uqpen.figures.models import curves_of_models
from uqpen.figures.part import Part
from uqpen.report.blocks import Axis, Block, Chart, Heading, Key, Table
from uqpen.report.marks import DASHES, Trace
from uqpen.report.sections.evidence import called, leading, titled
from uqpen.report.sections.functions import band_of, function_of
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
    names = [each.model for each in part.others]
    lower, upper, is_cut = span([curve.values for curve in curves])
    traces: list[Trace] = []
    keys: list[Key] = []
    for curve in curves:
        series = names.index(curve.name)
        dash = DASHES[series % len(DASHES)]
        drawn = curve.thinned().up_to(lower, upper)
        traces += band_of(drawn, series)
        traces.append(function_of(drawn, part.unit(output), series, dash))
        keys.append(Key(curve.name, series, "line", dash))
    notes = [f"no band of {curve.name}: {curve.note}" for curve in curves if not curve.has_band]
    if banded := [curve for curve in curves if curve.has_band]:
        notes.append(f"Shades: simultaneous {percent(banded[0].level)} bands, each for itself.")
    notes += [CUT] if is_cut else []
    return Chart(
        title=f"Probability that {titled(part, output)} is at most x, by {design}",
        summary="; ".join(
            f"by {curve.name} half lies at or below "
            f"{np.interp(0.5, curve.band[:, 0], curve.values):.4g} {part.unit(output)}"
            for curve in curves
        ),
        x=Axis(part.axis(output), (lower, upper)),
        y=Axis("P(at most x)", (0.0, 1.0)),
        traces=tuple(traces),
        keys=tuple(keys),
        notes=tuple(notes),
        height=340,
    )
