"""Points of a round: in memory, drawn by blocks when they are needed, or for some models alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from uqpen.core.blocks import BlockedDataset
from uqpen.core.labels import RUN

if TYPE_CHECKING:
    import xarray as xr

# Points of a round that are drawn by blocks, when they are needed.


@dataclass(frozen=True, eq=False)
class DrawnPoints(BlockedDataset):
    """Points of a round that are in memory only where they have been drawn.

    Parameters
    ----------
    runs : int
        Number of points.
    draw : callable
        Returns the points from one number to another, the last excluded, as a dataset that
        `Design.rounds` could yield. All parts have the same variables and coordinates. A point is
        the same in whatever part it is drawn, and however often.
    """

    runs: int
    draw: Callable[[int, int], xr.Dataset]

    @property
    def size(self) -> int:
        return self.runs

    def read(self, start: int, stop: int) -> xr.Dataset:
        points = self.draw(start, stop)
        numbered = points.assign_coords({RUN: np.arange(start, stop)})
        # xarray would put the new coordinate last, and an archive keeps the order.
        return numbered[[*dict.fromkeys([*points.variables, RUN])]]

    def pipe(self, function: Callable[[xr.Dataset], xr.Dataset]) -> DrawnPoints:
        """Return these points with a function applied to whatever part is drawn."""
        return DrawnPoints(self.runs, lambda start, stop: function(self.draw(start, stop)))

    def assign(self, variables: Mapping[str, Any]) -> DrawnPoints:
        """Return these points with further variables, as `Dataset.assign` does."""
        return self.pipe(lambda points: points.assign(variables))

    def assign_attrs(self, attributes: Mapping[str, Any]) -> DrawnPoints:
        """Return these points with further attributes, as `Dataset.assign_attrs` does."""
        return self.pipe(lambda points: points.assign_attrs(attributes))


# Points of a round, as a design yields them.
Points: TypeAlias = "xr.Dataset | DrawnPoints"


def points_in_memory(points: Points) -> xr.Dataset:
    """Return the points of a round as one dataset."""
    return points.dataset() if isinstance(points, DrawnPoints) else points


# Round of a design that only some of a study's models run.


@dataclass(frozen=True, eq=False)
class Round:
    """Points of a round that only some of a study's models run.

    All models run the first round of a design, and each other one that is bare points.
    """

    points: Points  # the points
    models: tuple[str, ...]  # the names of the models


def points_of(drawn: Points | Round) -> Points:
    """Return the points of a round, whether all models run them or some."""
    return drawn.points if isinstance(drawn, Round) else drawn
