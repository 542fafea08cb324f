"""Sentences on an output, each complete by itself, and remarks on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATEGORY
from uqpen.core.labels import CONDITIONAL, INTERVAL_LEVEL, MISSING
from uqpen.report.notes import has_interval
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    default_statistic,
    no_break,
    output_name,
    requested_statistics,
)
from uqpen.report.sections.view_statistics import sample_account
from uqpen.results.acceptance import Acceptance, AcceptanceVerdict
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text
from uqpen.results.table import estimate_remark
from uqpen.results.texts import capitalized, plain_text

__all__ = ["OutputSentences", "Population", "output_sentences", "verdict_sentence"]

# Sentences on an output with requested statistics, and categories in a sentence.
_MOST_SENTENCES = 3
_MOST_CATEGORIES = 4

# The verbs of the events that have a probability.
_EVENTS = {"exceedance": "exceeds", "below": "lies below"}


class OutputSentences(NamedTuple):
    """Sentences of the report about one output."""

    sentences: tuple[str, ...]
    quantities: tuple[QuotedStatistic, ...]  # that they state
    remarks: tuple[str, ...]  # on these estimates
    omitted: int = 0  # requested quantities that have no sentence


def output_sentences(view: ArchiveView, output: str, design: str) -> OutputSentences | None:
    """Return a sentence on an output by a design whose runs are a sample; None without one."""
    if output in view.categorical_outputs:
        return _category_sentences(view, output, design)
    every = requested_statistics(view, output, design)
    kept = every[:_MOST_SENTENCES]
    common = default_statistic(view, output, design)
    if common is not None and len(kept) < _MOST_SENTENCES:
        kept.append(common)
    estimates = [(each, found) for each in kept if (found := each.estimate(design)) is not None]
    if not estimates:
        return None
    of = Population.from_design(view, design)
    return OutputSentences(
        tuple(_sentence(each, array, of) for each, array in estimates),
        tuple(each for each, _ in estimates),
        tuple(_remarks(estimates)),
        max(0, len(every) - _MOST_SENTENCES),
    )


def _sentence(quantity: QuotedStatistic, array: xr.DataArray, of: Population) -> str:
    name = output_name(quantity.view, quantity.output)
    if quantity.statistic == "tolerance_interval":
        return f"{_tolerance_interval_sentence(quantity, array, name, of)}{of.omission_sentence}"
    if quantity.statistic in ("tolerance_limit", "lower_tolerance_limit"):
        return f"{_tolerance_limit_sentence(quantity, array, name, of)}{of.omission_sentence}"
    stated = f"{quantity.texts(array)[0]} {quantity.interval(array)}"
    if quantity.statistic == "quantile":
        half = f"half of {of.name} have at most this value"
        return f"The median of {name} is {stated}: {half}.{of.omission_sentence}"
    if verb := _EVENTS.get(quantity.statistic):
        event = f"{name} {verb} {no_break(plain_text(quantity.entry))}{of.condition}"
        return (
            f"The probability that {event} is {stated}.{of.missing_run_sentence(array)}"
            f"{verdict_sentence(array)}"
        )
    return f"The mean of {name}{of.condition} is {stated}.{of.omission_sentence}"


def verdict_sentence(array: xr.DataArray) -> str:
    """A sentence on the acceptance limits of the study; empty for none."""
    acceptance = Acceptance.from_array(array)
    if acceptance is None:
        return ""
    limit = f"the study's limit of {no_break(str(acceptance))}"
    if acceptance.verdict is AcceptanceVerdict.NOT_DECIDED:
        why = "contains it" if has_interval(array.values) else "is missing"
        return f" These runs do not decide whether {limit} is met: the interval {why}."
    where = "within" if acceptance.verdict is AcceptanceVerdict.MET else "beyond"
    return f" {capitalized(limit)} is {acceptance.verdict}: the whole interval lies {where} it."


def _tolerance_limit_sentence(
    quantity: QuotedStatistic, array: xr.DataArray, name: str, of: Population
) -> str:
    is_lower = quantity.statistic == "lower_tolerance_limit"
    value, *ends = quantity.texts(array)
    share = no_break(percent_text(quantity.entry))
    beyond, side, end = ("at least", "lower", 0) if is_lower else ("at most", "upper", 1)
    if np.isfinite(array.values[1 + end]):
        return (
            f"With {_level(array)} confidence, {name} is {beyond} {ends[end]} in at least {share} "
            f"of {of.name}. The best estimate of this limit is {value}."
        )
    return (
        f"In {share} of {of.name} {name} is {beyond} {value} by estimate. This limit has no {side} "
        f"bound: {estimate_remark(array)}."
    )


def _tolerance_interval_sentence(
    quantity: QuotedStatistic, array: xr.DataArray, name: str, of: Population
) -> str:
    share = no_break(percent_text(quantity.entry))
    lower, upper = quantity.end_texts(array)
    return (
        f"With {_level(array)} confidence, {name} is from {lower} to {upper} in at least {share} "
        f"of {of.name}."
    )


def _level(array: xr.DataArray) -> str:
    return no_break(percent_text(array.attrs.get(INTERVAL_LEVEL, np.nan)))


class Population(NamedTuple):
    """Population of a design's estimates, in the words of a sentence that stands by itself."""

    name: str  # the cases with a result, which quantiles and tolerance limits refer to
    every: str  # all cases, which the interval of a probability allows for
    condition: str  # of a probability; empty for none
    missing: str  # runs that did not complete; empty for none

    @classmethod
    def from_design(cls, view: ArchiveView, design: str) -> Population:
        """Return the population of a design's statistics."""
        accounts = sample_account(view, design)
        given, missing = accounts.get(CONDITIONAL), accounts.get(MISSING)
        every = "all admissible cases" if given else "all cases"
        return cls(
            f"{every} in which the model gives a result" if missing else every,
            every,
            f", given {given}," if given else "",
            str(missing or ""),
        )

    @property
    def omission_sentence(self) -> str:
        """A sentence on the runs that an estimate and its interval leave out."""
        return f" This leaves out {self.missing}, which did not complete." * bool(self.missing)

    def missing_run_sentence(self, array: xr.DataArray) -> str:
        """Return the sentence for a probability, whose interval counts failed runs both ways."""
        if not self.missing or not has_interval(array.values):
            return self.omission_sentence
        return (
            f" The estimate leaves out {self.missing}, which did not complete; the interval "
            "includes every result that they could have had."
        )


