"""Sentences on an output, each complete by itself, and what must be known with them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import (
    CONDITIONAL,
    EXCEEDANCE,
    INTERVAL_LEVEL,
    MISSING,
    QUANTILES,
    SHARES,
    STATUSES,
    TOLERANCE_LIMITS,
)
from uqpen.figures.archive_view import ArchiveView
from uqpen.figures.texts import capitalized, plain_text
from uqpen.report.notes import has_interval
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    default_statistic,
    no_break,
    output_name,
    requested_statistics,
)
from uqpen.results.digits import percent_text
from uqpen.results.table import estimate_remark

__all__ = ["OutputSentences", "output_sentences"]

# Sentences on an output that something was asked of, and kinds that one names.
_MOST_SENTENCES = 3
_MOST_CATEGORIES = 4


class OutputSentences(NamedTuple):
    """What is said of an output.

    Attributes
    ----------
    sentences : tuple of str
    quantities : tuple of QuotedStatistic
        What they tell.
    remarks : tuple of str
        What must be known of the very estimates.
    missing_runs_note : int
        How many of the quantities asked have no sentence.
    """

    sentences: tuple[str, ...]
    quantities: tuple[QuotedStatistic, ...]
    remarks: tuple[str, ...]
    omitted: int = 0


def output_sentences(view: ArchiveView, output: str, design: str) -> OutputSentences | None:
    """What a design tells of an output; None for nothing.

    Parameters
    ----------
    view : ArchiveView
    output : str
    design : str
        Whose runs are a sample of the input law.
    """
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
    of = _Population.from_design(view, design)
    return OutputSentences(
        tuple(_sentence(each, array, of) for each, array in estimates),
        tuple(each for each, _ in estimates),
        tuple(_remarks(estimates)),
        max(0, len(every) - _MOST_SENTENCES),
    )


def _sentence(quantity: QuotedStatistic, array: xr.DataArray, of: _Population) -> str:
    name = output_name(quantity.view, quantity.output)
    if quantity.kind == TOLERANCE_LIMITS:
        return f"{_tolerance_limit_sentence(quantity, array, name, of)}{of.omission_sentence}"
    stated = f"{quantity.texts(array)[0]} {quantity.interval(array)}"
    if quantity.kind == QUANTILES:
        half = f"half of {of.name} stay at or below it"
        return f"The median of {name} is {stated}: {half}.{of.omission_sentence}"
    if quantity.kind == EXCEEDANCE:
        name = f"{name} exceeds {no_break(plain_text(quantity.entry))}"
        return (
            f"The probability that {name}{of.condition} is "
            f"{stated}.{of.missing_run_sentence(array)}"
        )
    return f"The mean of {name}{of.condition} is {stated}.{of.omission_sentence}"


def _tolerance_limit_sentence(
    quantity: QuotedStatistic, array: xr.DataArray, name: str, of: _Population
) -> str:
    value, _, bound = quantity.texts(array)
    share = no_break(percent_text(quantity.entry))
    if np.isfinite(array.values[2]):
        level = no_break(percent_text(array.attrs.get(INTERVAL_LEVEL, np.nan)))
        return (
            f"With {level} confidence, {name} stays at or below {bound} in at least {share} of "
            f"{of.name} (the estimate of that value is {value})."
        )
    return (
        f"In {share} of {of.name} {name} stays at or below {value} by estimate, which has no "
        f"upper bound: {estimate_remark(array)}."
    )


class _Population(NamedTuple):
    """What a design's figures are of, in the words of a sentence that stands by itself.

    Attributes
    ----------
    name : str
        Those that quantiles are of, and values that hold: none that did not come back.
    every : str
        All of them, which the interval of a probability allows for.
    condition : str
        What a probability is given; empty for nothing.
    missing : str
        What did not come back; empty for nothing.
    """

    name: str
    every: str
    condition: str
    missing: str

    @classmethod
    def from_design(cls, view: ArchiveView, design: str) -> _Population:
        """Those of a design's statistics."""
        accounts = read_group(view.tree, STATUSES, design).attrs
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
        """A sentence that says what an estimate and its interval leave out."""
        return f" This leaves out {self.missing}, which did not come back." * bool(self.missing)

    def missing_run_sentence(self, array: xr.DataArray) -> str:
        """The same of a probability, the interval of which counts lost runs both ways."""
        if not self.missing or not has_interval(array.values):
            return self.omission_sentence
        return (
            f" The estimate leaves out {self.missing}, which did not come back; the interval "
            "allows for whatever they would have given."
        )


def _category_sentences(view: ArchiveView, output: str, design: str) -> OutputSentences | None:
    """One sentence on an output that has kinds, the most frequent first."""
    found = sorted(
        _category_statistics(view, output, design), key=lambda kind: -float(kind[2].values[0])
    )
    shown = found[:_MOST_CATEGORIES]
    if not shown:
        return None
    of = _Population.from_design(view, design)
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
    """What each kind is called, and its share."""
    estimates = read_group(view.tree, SHARES, design)
    if output in estimates:
        flags = estimates[f"{output}_category"].values.tolist()
        labels = estimates[f"{output}_category_label"].values.tolist()
        for flag, label in zip(flags, labels, strict=True):
            quantity = QuotedStatistic(view, output, SHARES, flag)
            if (array := quantity.estimate(design)) is not None:
                yield f"“{plain_text(str(label), 40)}”", quantity, array


def _remarks(told: list[tuple[QuotedStatistic, xr.DataArray]]) -> Iterator[str]:
    """What must be known of the estimates, where their sentences do not say it."""
    for quantity, array in told:
        if note := _estimate_remark(array):
            yield f"{quantity.heading}: {note}."


def _estimate_remark(array: xr.DataArray) -> str:
    """What must be known of an estimate; why there is no interval stands in its place."""
    return estimate_remark(array) if has_interval(array.values) else ""
