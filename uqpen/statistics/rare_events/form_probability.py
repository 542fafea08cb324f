"""Probability of a rare event by planes at its design points (FORM), and what is known of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import (
    DESIGN_POINT,
    INPUT,
    MOVED_AXIS,
    NORMAL_DISTANCE,
    ROLE,
    RUN,
    SEARCH_ORIGIN,
    SEARCH_START,
)
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.rare_events.form import (
    CURVATURE_AXIS,
    DIFFERENCE,
    distinct_points,
    principal_curvatures,
)
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.rare_events.rare_event_probability import RareEventProbability
from uqpen.statistics.sensitivity.input_measures import input_coordinate

# Nodes of Gauss's rule for the probability beyond two planes; the integrand is smooth.
_NODES = 32


@dataclass(frozen=True, eq=False)
class DesignPoint:
    """Design point of an event."""

    run: int  # position of its run
    # Distance from the median in standard normal space, below 0 if the median is in the event.
    reliability_index: float
    # (random input,): of the gradient; its squares are the importance factors.
    direction: FloatArray
    # (random input - 1,): principal curvatures; None where they are not known.
    curvatures: FloatArray | None

    @property
    def first_order(self) -> float:
        """Probability beyond the tangent plane."""
        return float(ndtr(-self.reliability_index))

    @property
    def second_order(self) -> float:
        """Probability beyond a paraboloid (Hohenbichler and Rackwitz); NaN where none is known."""
        if self.curvatures is None:
            return math.nan
        density = math.exp(-0.5 * self.reliability_index**2) / math.sqrt(2 * math.pi)
        factors = 1 + density / self.first_order * self.curvatures
        return (
            float(self.first_order / np.sqrt(factors.prod())) if (factors > 0).all() else math.nan
        )


def design_points(
    runs: xr.Dataset, event: LimitState, outcomes: EventOutcomes
) -> list[DesignPoint]:
    """Return the design points that the searches have reached, the nearest first.

    Parameters
    ----------
    outcomes : EventOutcomes
        Of all runs.
    """
    starts = runs[SEARCH_ORIGIN].values == -1
    performance = event.performance(outcomes, event.scales(outcomes.of(starts)))
    axis, start = runs[MOVED_AXIS].values, runs[SEARCH_START].values
    sign = -1 if performance[0] > 0 else 1
    found = []
    for number in np.unique(start):
        own = np.flatnonzero(start == number)
        point = _reached(runs, performance, own[axis[own] != CURVATURE_AXIS], sign)
        if point is not None:
            found.append(point)
    places = [each.reliability_index * each.direction for each in found]
    distinct = distinct_points(np.array(places)) if found else ()
    of_curvature = np.flatnonzero(axis == CURVATURE_AXIS)
    return [_with_curvatures(found[at], runs, performance, of_curvature) for at in distinct]


def _reached(
    runs: xr.Dataset, performance: FloatArray, own: IntArray, sign: int
) -> DesignPoint | None:
    """Return the design point of a search; None where it has not converged.

    A search that has converged ends with a gradient, any other with a step.
    """
    axis, origin = runs[MOVED_AXIS].values[own], runs[SEARCH_ORIGIN].values[own]
    if axis[-1] < 0:
        return None
    last = own[(origin == origin[-1]) & (axis >= 0)]
    at = int(np.flatnonzero(runs[RUN].values == origin[-1])[0])
    change = performance[last] - performance[at]
    gradient = np.where(np.isfinite(change), change, 0.0) / DIFFERENCE
    slope = math.sqrt((gradient**2).sum())
    if slope == 0:
        return None
    index = sign * float(runs[NORMAL_DISTANCE].values[at])
    return DesignPoint(at, index, gradient / slope, None)


def _with_curvatures(
    point: DesignPoint, runs: xr.Dataset, performance: FloatArray, among: IntArray
) -> DesignPoint:
    """Return a design point with its curvatures, if it has runs for them and all are known."""
    own = among[runs[SEARCH_ORIGIN].values[among] == runs[RUN].values[point.run]]
    if not len(own) or not np.isfinite(performance[own]).all():
        return point
    # The slope follows from the runs of the gradient again; its direction is that of the point.
    base = performance[point.run]
    moved = np.flatnonzero(
        (runs[SEARCH_ORIGIN].values == runs[RUN].values[point.run]) & (runs[MOVED_AXIS].values >= 0)
    )
    gradient = (performance[moved] - base) / DIFFERENCE
    if not np.isfinite(gradient).all() or len(gradient) != len(point.direction):
        return point
    curvatures = principal_curvatures(performance[own], float(base), gradient)
    return DesignPoint(point.run, point.reliability_index, point.direction, curvatures)


def form_probability(runs: xr.Dataset, event: LimitState, level: float) -> RareEventProbability:
    """Return the probability beyond the tangent planes at all design points, without an interval.

    What is known of each design point follows as further statistics.
    """
    outcomes = event.outcomes(runs)
    points = design_points(runs, event, outcomes)
    if not points:
        return RareEventProbability(Estimate.without_bounds(math.nan, texts.NO_DESIGN_POINT))
    probability = _of_union(points)
    notes = [texts.FORM_HAS_NO_INTERVAL, *_described(points, runs)]
    if (failed := int(outcomes.missing.sum())) > 0:
        notes.append(texts.FORM_PAST_FAILED.format(runs=failed))
    estimate = Estimate.without_bounds(probability, *notes)
    return RareEventProbability(estimate, statistics=dict(_design_point_arrays(points, runs)))


def _of_union(points: Sequence[DesignPoint]) -> float:
    """Return the probability beyond any of the planes, by Ditlevsen's upper bound (1979)."""
    total = 0.0
    for number, point in enumerate(points):
        common = max((_beyond_both(point, each) for each in points[:number]), default=0.0)
        total += max(point.first_order - common, 0.0)
    return min(total, 1.0)


