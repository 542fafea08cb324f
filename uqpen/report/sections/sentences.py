"""Sentences on outputs and events, each complete by itself, and verdicts on the study's limits."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.charts.marks import has_interval
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import CATEGORY, INTERVAL_LEVEL
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Finding
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    default_statistic,
    no_break,
    output_name,
    requested_statistics,
)
from uqpen.results.acceptance import Acceptance, AcceptanceVerdict
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, percent_text, percent_texts
from uqpen.results.joint_probabilities import disagreements
from uqpen.results.surrogate_tables import is_corrected
from uqpen.results.table import entry_text, estimate_remark
from uqpen.results.texts import capitalized, plain_text, typeset_quantity

__all__ = [
    "OutputSentences",
    "decision_findings",
    "joint_findings",
    "output_sentences",
    "rare_event_findings",
]

# Requested statistics of an output that are stated, and categories in a sentence.
_MOST_STATED = 3
# Further ones of an output in the table below the sentences.
_MOST_FURTHER = 9
_MOST_CATEGORIES = 4


class OutputSentences(NamedTuple):
    """Sentences of the report about one output."""

    output: str
    verdicts: tuple[Finding, ...]  # on the limits of the study
    sentences: tuple[str, ...]
    quantities: tuple[QuotedStatistic, ...]  # that they state
    omitted: int = 0  # requested quantities that have no sentence
    further: tuple[Finding, ...] = ()  # requested quantities below the sentences


def output_sentences(view: ArchiveView, output: str, design: str) -> OutputSentences | None:
    """Return a sentence on an output by a design whose runs are a sample; None without one."""
    if output in view.categorical_outputs:
        found = sorted(
            _category_statistics(view, output, design), key=lambda each: -float(each[2].values[0])
        )
        shown = found[:_MOST_CATEGORIES]
        if not shown:
            return None
        parts = [
            f"{label} in {each.texts(array)[0]} of cases {each.interval(array)}"
            for label, each, array in shown
        ]
        start = capitalized(output_name(view, output))
        runs = run_count(view.design(design).runs)
        if runs > 1 and float(shown[0][2].values[0]) == 1:
            parts = parts[:1]
        omitted = len(found) - len(shown)
        return OutputSentences(output, (), (f"{start}: {'; '.join(parts)}.",), (), omitted)
    every = requested_statistics(view, output, design)
    missing = [each for each in every if each.leading_estimate(design) is None]
    known = [each for each in every if each not in missing]
    kept, below = known[:_MOST_STATED], [*known[_MOST_STATED:], *missing]
    common = default_statistic(view, output, design)
    if common is not None and len(kept) < _MOST_STATED:
        kept.append(common)
    of_kept = ((each, each.leading_estimate(design)) for each in kept)
    estimates = [(each, array) for each, array in of_kept if array is not None]
    if not estimates:
        return None
    limits = [each for each in estimates if each[0].statistic.shown.event]
    others = [each for each in estimates if not each[0].statistic.shown.event]
    return OutputSentences(
        output,
        tuple(_verdict(*each, design) for each in limits),
        tuple(_sentence(*each, design) for each in others),
        tuple(each for each, _ in estimates),
        max(0, len(below) - _MOST_FURTHER),
        tuple(_further(each, design) for each in below[:_MOST_FURTHER]),
    )


def _further(quantity: QuotedStatistic, design: str) -> Finding:
    """Return a requested quantity with its sentence, the verdict on its limit, or a reason."""
    array = quantity.leading_estimate(design)
    if array is None:
        reason = quantity.reason_without_estimate(design)
        return Finding(quantity.heading, f"No estimate: {plain_text(reason, 240)}.")
    if quantity.statistic.shown.event:
        return _verdict(quantity, array, design)
    return Finding(quantity.heading, _sentence(quantity, array, design))


def _verdict(quantity: QuotedStatistic, array: xr.DataArray, design: str) -> Finding:
    """Return how often an output lies beyond a limit, and whether the study accepts that."""
    name = capitalized(output_name(quantity.view, quantity.output))
    estimate, lower, upper = quantity.texts(array)
    counts = status_counts(quantity.view.design(design).runs)
    runs = grouped_number(counts[Status.OK])
    level = _level(array)
    text = f"in {estimate} of cases {quantity.interval(array)}."
    counts_events = not is_corrected(array)
    if counts_events and array.values[0] == 0 and np.isfinite(array.values[2]):
        text = f"in none of {runs} completed runs: at most {upper} of cases ({level} interval)."
    elif counts_events and array.values[0] == 1 and np.isfinite(array.values[1]):
        text = f"in all {runs} completed runs: at least {lower} of cases ({level} interval)."
    threshold = no_break(typeset_quantity(plain_text(quantity.entry)))
    event = f"{name} {quantity.statistic.shown.event} {threshold}"
    return Finding(event, f"{capitalized(text)}{acceptance_sentence(array)}")


def acceptance_sentence(array: xr.DataArray) -> str:
    """Return a sentence on the limit of a probability that the study accepts; empty for none."""
    acceptance = Acceptance.from_array(array)
    if acceptance is None:
        return ""
    limit = f"limit of the study, {no_break(str(acceptance))},"
    if acceptance.verdict is AcceptanceVerdict.NOT_DECIDED:
        why = "contains it" if has_interval(array.values) else "is missing"
        return f" These runs do not decide whether the {limit} is met: the interval {why}."
    where = "within" if acceptance.verdict is AcceptanceVerdict.MET else "beyond"
    return f" The {limit} is {acceptance.verdict}: the whole interval lies {where} it."


def _sentence(quantity: QuotedStatistic, array: xr.DataArray, design: str) -> str:
    name, shown = output_name(quantity.view, quantity.output), quantity.statistic.shown
    if shown.ends == "between":
        return _tolerance_interval_sentence(quantity, array, capitalized(name))
    if shown.ends:
        return _tolerance_limit_sentence(quantity, array, capitalized(name), shown.ends)
    value = quantity.texts(array)[0]
    values = quantity.view.design(design).completed_values(quantity.output)
    if bool(values.size > 1 and np.ptp(values) <= 1e-12 * np.abs(values).max()):
        return f"{capitalized(name)} is {value} in every run."
    sentence = shown.sentence
    if shown.entry == "probability" and quantity.entry == 0.5:
        sentence = f"{sentence.rstrip('.')}: half of all cases lie below."
    # All in one pass, as the name of an output may have braces itself; so may words of an archive.
    words = {
        "{entry}": entry_text(shown, quantity.entry),
        "{label}": quantity.label,
        "{output}": name,
        "{estimate}": f"{value} {quantity.interval(array)}",
    }
    return re.sub(r"\{\w+\}", lambda place: words.get(place[0], place[0]), sentence)


def _tolerance_limit_sentence(
    quantity: QuotedStatistic, array: xr.DataArray, name: str, beyond: str
) -> str:
    value, lower, upper = quantity.texts(array)
    bound, end = (lower, 1) if beyond == "at least" else (upper, 2)
    share = _share_of_cases(quantity.entry)
    if np.isfinite(array.values[end]):
        return (
            f"{name} is {beyond} {bound} in {share}. Best estimate {value}; the {bound} allow for "
            f"the finite number of runs ({_level(array)} confidence)."
        )
    return (
        f"{name} is {beyond} {value} in {share}, by estimate alone. No bound is known: "
        f"{estimate_remark(array)}."
    )


def _tolerance_interval_sentence(quantity: QuotedStatistic, array: xr.DataArray, name: str) -> str:
    lower, upper = quantity.end_texts(array)
    share = _share_of_cases(quantity.entry)
    return f"{name} is from {lower} to {upper} in {share} ({_level(array)} confidence)."


def _level(array: xr.DataArray) -> str:
    return no_break(percent_text(array.attrs.get(INTERVAL_LEVEL, np.nan)))


def _share_of_cases(content: float) -> str:
    """Return a share of all cases in whole numbers, which are read more easily."""
    for whole in (100, 1_000, 10_000):
        part = content * whole
        if abs(part - round(part)) < 1e-9:
            return no_break(f"{grouped_number(round(part))} of {grouped_number(whole)} cases")
    return f"{percent_text(content)} of cases"


def _category_statistics(
    view: ArchiveView, output: str, design: str
) -> Iterator[tuple[str, QuotedStatistic, xr.DataArray]]:
    shares = view.statistics.get(design, output, "share")
    if shares is not None:
        flags = shares[CATEGORY].values.tolist()
        labels = shares["category_label"].values.tolist()
        for flag, label in zip(flags, labels, strict=True):
            quantity = QuotedStatistic(view, output, CATALOGUE["share"], flag)
            if (array := quantity.estimate(design)) is not None:
                yield f"“{plain_text(str(label), 40)}”", quantity, array


def joint_findings(view: ArchiveView, design: str) -> Iterator[Finding]:
    """Yield how often each event occurs whose probability the study requests."""
    joint = view.statistics.joint_probability(design)
    for array in () if joint is None else joint:
        event = capitalized(plain_text(str(array["event_condition"].values)))
        yield Finding(event, f"In {_stated(array)}.{acceptance_sentence(array)}")


def rare_event_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield the probability of the event of each design that was made for one, with its caveat."""
    for design in view.designs:
        joint = view.statistics.joint_probability(design)
        if joint is None or view.design(design).sampling is not Sampling.TOWARDS_EVENT:
            continue
        for array, finding in zip(joint, joint_findings(view, design), strict=True):
            caveat = (
                f" {capitalized(estimate_remark(array))}." if has_interval(array.values) else ""
            )
            yield finding._replace(text=f"By {design}: {finding.text}{caveat}")
    found = {design: view.statistics.joint_probability(design) for design in view.designs}
    arrays = {design: array for design, array in found.items() if array is not None}
    of_events = {each for each in arrays if view.design(each).sampling is Sampling.TOWARDS_EVENT}
    for each in disagreements(arrays):
        if of_events & {each.first, each.second}:
            event = capitalized(plain_text(each.condition))
            yield Finding(event, f"{capitalized(plain_text(str(each)))}.")


def _stated(array: xr.DataArray) -> str:
    value, lower, upper = map(no_break, percent_texts(*array.values.tolist()))
    if not has_interval(array.values):
        return f"{value} of cases (without an interval: {estimate_remark(array)})"
    level = no_break(percent_text(array.attrs[INTERVAL_LEVEL]))
    return f"{value} of cases ({lower} to {upper}, {level} interval)"


def decision_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield the verdict of each design on its claim, with its probability of being wrong."""
    for design in view.designs:
        if decision := view.statistics.decision(design):
            verdict = f"{capitalized(decision.verdict_text)} of {design}"
            yield Finding(plain_text(decision.claim), f"{verdict}: {decision.guarantee}.")
