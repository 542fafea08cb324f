"""The main results in a line each: what a terminal shows last, and a notebook first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice

import numpy as np
import xarray as xr

from uqpen.archive.read import is_benchmark
from uqpen.charts.marks import has_interval
from uqpen.report.blocks import Finding, Quote, Text
from uqpen.report.sections.answer import answer, caveat_text, model_form_texts
from uqpen.report.sections.benchmark import leaders
from uqpen.report.sections.failures import missing_count, missing_run_sentences
from uqpen.report.sections.findings import SCOPE, alerts
from uqpen.report.sections.sentences import (
    QuotedStatistic,
    bound_findings,
    decision_findings,
    joint_findings,
    main_outputs,
    measurement_findings,
    no_break,
    outcome_sentences,
    output_sentences,
    over_parameters,
    rare_event_findings,
)
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView, select_view
from uqpen.results.digits import estimate_text
from uqpen.results.field_tables import field_lines
from uqpen.results.input_measures import input_ranking
from uqpen.results.table import estimate_remark
from uqpen.results.texts import plain_text

# Inputs that are named, and statistics of an output.
_MOST_INPUTS = 3
_MOST_STATISTICS = 3
# Curves that are named, where a study has no other output.
_MOST_CURVES, _LONGEST_LINE = 3, 400


def summary_lines(tree: xr.DataTree) -> Iterator[str]:
    """Yield the main results of an archive, the most important ones first.

    A line is plain text. It has no end within a number and its unit, as their spaces are such at
    which no line ends.

    Parameters
    ----------
    tree : DataTree
        An archive of a study, as `run` returns it, or of a benchmark of methods.

    Yields
    ------
    str
        Verdicts and requested statistics with their intervals, in units of the study; the inputs
        that drive each output; failed runs; what to mind. Of a benchmark, which methods lead.
    """
    view = select_view(tree, None, None, None)
    if is_benchmark(tree):
        quoted = (block for block in leaders(view) if isinstance(block, Quote))
        yield from chain.from_iterable(block.sentences for block in quoted)
    elif view.leading_design is None:
        yield from _model_lines(view, measurement_findings)
        yield from _model_lines(view, bound_findings)
        yield from (each.text for each in answer(view) if isinstance(each, Text))
        yield from map(_finding_line, rare_event_findings(view))
    else:
        yield from _sample_lines(view, view.leading_design)


def _sample_lines(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield the main results of a study by the design that leads."""
    views = view.model_views if view.model else (view,)
    main = main_outputs(view)
    by_output = [list(_output_lines(views, output, design)) for output in main]
    yield from map(_finding_line, decision_findings(view))
    yield from _model_lines(view, measurement_findings)
    for lines in by_output:
        yield from lines[:1]
    yield from () if main else _curve_lines(view)
    if view.model:
        yield from model_form_texts(view, main, design)
    else:
        yield from map(_finding_line, (*joint_findings(view, design), *rare_event_findings(view)))
    for each in views:
        head = f"{each.model}: " if each.model else ""
        yield from (f"{head}{line}" for line in outcome_sentences(each, design))
    for output in main:
        yield from _driver_line(views[0], output)
    if caveat := caveat_text(view, main, design):
        yield caveat
    quantities = () if view.model else tuple(_quantities(view, main, design))
    # What to mind speaks of failed runs.
    failed = [_count_line(each, design) for each in views if missing_count(each, design)]
    if failed:
        failed[-1] = f"{failed[-1].removesuffix('.')}; estimates are of the completed runs."
    yield from failed
    for alert in alerts(view, design, quantities):
        # What holds of every archive stands on its page.
        if alert.about != SCOPE:
            yield f"mind: {alert.text}"
    for lines in by_output:
        yield from lines[1:]
    yield from (_count_line(each, design) for each in views if not missing_count(each, design))


def _curve_lines(view: ArchiveView) -> Iterator[str]:
    """Yield the ranges of the first curves."""
    for line in islice(field_lines(view.archive), _MOST_CURVES):
        yield plain_text(line, _LONGEST_LINE)


def _model_lines(
    view: ArchiveView, findings: Callable[[ArchiveView], Iterator[Finding]]
) -> Iterator[str]:
    """Yield what is found of each model."""
    for each in view.model_views if view.model else (view,):
        head = f"{each.model}: " if each.model else ""
        yield from (f"{head}{_finding_line(found)}" for found in findings(each))


def _count_line(view: ArchiveView, design: str) -> str:
    """Return how many runs failed, or that all completed."""
    head = f"{view.model}: " if view.model else ""
    return head + next(missing_run_sentences(view, design))


def _finding_line(finding: Finding) -> str:
    return f"{finding.head}: {finding.text}"


def _quantities(view: ArchiveView, main: Sequence[str], design: str) -> Iterator[QuotedStatistic]:
    for output in main:
        entry = output_sentences(view, output, design)
        if entry is not None:
            yield from entry.quantities


def _output_lines(views: Sequence[ArchiveView], output: str, design: str) -> Iterator[str]:
    """Yield a line for each of the first statistics of an output, with all models in it."""
    entry = output_sentences(views[0], output, design)
    if entry is None:
        return
    if not entry.quantities:
        yield from entry.sentences
    for quantity in entry.quantities[:_MOST_STATISTICS]:
        head, parts = f"{output}, {no_break(quantity.label)}", []
        for view in views:
            own = QuotedStatistic(view, output, quantity.statistic, quantity.entry)
            array = own.leading_estimate(view.leading_design or design)
            if array is None:
                continue
            verdict = ""
            if acceptance := Acceptance.from_array(array):
                head = f"{output}, {no_break(f'{quantity.label} {acceptance}')}"
                verdict = f"{acceptance.verdict}, "
            over = over_parameters(own, design).rstrip(".").replace(" That is", ",", 1)
            parts.append(f"{view.model} {verdict}{_estimate(own, array)}{over}".lstrip())
        yield f"{head}: {'; '.join(parts)}"


def _estimate(quantity: QuotedStatistic, array: xr.DataArray) -> str:
    """Return an estimate with its interval, or why it has none."""
    value, lower, upper = quantity.texts(array)
    ends = quantity.statistic.shown.ends
    if ends == "between":
        return f"{lower} to {upper}"
    if ends and np.isfinite(array.values[1:]).any():
        return f"{ends} {lower if ends == 'at least' else upper}"
    if has_interval(array.values):
        return f"{value} ({lower} to {upper})"
    return f"{value} (no interval: {estimate_remark(array)})"


def _driver_line(view: ArchiveView, output: str) -> Iterator[str]:
    """Yield the most important inputs of an output, with their measure."""
    ranking = input_ranking(view, output)
    if ranking is None:
        return
    named = [
        f"{plain_text(name)} {no_break(estimate_text(*array.values.tolist()))}"
        for name, array in islice(ranking.estimates.items(), _MOST_INPUTS)
    ]
    by = f" by {view.model}" if view.model else ""
    measure = ranking.statistic.measure.label or ranking.statistic.title
    yield f"drivers of {output}{by} ({measure}): {', '.join(named)}"
