"""What an interval costs: its width against the runs that a source took."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.analyses.sample import sample_of_law
from uqpen.archive.read import group
from uqpen.figures.methods import Statistic
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, with_unit
from uqpen.labels import EXCEEDANCE, MOMENTS, RUN, RUNS, SHARES, Sampling
from uqpen.report.axes import logarithmic
from uqpen.report.blocks import Block, Chart, Charts, Key, Table
from uqpen.report.counting import counted
from uqpen.report.marks import Trace, line, marker_of, points, written
from uqpen.summary.digits import grouped
from uqpen.summary.statistics_rows import runs_spent
from uqpen.summary.table import NOTHING, OutputTable, quantile_label, remark, unchanged
from uqpen.units import DIMENSIONLESS

__all__ = ["costs"]

# Probabilities of one output that are shown.
_MOST_SHARES = 2

_ROUGH = (
    "so many independent draws would give as narrow an interval; a rough figure, the square of the "
    "ratio of two widths, without an interval as nothing tells how far off these are"
)
_HALF = "± is half of an interval's length, also where its ends lie unevenly."


class _Width(NamedTuple):
    """Half the length of a source's interval, in the unit that is shown, and what it took."""

    source: str
    runs: int
    half: float
    estimate: xr.DataArray


class _Compared(NamedTuple):
    """A statistic and the intervals that there are of it."""

    statistic: Statistic
    widths: Sequence[_Width]

    def of(self, source: str) -> _Width | None:
        """The interval of a source."""
        return next((each for each in self.widths if each.source == source), None)


def costs(part: Part, output: str, found: Sequence[Statistic]) -> Iterator[Block]:
    """Widths of intervals against runs, where there are several to be compared."""
    every = [_Compared(each, _widths(part, each)) for each in _main_ones(found)]
    compared = [each for each in every if len(each.widths) > 1]
    if not compared:
        return
    plain = _independent(part)
    shown = {width.source for each in compared for width in each.widths}
    sources = [source for source in part.sources if source in shown]
    others = [s for s in part.sources if s not in shown and any(s in each.told for each in found)]
    keys = [_key(part, source) for source in sources]
    if plain in shown:
        keys.append(Key(_guide(plain), "quiet", "line", "dot"))
    notes = [_HALF]
    if others:
        notes.append(f"No interval, so not shown: {', '.join(others)}.")
    yield Charts(
        charts=tuple(_chart(part, output, each, plain) for each in compared),
        keys=tuple(keys),
        notes=tuple(notes),
    )
    if plain in shown:
        yield Table(_table(part, output, compared, sources, plain))


def _main_ones(found: Sequence[Statistic]) -> list[Statistic]:
    """Mean, median, and the first probabilities among statistics."""
    middle = quantile_label(0.5)
    first = [each for each in found if each.kind == EXCEEDANCE][:1]
    shares = [each for each in found if each.kind == SHARES][:_MOST_SHARES]
    means = [each for each in found if each.kind == MOMENTS and each.label == "mean"]
    return [*means, *(each for each in found if each.label == middle), *first, *shares]


def _widths(part: Part, statistic: Statistic) -> list[_Width]:
    """The intervals that have a width, each with the runs of its source."""
    widths = []
    for source, estimate in statistic.told.items():
        _, lower, upper = (float(bound) for bound in statistic.convert(estimate.values))
        runs = runs_spent(part.tree, source)
        if runs and 0 < upper - lower < math.inf:
            widths.append(_Width(source, runs, (upper - lower) / 2, estimate))
    return widths


def _independent(part: Part) -> str:
    """The first design of independent draws; empty for none."""
    return next((n for n in part.designs if part.sampling(n) is Sampling.INDEPENDENT), "")


def _key(part: Part, source: str) -> Key:
    position = part.sources.index(source)
    return Key(source, position, marker_of(position))


def _guide(plain: str) -> str:
    return f"as 1/√runs, from {plain}"


def _chart(part: Part, output: str, compared: _Compared, plain: str) -> Chart:
    """One statistic: half the length of its intervals against the runs that they took."""
    statistic, widths = compared
    unit = _unit(part, output, statistic)
    shown = after_number(unit)
    traces: list[Trace] = []
    heights = [each.half for each in widths]
    if (first := compared.of(plain)) is not None:
        runs = [each.runs for each in widths]
        ends = np.array([min(runs), max(runs)], dtype=np.float64)
        half = first.half * np.sqrt(first.runs / ends)
        heights += half.tolist()
        hover = written(_guide(plain), 200)
        traces.append(line(ends, half, "quiet", hover=hover, name="guide", dash="dot", width=1.5))
    said = []
    for each in widths:
        key = _key(part, each.source)
        said.append(f"{each.source}: ± {_short(each.half)}{shown} with {counted(each.runs, 'run')}")
        traces.append(
            points(
                [each.runs],
                [each.half],
                key.series,
                hover=written(said[-1], 200),
                name=each.source,
                marker=key.mark,
                size=10,
                opacity=1,
            )
        )
    return Chart(
        title=f"How wide the interval is: {statistic.label}",
        summary=f"{'; '.join(said)}.",
        x=logarithmic("runs spent", [each.runs for each in widths]),
        y=logarithmic(with_unit("half-width", unit), heights),
        traces=tuple(traces),
        height=260,
    )


def _short(half: float) -> str:
    """A half-width in two digits."""
    power = math.floor(math.log10(half))
    return f"{half:.{max(0, 1 - power)}f}" if -5 <= power < 6 else f"{half:.1e}"


def _unit(part: Part, output: str, statistic: Statistic) -> str:
    """What a width of a statistic is shown in."""
    return DIMENSIONLESS if statistic.convert is unchanged else part.unit(output)


def _table(
    part: Part, output: str, compared: Sequence[_Compared], sources: Sequence[str], plain: str
) -> OutputTable:
    """Of each source, what its intervals took, and what independent draws would take."""
    title = "What an interval costs: its ±, and as many independent draws"
    table = OutputTable(title, ["runs"])
    for each in compared:
        label, unit = each.statistic.label, _unit(part, output, each.statistic)
        table.columns += [with_unit(f"{label} ±", unit), "draws"]
    for source in sources:
        cells = [_runs(part, source, table)]
        for each in compared:
            cells += _cells(each.of(source), each.of(plain), table)
        table.rows.append((source, cells))
    return table


def _runs(part: Part, source: str, table: OutputTable) -> str:
    """The runs of a source, and how many of them are the sample."""
    spent = runs_spent(part.tree, source) or 0
    sampled = spent
    if source in part.designs:
        sampled = sample_of_law(group(part.tree, RUNS, source)).sizes[RUN]
    mark = ""
    if sampled < spent:
        mark = table.mark(f"{grouped(sampled)} of them are a sample; the others serve its indices")
    return grouped(spent) + mark


def _cells(width: _Width | None, plain: _Width | None, table: OutputTable) -> list[str]:
    """A half-width, and how many independent draws would give as narrow an interval."""
    if width is None:
        return [NOTHING, NOTHING]
    half = f"{_short(width.half)}{table.mark(remark(width.estimate))}"
    if plain is None:
        return [half, NOTHING]
    if width is plain:
        return [half, grouped(plain.runs)]
    draws = plain.runs * (plain.half / width.half) ** 2
    rounded = int(float(f"{draws:.2g}"))
    return [half, f"≈ {grouped(rounded)}{table.mark(_ROUGH)}"]
