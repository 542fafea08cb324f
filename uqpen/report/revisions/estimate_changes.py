"""Differences between the estimates of two archives."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.charts.chart import Block
from uqpen.charts.source_comparison import compared_statistics
from uqpen.core.catalogue import MEASURES
from uqpen.core.labels import INPUT
from uqpen.report.blocks import Heading, Remarks, Table, Text
from uqpen.report.revisions.revision_page import ArchivePair, ModelPair
from uqpen.results.archive_view import output_heading
from uqpen.results.digits import estimate_texts
from uqpen.results.table import NOTHING, Conversion, OutputTable, identity, label_with_unit
from uqpen.results.texts import plain_text

__all__ = ["estimate_changes"]

_COLUMNS = ["A", "B", "B minus A", "intervals"]
_APART, _OVERLAP = "apart", "overlap"
_NOTE = (
    "Where the true values are the same, two 95 % intervals are apart in fewer than 1 of 10 cases, "
    "and in about 1 of 180 where they are equally wide and of independent runs. Intervals that "
    "overlap do not show that the true values are the same. If both studies drew the same points, "
    "smaller differences can be real: run both models in one study, which compares them run by run."
)


class _PairedEstimate(NamedTuple):
    """An estimate of both archives, of an output by a source."""

    label: str
    first: xr.DataArray
    second: xr.DataArray
    convert: Conversion

    @property
    def bounds(self) -> tuple[list[float], list[float]]:
        """Estimate, lower and upper of A and of B, in the unit that A shows."""
        pair = (self.convert(each.values) for each in (self.first, self.second))
        first, second = (np.asarray(each, dtype=np.float64).tolist() for each in pair)
        return first, second

    @property
    def difference(self) -> str:
        """The difference of the estimates, in the digits of the less certain one."""
        first, second = self.bounds
        value = second[0] - first[0]
        halves = [(each[2] - each[1]) / 2 for each in (first, second)]
        if not math.isfinite(value):
            return NOTHING
        half = max(halves) if all(map(math.isfinite, halves)) else math.nan
        text = estimate_texts(value, value - half, value + half)[0]
        return f"+{text}" if value > 0 else text

    @property
    def verdict(self) -> str:
        """Verdict on the intervals, apart or overlapping; nothing where one estimate has none."""
        (_, *one), (_, *other) = self.bounds
        if not all(map(math.isfinite, (*one, *other))):
            return NOTHING
        return _APART if one[1] < other[0] or other[1] < one[0] else _OVERLAP


def estimate_changes(pair: ArchivePair) -> Iterator[Block]:
    """Estimates of two archives side by side, by output and source."""
    tables: list[Block] = []
    moved: list[str] = []
    verdicts: list[str] = []
    for model, each in pair.models.items():
        for output in each.outputs:
            found = list(_tables(each, output))
            if found:
                tables.append(Heading(_heading(each, model, output)))
            for is_leading, source, pairs, table in found:
                tables.append(Table(table, is_folded=not is_leading))
                if is_leading:
                    verdicts += [estimate.verdict for estimate in pairs]
                    moved += _moved(_heading(each, model, output), source, pairs)
    if not tables:
        return
    count = len(verdicts) - verdicts.count(NOTHING)
    if moved:
        head = f"The intervals of {verdicts.count(_APART)} of {count} estimates are apart:"
        yield Remarks(head, tuple(moved))
    elif count:
        yield Text(f"The intervals of all {count} estimates overlap.")
    yield Text(_NOTE)
    yield from tables


def _heading(pair: ModelPair, model: str, output: str) -> str:
    return f"{model}: " * bool(model) + output_heading(pair.first, output)


def _tables(
    pair: ModelPair, output: str
) -> Iterator[tuple[bool, str, list[_PairedEstimate], OutputTable]]:
    """Yield for each source whether it is the first with any, its estimates, and their table."""
    is_leading = True
    for source in pair.sources:
        found = list(_paired_estimates(pair, output, source))
        if not found:
            continue
        title = label_with_unit(output, pair.first.unit(output))
        table = OutputTable(plain_text(f"{title}, by {source}"), list(_COLUMNS))
        for both in found:
            cells = [table.cell(each, both.convert) for each in (both.first, both.second)]
            table.rows.append((both.label, [*cells, both.difference, both.verdict]))
        yield is_leading, source, found, table
        is_leading = False


def _paired_estimates(pair: ModelPair, output: str, source: str) -> Iterator[_PairedEstimate]:
    """Yield the estimates that both archives have of an output by a source."""
    others = {
        (each.statistic.name, each.label): each for each in compared_statistics(pair.second, output)
    }
    for each in compared_statistics(pair.first, output):
        other = others.get((each.statistic.name, each.label))
        if other is None or source not in each.available_estimates:
            continue
        if source in other.available_estimates:
            yield _PairedEstimate(
                each.label, each.estimates[source], other.estimates[source], each.convert
            )
    for index in MEASURES["shares"]:
        first, second = (
            view.statistics.get(source, output, index.name) for view in (pair.first, pair.second)
        )
        if first is not None and second is not None:
            yield from _by_input(index.measure.label, first, second)


def _by_input(label: str, first: xr.DataArray, second: xr.DataArray) -> Iterator[_PairedEstimate]:
    """Yield a measure of the inputs' part, for each input of both."""
    if first.dims[:1] != (INPUT,) or second.dims[:1] != (INPUT,):
        return
    others = second[INPUT].values.tolist()
    for position, name in enumerate(first[INPUT].values.tolist()):
        if name in others:
            one, other = first[position], second[others.index(name)]
            if np.isfinite(one.values[0]) and np.isfinite(other.values[0]):
                yield _PairedEstimate(plain_text(f"{label}, {name}"), one, other, identity)


def _moved(title: str, source: str, found: list[_PairedEstimate]) -> Iterator[str]:
    """Yield a line that names the estimates whose intervals are apart; nothing for none."""
    if apart := [both.label for both in found if both.verdict == _APART]:
        yield f"{title}, by {source}: {', '.join(apart)}"
