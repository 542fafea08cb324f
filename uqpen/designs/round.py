"""Round of a design that only some of a study's models run."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.designs.drawn_points import Points

__all__ = ["Round", "points_of"]


@dataclass(frozen=True, eq=False)
class Round:
    """Points of a round that only some of a study's models run.

    All models run the first round of a design, and each other one that is bare points.

    Parameters
    ----------
    points : Dataset or DrawnPoints
        The points.
    models : tuple of str
        The names of the models.
    """

    points: Points
    models: tuple[str, ...]


def points_of(drawn: Points | Round) -> Points:
    """Return the points of a round, whether all models run them or some."""
    return drawn.points if isinstance(drawn, Round) else drawn
