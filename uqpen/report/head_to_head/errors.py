"""How far off each method is, over the number of runs that it is given."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.figures.texts import after_number, capitalized
from uqpen.labels import ERRORS, ESTIMATES, REPLICATED, SINGLE
from uqpen.report.axes import logarithmic
from uqpen.report.blocks import Block, Chart, Charts, Heading, Key, Text
from uqpen.report.head_to_head.contest import (
    MOST_CHARTS,
    Method,
    along_budgets,
    budgets_of,
    called,
    keys_of,
    methods_of,
    own_error,
    variants_of,
)
from uqpen.report.marks import Trace, band, dots, line
from uqpen.summary.digits import grouped, sensible
from uqpen.summary.head_to_head import (
    IS_DOUBTFUL,
    IS_LEVEL,
    WINS,
    Contest,
    contests,
    percentage,
    standing,
)
from uqpen.summary.head_to_head_entries import Entry
from uqpen.summary.table import NOTHING, OutputTable

__all__ = ["errors", "errors_of_replicates"]

FloatArray = npt.NDArray[np.float64]

_GUIDE = "1/√runs"
_FEW_DECIDE = "no interval, as few of the repeats decide this error"
# Between markers at the same number of runs, as a factor.
_APART = 1.035
_HEIGHT = 300


def errors(tree: xr.DataTree) -> Iterator[Block]:
    """Error against runs, of single sets of points."""
    yield from _errors(tree, SINGLE)


def errors_of_replicates(tree: xr.DataTree) -> Iterator[Block]:
    """The same in replicates, where any method has them."""
    if REPLICATED in variants_of(tree):
        yield from _errors(tree, REPLICATED)


def _errors(tree: xr.DataTree, variant: str) -> Iterator[Block]:
    charts: dict[str, list[Chart]] = {}
    without: list[str] = []
    count = 0
    for contest in contests(tree):
        entry = contest.entry
        count += 1
        if count - len(without) > MOST_CHARTS:
            continue
        if chart := _chart(contest, variant):
            charts.setdefault(entry.output, []).append(chart)
        else:
            without.append(f"{entry.output}, {entry.label}")
    if not charts:
        return
    for output, found in charts.items():
        yield Heading(called(tree, output))
        yield Charts(tuple(found), keys=(*keys_of(methods_of(tree, variant)), *_keys(found)))
    drawn = sum(map(len, charts.values()))
    if without:
        yield Text(f"Not drawn, as no error is above 0: {'; '.join(without)}.")
    if drawn + len(without) < count:
        yield Text(
            f"These are the first {drawn} of {count} statistics; the tables further down are of "
            "all."
        )


def _keys(charts: list[Chart]) -> Iterator[Key]:
    """What stands in the legend beside the methods."""
    if any(trace.get("name") == _GUIDE for chart in charts for trace in chart.traces):
        yield Key(_GUIDE, "quiet", "line", "dot")
    if any("fillcolor" in trace for chart in charts for trace in chart.traces):
        yield Key("no larger than the reference's own error", "quiet", "band")


def _chart(contest: Contest, variant: str) -> Chart | None:
    """Error against runs of one statistic; None where no method has an error."""
    entry = contest.entry
    methods = methods_of(entry.tree, variant)
    told = {method: _bounds(entry, method) for method in methods}
    known = np.array([bounds[:, 0] for bounds in told.values()])
    if not np.isfinite(known).any():
        return None
    budgets = np.array(budgets_of(entry.tree), dtype=np.float64)
    own = own_error(entry)
    every = np.array(list(told.values()))
    axis = logarithmic("error [%]", every[np.isfinite(every)].tolist())
    lower = 10.0 ** axis.ends[0] if axis.ends else 0.0
    traces: list[Trace] = []
    if own > lower:
        sides = budgets[0] / 2, budgets[-1] * 2
        traces += band(sides, [lower / 10] * 2, [own] * 2, "quiet")
    traces += _guide(known, budgets)
    for place, (method, bounds) in enumerate(told.items()):
        shift = _APART ** (place - (len(told) - 1) / 2)
        traces.append(_line(entry, method, bounds, budgets * shift))
    return Chart(
        title=f"{entry.label}: {entry.shown_truth}",
        summary=_summary(entry, methods, told),
        x=along_budgets(entry.tree),
        y=axis,
        traces=tuple(traces),
        notes=tuple(_notes(contest, variant, told, own, lower)),
        tables=(_table(entry, variant),),
        height=_HEIGHT,
    )


def _bounds(entry: Entry, method: Method) -> FloatArray:
    """Errors in per cent with their intervals, along budget and bound; NaN for what is not shown.

    One that is exact has no place on a logarithmic axis.
    """
    found: FloatArray = 100 * entry.of(ERRORS).values[method.position].astype(np.float64)
    return np.where(np.isfinite(found) & (found > 0), found, np.nan)


def _guide(known: FloatArray, budgets: FloatArray) -> Iterator[Trace]:
    """How errors fall that fall with the root of the runs, from the largest of the fewest runs."""
    first = next((at for at in range(budgets.size) if np.isfinite(known[:, at]).any()), 0)
    if first + 1 < budgets.size:
        runs = budgets[first:]
        fall = float(np.nanmax(known[:, first])) * np.sqrt(runs[0] / runs)
        yield line(runs, fall, "quiet", hover=_GUIDE, name=_GUIDE, dash="dot", width=1.5)


def _line(entry: Entry, method: Method, bounds: FloatArray, places: FloatArray) -> Trace:
    hovers = [
        f"{method.source}, {grouped(budget)} runs: {_said(row)}"
        for budget, row in zip(budgets_of(entry.tree), bounds, strict=True)
    ]
    return dots(
        bounds,
        places,
        method.series,
        hovers=hovers,
        name=method.source,
        marker=method.marker,
        along="y",
        is_joined=True,
    )


def _said(bounds: FloatArray) -> str:
    text = f"{sensible(*map(float, bounds))} %"
    return text if np.isfinite(bounds[1:]).all() else f"{text}; {_FEW_DECIDE}"


def _summary(entry: Entry, methods: list[Method], told: dict[Method, FloatArray]) -> str:
    """The errors at the most runs in a sentence."""
    most = grouped(budgets_of(entry.tree)[-1])
    found = [
        f"{method.source} {sensible(*map(float, told[method][-1]))} %"
        for method in methods
        if math.isfinite(told[method][-1, 0])
    ]
    return f"Errors at {most} runs: {'; '.join(found) or 'none'}."


def _notes(
    contest: Contest, variant: str, told: dict[Method, FloatArray], own: float, lower: float
) -> Iterator[str]:
    """What must be known of the errors, and the verdicts among replicated sets."""
    entry = contest.entry
    yield from (f"{capitalized(note)}." for note in _of_scale(entry))
    if any(
        (np.isfinite(b[:, 0]) & ~np.isfinite(b[:, 1:]).all(axis=1)).any() for b in told.values()
    ):
        yield "Hollow: no interval, as few of the repeats decide the error."
    for method in told:
        values = entry.of(ERRORS).values[method.position, :, 0]
        if where := [n for n, v in zip(budgets_of(entry.tree), values, strict=True) if v == 0]:
            runs = ", ".join(map(grouped, where))
            yield f"{method.source} is exact at {runs} runs, which has no place on this axis."
    shown = f"The reference's own error, {percentage(own / 100)} %,"
    if math.isfinite(own) and own <= lower:
        yield f"{shown} lies below this axis."
    elif own >= max(float(np.nanmax(b[:, 0], initial=0.0)) for b in told.values()):
        yield f"{shown} is as large as any of these."
    if variant == REPLICATED:
        yield from (f"{capitalized(note)}." for note in contest.among_replicated)
    else:
        yield from (f"{capitalized(note)}." for note in contest.notes)


def _of_scale(entry: Entry) -> Iterator[str]:
    """What errors are relative to, where that is not the reference."""
    scale, truth = float(entry.of(ERRORS, "_scale")), abs(float(entry.truth.values[0]))
    if math.isclose(scale, truth) or not math.isfinite(truth):
        return
    if not truth and scale == 1:
        unit = after_number(str(entry.of(ESTIMATES).attrs["units"]))
        yield f"errors are in % of 1{unit}, as the reference is 0"
    else:
        yield "errors are in % of the standard deviation, as the reference is about 0"


def _table(entry: Entry, variant: str) -> OutputTable:
    """The errors behind a chart, with their intervals and the marks that a table has."""
    budgets = budgets_of(entry.tree)
    title = "Errors in %, with their 95 % intervals"
    if variant == SINGLE:
        title += f"; {WINS} leads, {IS_LEVEL} is level with the best, {IS_DOUBTFUL} leads in doubt"
    table = OutputTable(title, [*map(grouped, budgets)])
    array = entry.of(ERRORS)
    for method in methods_of(entry.tree, variant):
        cells = []
        for bounds, contest in zip(array.values[method.position], entry.contests, strict=True):
            estimate, lower, upper = (100 * float(bound) for bound in bounds)
            text = NOTHING if math.isnan(estimate) else sensible(estimate, lower, upper)
            mark = standing(method.source, *contest) if variant == SINGLE else ""
            has_interval = math.isfinite(lower) and math.isfinite(upper)
            note = "" if has_interval or math.isnan(estimate) or not estimate else _FEW_DECIDE
            cells.append(f"{text} {mark}".strip() + table.mark(note))
        table.rows.append((method.source, cells))
    return table
