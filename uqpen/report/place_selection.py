"""Data of a page on the places of a field, for a reader who moves along its dimension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from uqpen.report.marks import Trace

__all__ = ["PlaceReadout", "PlaceSlices"]


@dataclass(frozen=True)
class PlaceReadout:
    """A place along the axis of a chart that a reader moves, and the estimates there.

    Parameters
    ----------
    output, dimension : str
        Their titles.
    values : sequence of float
        The coordinates, in the unit of the axis.
    texts : sequence of str
        The estimates at each of them, as a sentence.
    start : int
        Position of the place that is shown first.
    """

    output: str
    dimension: str
    values: Sequence[float]
    texts: Sequence[str]
    start: int


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
        For each place and each trace of the chart, the members that replace those of the trace.
    """

    dimension: tuple[str, str]
    values: Sequence[float]
    traces: Sequence[Sequence[Trace]]