def _category_sentences(view: ArchiveView, output: str, design: str) -> OutputSentences | None:
    """Return a sentence on a categorical output, its most frequent category first."""
    found = sorted(
        _category_statistics(view, output, design), key=lambda each: -float(each[2].values[0])
    )
    shown = found[:_MOST_CATEGORIES]
    if not shown:
        return None
    of = Population.from_design(view, design)
    parts = [
        f"{label} in {each.texts(array)[0]} of {of.every} {each.interval(array)}"
        for label, each, array in shown
    ]
    start = capitalized(output_name(view, output))
    notes: dict[str, list[str]] = {}
    for label, _, array in shown:
        if note := _estimate_remark(array):
            notes.setdefault(note, []).append(label)
    remarks = tuple(
        f"{start}, share of {', '.join(those)}: {note}." for note, those in notes.items()
    )
    sentence = f"{start}: {'; '.join(parts)}.{of.missing_run_sentence(shown[0][2])}"
    return OutputSentences((sentence,), (), remarks, len(found) - len(shown))


def _category_statistics(
    view: ArchiveView, output: str, design: str
) -> Iterator[tuple[str, QuotedStatistic, xr.DataArray]]:
    shares = view.statistics.get(design, output, "share")
    if shares is not None:
        flags = shares[CATEGORY].values.tolist()
        labels = shares["category_label"].values.tolist()
        for flag, label in zip(flags, labels, strict=True):
            quantity = QuotedStatistic(view, output, "share", flag)
            if (array := quantity.estimate(design)) is not None:
                yield f"“{plain_text(str(label), 40)}”", quantity, array


def _remarks(told: list[tuple[QuotedStatistic, xr.DataArray]]) -> Iterator[str]:
    for quantity, array in told:
        if note := _estimate_remark(array):
            yield f"{quantity.heading}: {note}."


def _estimate_remark(array: xr.DataArray) -> str:
    """Return a remark on an estimate; the reason for no interval stands in the interval's place."""
    return estimate_remark(array) if has_interval(array.values) else ""
