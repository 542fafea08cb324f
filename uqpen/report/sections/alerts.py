"""Warnings about the numbers of a page: few alerts, each with a remedy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from uqpen.archive.estimates import interval_text
from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import (
    AGREEMENT,
    CONDITIONAL,
    CONTRADICTION,
    DEPENDENCE,
    INTERVAL_LEVEL,
    NOTE,
    RUNS,
    SURROGATES,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Alert
from uqpen.report.sections.failures import missing_count
from uqpen.report.sections.quoted_statistics import QuotedStatistic, moments, output_name
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import count_text, grouped_number, percent_text
from uqpen.results.table import telling_note
from uqpen.results.texts import capitalized, join_names, plain_text
from uqpen.surrogates.diagnostics import refuted_outputs

__all__ = ["alerts"]

# Notes of estimates that are written out.
_MOST_NOTES = 2
# Share of inadmissible points that is worth an alert.
_MANY = 0.01
# Tenfolds of an output that ask for a logarithmic scale.
_TENFOLDS = 3


def alerts(
    view: ArchiveView, design: str, quantities: Sequence[QuotedStatistic]
) -> Iterator[Alert]:
    """Yield what to mind about quantities by a design, the gravest first."""
    if missing_count(view, design):
        yield Alert(
            "Failed runs",
            "If the failed runs differ from the others, these numbers are biased, and no interval "
            "shows it.",
            "Find out why they fail, and make these runs again.",
        )
    for name in group_names(view.tree, SURROGATES):
        outputs: dict[str, list[str]] = {}
        for output, reason in refuted_outputs(
            view.tree.children[SURROGATES].children[name]
        ).items():
            outputs.setdefault(reason, []).append(output_name(view, output))
        for reason, those in outputs.items():
            yield Alert(
                "Refuted surrogate",
                f"{name}, {join_names(those)}: {plain_text(reason, 300)}. None of its estimates is "
                "stated.",
                "Take the estimates of the runs, or fit another kind, transform or more runs.",
            )
    named: dict[str, dict[str, list[str]]] = {}
    for quantity in _with_moments(view, quantities):
        estimate = quantity.leading_estimate(design)
        # That of a probability says how it counts failed runs, as the page does once.
        is_said = quantity.is_probability and missing_count(view, design) > 0
        if estimate is not None and not is_said and (note := telling_note(estimate)):
            outputs_of = named.setdefault(note, {}).setdefault(quantity.label, [])
            outputs_of.append(output_name(view, quantity.output))
    if named:
        texts = [f"{_names_text(those)}: {note}" for note, those in named.items()]
        more = [f"{capitalized(count_text(len(texts) - _MOST_NOTES, 'more note'))} in the tables"]
        shown = texts[:_MOST_NOTES] + more * (len(texts) > _MOST_NOTES)
        yield Alert(
            "Precision",
            f"{'. '.join(shown)}.",
            "Quote quantiles, which need no assumption on extreme values, or make more runs.",
        )
    yield from _scale_alerts(view, design, quantities)
    yield from _input_alerts(view, design)
    estimates = [each.leading_estimate(design) for each in _with_moments(view, quantities)]
    known = [each for each in estimates if each is not None]
    assumes = any(telling_note(each) != interval_text(each, NOTE) for each in known)
    yield _scope_alert(view, design, few_runs=assumes)


def _with_moments(
    view: ArchiveView, quantities: Sequence[QuotedStatistic]
) -> Iterator[QuotedStatistic]:
    """Yield quantities, and then the moments of their outputs."""
    outputs = dict.fromkeys(each.output for each in quantities)
    further = [moment for output in outputs for moment in moments(view, output)]
    stated = {each.heading for each in quantities}
    yield from (*quantities, *(each for each in further if each.heading not in stated))


def _scale_alerts(
    view: ArchiveView, design: str, quantities: Sequence[QuotedStatistic]
) -> Iterator[Alert]:
    """Yield what to mind about the scale of outputs: one refused, or one that would serve."""
    outputs = [*dict.fromkeys(each.output for each in quantities)]
    for output in outputs:
        if note := view.linear_scale_note(output):
            yield Alert(
                "Scale",
                f"{capitalized(output_name(view, output))}: {note}.",
                "Find out why the model gives such values, or leave the scale out.",
            )
    wide = [output for output in outputs if _spans_tenfolds(view, output, design)]
    if wide:
        names = join_names([output_name(view, output) for output in wide])
        some = "these outputs" if len(wide) > 1 else "the output"
        yield Alert(
            "Scale",
            f"Nine tenths of the runs span more than {_TENFOLDS} tenfolds of {names}. On a linear "
            "scale most of them lie in one place.",
            f'Set scale = "log" for {some} in the study.',
        )


def _spans_tenfolds(view: ArchiveView, output: str, design: str) -> bool:
    """Check if runs of a positive output on a linear scale span some tenfolds."""
    values = view.shown_values(design, output)
    if view.statistics.wants_logarithm(output) or not values.size or values.min() <= 0:
        return False
    low, high = np.quantile(values, [0.05, 0.95])
    return bool(high > 10.0**_TENFOLDS * low)


def _names_text(outputs: Mapping[str, Sequence[str]]) -> str:
    """Return statistics with the outputs that they are of, as one name."""
    return capitalized("; ".join(f"{label} of {join_names(of)}" for label, of in outputs.items()))


def _input_alerts(view: ArchiveView, design: str) -> Iterator[Alert]:
    condition = view.statistics.run_accounts(design).get(CONDITIONAL)
    runs = view.design(design).runs
    excluded = status_counts(runs)[Status.INADMISSIBLE]
    if condition and excluded >= _MANY * run_count(runs):
        runs = view.design(design).runs
        count = status_counts(runs)[Status.INADMISSIBLE]
        some = (
            f"{grouped_number(count)} of the {grouped_number(run_count(runs))} points of {design}"
        )
        were = "was" if count == 1 else "were"
        yield Alert(
            "Inadmissible",
            f"{some} {were} inadmissible, so outside of what the model or the study allows. All "
            f"estimates are conditional on {condition!s}.",
            "If such inputs occur, the model does not cover them; if not, truncate the "
            "distributions.",
        )
    found = {name: view.statistics.absence(design, name) for name in view.numeric_outputs}
    texts = [
        f"{output_name(view, name)} on {absence[CONDITIONAL]}"
        for name, absence in found.items()
        if absence
    ]
    if texts:
        yield Alert(
            "Without a value",
            f"Some estimates are conditional: {'; '.join(texts)}.",
            "Quote the share of runs that have one beside them.",
        )
    attributes = read_group(view.tree, RUNS, design).attrs
    if CONTRADICTION in attributes:
        yield Alert(
            "Dependence",
            "The inputs depend on each other, against what the study states: "
            f"{plain_text(str(attributes[CONTRADICTION]), 100)}. Surrogates of these runs have no "
            "estimates.",
            "State the dependence in [dependence]; estimates are then of these inputs.",
        )
    elif dependence := str(attributes.get(DEPENDENCE, "")):
        yield Alert(
            "Dependence",
            f"The inputs depend on each other: {dependence}. Their shares of a variance overlap.",
            "Compare inputs by Shapley effects, which divide what is shared.",
        )
    if view.design(design).sampling is Sampling.GIVEN:
        yield Alert(
            "Points",
            f"The points of {design} are the user's own, and presumed to be a sample of the "
            "inputs.",
            "Check how they were chosen.",
        )
    if agreement := str(read_group(view.tree, RUNS, design).attrs.get(AGREEMENT, "")):
        yield Alert(
            "Inputs",
            f"The points of {design}, from a file, against the stated inputs: {agreement}.",
            "If they do not follow those distributions, the statistics are of other inputs.",
        )
    yield from _measured_alert(view, design)


def _measured_alert(view: ArchiveView, design: str) -> Iterator[Alert]:
    measured = {
        name: str(view.attributes(name)["fit_measurements"])
        for name in view.design(design).random_inputs
        if "fit_measurements" in view.attributes(name)
    }
    if measured:
        fits = ", ".join(f"{name} ({count})" for name, count in measured.items())
        yield Alert(
            "Measured inputs",
            "Distributions are fitted to measurements (their number in brackets): "
            f"{fits}. No interval includes the uncertainty of these fits.",
            "Measure more, or run the study with other fits, too.",
        )


def _scope_alert(view: ArchiveView, design: str, *, few_runs: bool) -> Alert:
    runs = view.design(design).runs
    completed = status_counts(runs)[Status.OK]
    # Said once: every mean of few runs rests on it, and no number of theirs tells which one fails.
    assumed = (
        " Intervals of means and standard deviations may be too narrow if extreme values are more "
        "frequent than in these runs."
    )
    rare = f" Events rarer than about 1 in {grouped_number(completed)} cannot be seen."
    return Alert(
        "Scope",
        "Intervals cover the sampling error alone, not that of the model or of the assumed "
        f"distributions. {_level_text(view, design)}, all together less often."
        + rare * (run_count(runs) > 1)
        + assumed * few_runs,
        "Compare the model with measurements, and try other distributions.",
    )


def _level_text(view: ArchiveView, design: str) -> str:
    """Return how often an interval is right, by the levels that the estimates have."""
    levels = {
        float(attributes[INTERVAL_LEVEL])
        for output in view.numeric_outputs
        for attributes in view.statistics.statistics(design, output).attributes()
        if INTERVAL_LEVEL in attributes
    }
    if levels and np.allclose(sorted(levels), 0.95):
        return "Each is right 19 times in 20"
    texts = " or ".join(percent_text(level) for level in sorted(levels))
    return f"Each is right with a probability of {texts}" if texts else "Each holds by itself"
