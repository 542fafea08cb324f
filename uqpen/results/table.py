"""A table for a person: what stands in its cells, and the notes below it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.core.labels import INTERVAL_LABEL, NOTE, REFUSED, ROLE, UNCHECKED
from uqpen.results.digits import SUPERSCRIPTS, estimate_text, percent_text

__all__ = [
    "NOTHING",
    "Conversion",
    "OutputTable",
    "estimate_remark",
    "estimate_with_verdict",
    "exceedance_label",
    "identity",
    "output_names",
    "quantile_label",
]

Conversion = Callable[[Any], Any]

# What stands in a cell where a source has no answer.
NOTHING = "–"


@dataclass
class OutputTable:
    """A table of one output, with a column for each source.

    Parameters
    ----------
    title : str
        What the output is, with the unit of the figures.
    columns : list of str
        Sources: designs and surrogates.
    rows : list
        A label, and a cell for each column.
    notes : list of str
        What the superscript numbers in cells refer to, in order.
    """

    title: str
    columns: list[str]
    rows: list[tuple[str, list[str]]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def note_mark(self, note: str) -> str:
        """The superscript of a note, noted if it is new; nothing for no note."""
        if not note:
            return ""
        if note not in self.notes:
            self.notes.append(note)
        return " " + str(self.notes.index(note) + 1).translate(SUPERSCRIPTS)

    def cell(self, array: xr.DataArray | None, convert: Conversion) -> str:
        """An estimate in the digits that it has, with the mark of what must be known of it."""
        return (
            NOTHING
            if array is None
            else estimate_with_verdict(array, convert) + self.note_mark(estimate_remark(array))
        )


def estimate_with_verdict(array: xr.DataArray, convert: Conversion) -> str:
    """An estimate in the digits that it has, with the verdict on it if that is against it."""
    text = estimate_text(*(float(value) for value in convert(array.values)))
    label = interval_text(array, INTERVAL_LABEL)
    return f"{text} {label}" if label in (REFUSED, UNCHECKED) else text


def identity(values: Any) -> Any:
    """Return values without a unit as they are, whatever unit their output is shown in."""
    return values


def quantile_label(probability: float) -> str:
    """Return the label of a quantile in a table."""
    return "median" if probability == 0.5 else f"{percent_text(probability)} quantile"


def exceedance_label(threshold: str) -> str:
    """Return the label of an exceedance probability, from the value as it was written."""
    return f"P(> {threshold})"


def estimate_remark(array: xr.DataArray) -> str:
    """Return what a reader must know of an estimate; empty for nothing."""
    note = interval_text(array, NOTE)
    if not note and interval_text(array, INTERVAL_LABEL) == "conservative":
        return "conservative: the interval may be wider than it need be"
    return note


def output_names(runs: xr.Dataset) -> list[str]:
    """The outputs among the variables of a runs dataset."""
    return [str(name) for name, v in runs.data_vars.items() if v.attrs.get(ROLE) == "output"]
