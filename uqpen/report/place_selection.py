"""Data of a page on the places of a field, for a reader who moves along its dimension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from uqpen.report.marks import Trace
from uqpen.results.table import NOTHING

__all__ = ["PlaceColumn", "PlaceReadout", "PlaceSlices"]


@dataclass(frozen=True)
class PlaceColumn:
    """A statistic at each of the places of a curve.

    Parameters
    ----------
    label, unit : str
        What stands before and behind its estimates.
    texts : sequence of str
        The estimates; `NOTHING` where there is none.
    reasons : dict
        Why an estimate has no interval, by position of the place.
    """

    label: str
    unit: str
    texts: Sequence[str]
    reasons: dict[int, str]

    def text(self, position: int) -> str:
        """Return the estimate at a place with its label; empty where there is none."""
        if self.texts[position] == NOTHING:
            return ""
        reason = self.reasons.get(position)
        remark = f" (no interval: {reason})" if reason else ""
        return f"{self.label} {self.texts[position]}{self.unit}{remark}"


@dataclass(frozen=True)
class PlaceReadout:
    """A place along the axis of a chart that a reader moves, and the estimates there.

    Parameters
    ----------
    output, dimension : str
        Their titles.
    values : sequence of float
        The coordinates, in the unit of the axis.
    heads : sequence of str
        The coordinates with their unit.
    columns : sequence of PlaceColumn
        The statistics there.
    start : int
        Position of the place that is shown first.
    """

    output: str
    dimension: str
    values: Sequence[float | None]
    heads: Sequence[str]
    columns: Sequence[PlaceColumn]
    start: int

    def text(self, position: int) -> str:
        """Return the estimates at a place as a sentence; the page's script makes the same."""
        found = "; ".join(filter(None, (column.text(position) for column in self.columns)))
        return f"At {self.heads[position]}: {found or 'no run gets this far'}."


@dataclass(frozen=True)
class PlaceSlices:
    """Content of a chart at each of some places; the nearest one is shown.

    Parameters
    ----------
    dimension : tuple of str
        Name and unit of the dimension, as the axis of another chart has them.
    values : sequence of float
        The coordinates, in this unit.
    traces : sequence
        For each place and each trace of the chart, the members that differ from the trace's.
    """

    dimension: tuple[str, str]
    values: Sequence[float]
    traces: Sequence[Sequence[Trace]]