def _beyond_both(first: DesignPoint, second: DesignPoint) -> float:
    """Return the probability beyond two planes: of two correlated normal variables.

    It follows from independence by an integral over the correlation (Plackett, 1954), whose
    variable is the arcsine of the correlation.
    """
    a, b = first.reliability_index, second.reliability_index
    correlation = float(np.clip((first.direction * second.direction).sum(), -1, 1))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    angle = 0.5 * math.asin(correlation) * (nodes + 1)
    exponent = -(a**2 + b**2 - 2 * a * b * np.sin(angle)) / (2 * np.cos(angle) ** 2)
    integral = 0.5 * math.asin(correlation) * float((weights * np.exp(exponent)).sum())
    return first.first_order * second.first_order + integral / (2 * math.pi)


def _text(variable: xr.DataArray, run: int) -> str:
    """Return the value of an input with its unit."""
    unit = str(variable.attrs.get("units", DIMENSIONLESS))
    value = f"{float(variable.values[run]):.4g}"
    return value if unit == DIMENSIONLESS else f"{value} {unit}"


def _random_inputs(runs: xr.Dataset) -> list[xr.DataArray]:
    return [each for each in runs.data_vars.values() if each.attrs.get(ROLE) == INPUT and each.ndim]


def _described(points: Sequence[DesignPoint], runs: xr.Dataset) -> Iterator[str]:
    """Yield each design point in words, in the inputs' own units."""
    inputs = _random_inputs(runs)
    for point in points:
        parts = [
            f"{each.name} = {_text(each, point.run)} ({100 * factor:.0f} %)"
            for each, factor in zip(inputs, point.direction**2, strict=True)
        ]
        yield texts.DESIGN_POINT.format(
            index=point.reliability_index, values=", ".join(parts), first=point.first_order
        ) + (
            texts.SECOND_ORDER.format(probability=point.second_order)
            if math.isfinite(point.second_order)
            else texts.NO_SECOND_ORDER
        )


def _design_point_arrays(points: Sequence[DesignPoint], runs: xr.Dataset) -> NamedArrays:
    """Yield what is known of design points. Nothing measures its error, so it has no bounds.

    Parameters
    ----------
    points : sequence of DesignPoint
        At least one, the nearest first.

    Yields
    ------
    name : str
        ``reliability_index``, ``first_order_probability`` and ``second_order_probability`` of each
        point; ``importance_factor`` of each point and input.
    estimate : DataArray
        Along ``design_point``, ``input`` if it is of inputs, and ``bound``. The coordinate
        ``design_point_run`` has the number of the run at each point.
    """
    numbers = runs[RUN].values[[each.run for each in points]]
    along = {
        DESIGN_POINT: (DESIGN_POINT, np.arange(1, len(points) + 1), {"long_name": "design point"}),
        f"{DESIGN_POINT}_run": (DESIGN_POINT, numbers, {"long_name": "run at the design point"}),
    }
    of_points = {
        "reliability_index": ("distance from the median", [p.reliability_index for p in points]),
        "first_order_probability": (
            "probability beyond the tangent plane",
            [p.first_order for p in points],
        ),
        "second_order_probability": (
            "probability beyond a paraboloid",
            [p.second_order for p in points],
        ),
    }
    for name, (long_name, values) in of_points.items():
        estimate = _without_bounds(np.array(values))
        described: dict[str, Any] = {"long_name": long_name, "coordinates": along}
        yield name, estimate.to_array(DESIGN_POINT, units="1", **described)
    inputs = [str(each.name) for each in _random_inputs(runs)]
    factors = _without_bounds(np.array([each.direction**2 for each in points]))
    yield (
        "importance_factor",
        factors.to_array(
            DESIGN_POINT,
            INPUT,
            units="1",
            long_name="share of an input in the direction to a design point",
            coordinates={**along, **input_coordinate(inputs)},
        ),
    )


def _without_bounds(values: FloatArray) -> Estimate:
    found = Estimate.without_bounds(values, texts.FORM_HAS_NO_INTERVAL)
    return found.remove_bounds_at(np.isnan(values), texts.NO_SECOND_ORDER)
