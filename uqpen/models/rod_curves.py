"""Curves of many rods along the time since impact, or along the depth of the nose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.models.dense_integration import Steps, integrate
from uqpen.models.rod_motion import RigidMotion, Rods, at_impact, erosion_slopes

__all__ = ["Along", "Curves", "follow_erosion"]


class Along(IntEnum):
    """Coordinate of curves: its position in the states of an eroding rod, (u, x, L, z, time)."""

    DEPTH = 3
    TIME = 4


@dataclass(frozen=True)
class Curves:
    """Curves of some rods at given coordinates, NaN behind the end of their motion.

    Parameters
    ----------
    along : Along
        The coordinate.
    coordinates : ndarray, shape (place,)
        In ascending order, m or s.
    values : ndarray, shape (6, run, place)
        u and v, m s-1, L and s, m, the depth of the nose, m, and the time, s.
    """

    along: Along
    coordinates: FloatArray
    values: FloatArray

    @classmethod
    def make_empty(cls, along: Along, coordinates: FloatArray, runs: int) -> Curves:
        """Return curves without values."""
        return cls(along, coordinates, np.full((6, runs, coordinates.size), np.nan))

    def add_erosion(self, steps: Steps, ends: FloatArray, rods: Rods) -> None:
        """Fill in what lies inside steps of eroding rods, up to their ends, shape (5, step)."""
        row = self.along
        step, place = _places(self.coordinates, steps.before[row], ends[row])
        coordinates = self.coordinates[place]
        part = steps.parts_at(step, row, coordinates)
        u, x, L, z, t = steps.states(step, part)
        run = steps.problem[step]
        self.values[:, run, place] = u, u * (1 + x), L, rods.plastic_scale[run] * x, z, t

    def add_rigid_motion(self, motion: RigidMotion, rods: Rods, start: FloatArray) -> None:
        """Fill in what follows the end of erosion, the state of shape (5, run), until rest."""
        rest = motion.rest_depth if self.along is Along.DEPTH else motion.rest_time
        behind = np.nextafter(rest, np.inf)
        run, place = _places(self.coordinates, start[self.along], behind)
        coordinates, moving = self.coordinates[place], motion.select(run)
        if self.along is Along.DEPTH:
            z, (u, t) = coordinates, moving.at_depths(coordinates)
        else:
            t, (u, z) = coordinates, moving.at_times(coordinates)
        # A rod that stops while it erodes keeps its plastic extent; else x is 0.
        _, x, L, _, _ = start[:, run]
        self.values[:, run, place] = u, u, L, rods.plastic_scale[run] * x, z, t


def follow_erosion(rods: Rods, curves: Sequence[Curves], tolerance: float) -> FloatArray:
    """Fill curves in until erosion ends, and return the states there.

    Parameters
    ----------
    rods : Rods
        The constants of the equations.
    curves : sequence of Curves
        Of these rods.
    tolerance : float
        Relative error allowed to a step of the integration.

    Returns
    -------
    ndarray, shape (5, run)
        u, x, L, z and the time: x or u is 0. NaN where erosion does not end within
        `dense_integration.MOST_STEPS`; the state at impact of a rod that does not begin to erode.
    """
    start = at_impact(rods)
    constants = np.stack(rods)
    ends = start.copy()
    # (2.16) and (2.17): the tail falls back behind the nose from the start.
    erodes = np.flatnonzero(erosion_slopes(start, constants)[1] > 0)
    ends[:, erodes] = np.nan
    one = np.ones_like(rods.length)
    scales = np.stack(
        [rods.impact_velocity, one, rods.length, rods.length, rods.length / rods.impact_velocity]
    )
    for some in integrate(
        erosion_slopes,
        start[:, erodes],
        constants[:, erodes],
        scales[:, erodes],
        _is_over,
        tolerance,
    ):
        steps = some._replace(problem=erodes[some.problem])
        states = _end_states(steps)
        for each in curves:
            each.add_erosion(steps, states, rods)
        ends[:, steps.problem[steps.is_last]] = states[:, steps.is_last]
    return ends


def _end_states(steps: Steps) -> FloatArray:
    """Return the states at the ends of steps; of the last of a rod, where its erosion ends."""
    last = np.flatnonzero(steps.is_last)
    parts = np.full((2, last.size), np.inf)
    for variable in (0, 1):  # u and x
        passed = np.flatnonzero(steps.after[variable, last] < 0)
        parts[variable, passed] = steps.parts_at(last[passed], variable, np.zeros(passed.size))
    ends = steps.after.copy()
    ends[:, last] = steps.states(last, parts.min(axis=0))
    # Of two events the first is the one that ends erosion.
    ends[parts.argmin(axis=0), last] = 0.0
    return ends


def _is_over(state: FloatArray) -> BoolArray:
    u, x = state[:2]
    return (x < 0) | (u < 0)


def _places(
    coordinates: FloatArray, first: FloatArray, behind: FloatArray
) -> tuple[IntArray, IntArray]:
    """Return each pair of an interval and a place whose coordinate is in it.

    Parameters
    ----------
    coordinates : ndarray, shape (place,)
        In ascending order.
    first, behind : ndarray, shape (interval,)
        Ends of half-open intervals; NaN where there is none.

    Returns
    -------
    interval, place : ndarray of int, shape (pair,)
    """
    start = np.searchsorted(coordinates, first)
    count = np.searchsorted(coordinates, behind) - start
    interval = np.repeat(np.arange(count.size), count)
    place = np.arange(interval.size) - np.repeat(np.cumsum(count) - count - start, count)
    return interval, place
