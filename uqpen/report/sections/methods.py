"""What all sources say of the same statistics, side by side, and what it cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.archive.told import told
from uqpen.figures.estimates import REFUSED_NOTE
from uqpen.figures.methods import Statistic, statistics
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, with_unit
from uqpen.labels import INTERVAL_LABEL, REFUSED
from uqpen.report.blocks import Axis, Block, Chart, Charts, Heading, Key, Table, Text
from uqpen.report.marks import Trace, crosses, dots, marker_of
from uqpen.report.notes import bars_of, has_interval
from uqpen.report.sections.costs import costs
from uqpen.report.sections.evidence import called, titled
from uqpen.summary.table import figure_text, unchanged
from uqpen.summary.tables import statistics_table
from uqpen.units import DIMENSIONLESS

__all__ = ["methods"]

# Outputs that are drawn, and rows of a chart in CSS pixels.
_MOST_OUTPUTS = 6
_ROW, _FRAME = 22, 66


def methods(part: Part) -> Iterator[Block]:
    """The statistics of each output by all sources, and what their intervals cost."""
    outputs = [each for each in (*part.numbers, *part.kinds) if _told(part, each)]
    for output in outputs[:_MOST_OUTPUTS]:
        found = _told(part, output)
        yield Heading(called(part, output))
        if len(rows := _rows(part, found)) > 1:
            yield _side_by_side(part, output, found, rows)
            yield from costs(part, output, found)
        else:
            yield Text(f"There is one source only, {rows[0]}, so nothing stands beside it.")
            yield from _tables(part, output)
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Without charts, as there are so many outputs: {', '.join(left)}.")
        for output in left:
            yield from _tables(part, output, is_folded=True)


def _told(part: Part, output: str) -> list[Statistic]:
    """The statistics that any source tells."""
    return [each for each in statistics(part, output) if each.told]


def _rows(part: Part, found: Sequence[Statistic]) -> tuple[str, ...]:
    """The sources that tell any of some statistics."""
    return tuple(name for name in part.sources if any(name in each.told for each in found))


def _tables(part: Part, output: str, *, is_folded: bool = False) -> Iterator[Table]:
    """The table of all statistics of an output."""
    if table := statistics_table(part.tree, output, part.described(output)):
        yield Table(table, is_folded)


def _side_by_side(
    part: Part, output: str, found: Sequence[Statistic], rows: tuple[str, ...]
) -> Charts:
    every = [estimate for each in found for estimate in each.told.values()]
    keys = []
    if not all(has_interval(each.values) for each in every):
        keys.append(Key("no interval", "ink", "circle-open"))
    if any(map(_is_refused, every)):
        keys.append(Key(REFUSED_NOTE, "ink", "x"))
    return Charts(
        charts=tuple(_chart(part, output, each, rows) for each in found),
        keys=tuple(keys),
        notes=tuple(bars_of(every)),
        tables=tuple(each.table for each in _tables(part, output)),
    )


def _chart(part: Part, output: str, statistic: Statistic, rows: tuple[str, ...]) -> Chart:
    """One statistic, a row for each source."""
    traces: list[Trace] = []
    refused: list[Trace] = []
    said = []
    unit = DIMENSIONLESS if statistic.convert is unchanged else part.unit(output)
    for source, estimate in statistic.told.items():
        said.append(f"{source} {figure_text(estimate, statistic.convert)}{after_number(unit)}")
        bounds = np.asarray([statistic.convert(estimate.values)], dtype=np.float64)
        place, position = [rows.index(source)], part.sources.index(source)
        marker = marker_of(position)
        traces.append(dots(bounds, place, position, hovers=said[-1:], name=source, marker=marker))
        if _is_refused(estimate):
            refused.append(crosses(bounds[:, 0], place, REFUSED))
    return Chart(
        title=statistic.label,
        summary=f"Of {titled(part, output)}: {'; '.join(said)}.",
        x=Axis(with_unit(statistic.label, unit)),
        y=Axis("", rows=rows),
        traces=(*traces, *refused),
        height=_FRAME + _ROW * len(rows),
    )


def _is_refused(estimate: xr.DataArray) -> bool:
    return told(estimate, INTERVAL_LABEL) == REFUSED
