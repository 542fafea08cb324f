"""Sentences on an output, each complete by itself, and what must be known with them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.figures.texts import capitalized, plain
from uqpen.labels import (
    CONDITIONAL,
    EXCEEDANCE,
    HOLDS,
    INTERVAL_LEVEL,
    MISSING,
    QUANTILES,
    SHARES,
    STATUSES,
)
from uqpen.report.notes import has_interval
from uqpen.report.sections.quoted import Quantity, asked, name_of, unbroken, usual
from uqpen.summary.digits import percent
from uqpen.summary.table import remark

__all__ = ["Said", "sentences_on"]

# Sentences on an output that something was asked of, and kinds that one names.
_MOST_SENTENCES = 3
_MOST_KINDS = 4


class Said(NamedTuple):
    """What is said of an output.

    Attributes
    ----------
    sentences : tuple of str
    quantities : tuple of Quantity
        What they tell.
    remarks : tuple of str
        What must be known of the very estimates.
    left_out : int
        How many of the quantities asked have no sentence.
    """

    sentences: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    remarks: tuple[str, ...]
    left_out: int = 0


def sentences_on(part: Part, output: str, design: str) -> Said | None:
    """What a design tells of an output; None for nothing.

    Parameters
    ----------
    part : Part
    output : str
    design : str
        Whose runs are a sample of the input law.
    """
    if output in part.kinds:
        return _on_kinds(part, output, design)
    every = asked(part, output, design)
    kept = every[:_MOST_SENTENCES]
    common = usual(part, output, design)
    if common is not None and len(kept) < _MOST_SENTENCES:
        kept.append(common)
    told = [(each, found) for each in kept if (found := each.estimate(design)) is not None]
    if not told:
        return None
    of = _Cases.of(part, design)
    return Said(
        tuple(_sentence(each, array, of) for each, array in told),
        tuple(each for each, _ in told),
        tuple(_remarks(told)),
        max(0, len(every) - _MOST_SENTENCES),
    )


def _sentence(quantity: Quantity, array: xr.DataArray, of: _Cases) -> str:
    name = name_of(quantity.part, quantity.output)
    if quantity.kind == HOLDS:
        return f"{_on_hold(quantity, array, name, of)}{of.left_out}"
    stated = f"{quantity.texts(array)[0]} {quantity.interval(array)}"
    if quantity.kind == QUANTILES:
        half = f"half of {of.called} stay at or below it"
        return f"The median of {name} is {stated}: {half}.{of.left_out}"
    if quantity.kind == EXCEEDANCE:
        name = f"{name} exceeds {unbroken(plain(quantity.entry))}"
        return f"The probability that {name}{of.condition} is {stated}.{of.allowed_for(array)}"
    return f"The mean of {name}{of.condition} is {stated}.{of.left_out}"


def _on_hold(quantity: Quantity, array: xr.DataArray, name: str, of: _Cases) -> str:
    value, _, bound = quantity.texts(array)
    share = unbroken(percent(quantity.entry))
    if np.isfinite(array.values[2]):
        level = unbroken(percent(array.attrs.get(INTERVAL_LEVEL, np.nan)))
        return (
            f"With {level} confidence, {name} stays at or below {bound} in at least {share} of "
            f"{of.called} (the estimate of that value is {value})."
        )
    return (
        f"In {share} of {of.called} {name} stays at or below {value} by estimate, which has no "
        f"upper bound: {remark(array)}."
    )


class _Cases(NamedTuple):
    """What a design's figures are of, in the words of a sentence that stands by itself.

    Attributes
    ----------
    called : str
        Those that quantiles are of, and values that hold: none that did not come back.
    every : str
        All of them, which the interval of a probability allows for.
    condition : str
        What a probability is given; empty for nothing.
    missing : str
        What did not come back; empty for nothing.
    """

    called: str
    every: str
    condition: str
    missing: str

    @classmethod
    def of(cls, part: Part, design: str) -> _Cases:
        """Those of a design's statistics."""
        accounts = group(part.tree, STATUSES, design).attrs
        given, missing = accounts.get(CONDITIONAL), accounts.get(MISSING)
        every = "all admissible cases" if given else "all cases"
        return cls(
            f"{every} in which the model gives a result" if missing else every,
            every,
            f", given {given}," if given else "",
            str(missing or ""),
        )

    @property
    def left_out(self) -> str:
        """A sentence that says what an estimate and its interval leave out."""
        return f" This leaves out {self.missing}, which did not come back." * bool(self.missing)

    def allowed_for(self, array: xr.DataArray) -> str:
        """The same of a probability, the interval of which counts lost runs both ways."""
        if not self.missing or not has_interval(array.values):
            return self.left_out
        return (
            f" The estimate leaves out {self.missing}, which did not come back; the interval "
            "allows for whatever they would have given."
        )


def _on_kinds(part: Part, output: str, design: str) -> Said | None:
    """One sentence on an output that has kinds, the most frequent first."""
    found = sorted(_kinds(part, output, design), key=lambda kind: -float(kind[2].values[0]))
    shown = found[:_MOST_KINDS]
    if not shown:
        return None
    of = _Cases.of(part, design)
    parts = [
        f"{label} in {each.texts(array)[0]} of {of.every} {each.interval(array)}"
        for label, each, array in shown
    ]
    start = capitalized(name_of(part, output))
    notes: dict[str, list[str]] = {}
    for label, _, array in shown:
        if note := _unsaid(array):
            notes.setdefault(note, []).append(label)
    remarks = tuple(
        f"{start}, share of {', '.join(those)}: {note}." for note, those in notes.items()
    )
    sentence = f"{start}: {'; '.join(parts)}.{of.allowed_for(shown[0][2])}"
    return Said((sentence,), (), remarks, len(found) - len(shown))


def _kinds(part: Part, output: str, design: str) -> Iterator[tuple[str, Quantity, xr.DataArray]]:
    """What each kind is called, and its share."""
    told = group(part.tree, SHARES, design)
    if output in told:
        flags = told[f"{output}_category"].values.tolist()
        labels = told[f"{output}_category_label"].values.tolist()
        for flag, label in zip(flags, labels, strict=True):
            quantity = Quantity(part, output, SHARES, flag)
            if (array := quantity.estimate(design)) is not None:
                yield f"“{plain(str(label), 40)}”", quantity, array


def _remarks(told: list[tuple[Quantity, xr.DataArray]]) -> Iterator[str]:
    """What must be known of the estimates, where their sentences do not say it."""
    for quantity, array in told:
        if note := _unsaid(array):
            yield f"{quantity.heading}: {note}."


def _unsaid(array: xr.DataArray) -> str:
    """What must be known of an estimate; why there is no interval stands in its place."""
    return remark(array) if has_interval(array.values) else ""
