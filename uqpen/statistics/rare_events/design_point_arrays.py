"""Design points of a rare event as estimate arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT, ROLE, RUN
from uqpen.core.statistic_dimensions import DESIGN_POINT
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.rare_events.form_probability import DesignPoint
from uqpen.statistics.sensitivity.input_measures import input_coordinate

__all__ = ["design_point_arrays"]


def design_point_arrays(
    points: Sequence[DesignPoint], runs: xr.Dataset
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield what is known of design points. Nothing measures its error, so it has no bounds.

    Parameters
    ----------
    points : sequence of DesignPoint
        At least one, the nearest first.
    runs : Dataset
        All runs of the design.

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
        estimates = [_without_bounds(value) for value in values]
        yield (
            name,
            Estimate.array(
                estimates,
                {DESIGN_POINT: len(points)},
                units="1",
                long_name=long_name,
                coordinates=along,
            ),
        )
    inputs = [
        str(name)
        for name, each in runs.data_vars.items()
        if each.attrs.get(ROLE) == INPUT and each.ndim
    ]
    factors = [[_without_bounds(factor) for factor in p.direction**2] for p in points]
    yield (
        "importance_factor",
        Estimate.table(
            factors,
            (DESIGN_POINT, INPUT),
            units="1",
            long_name="share of an input in the direction to a design point",
            coordinates={**along, **input_coordinate(inputs)},
        ),
    )


def _without_bounds(value: float) -> Estimate:
    reason = texts.NO_SECOND_ORDER if np.isnan(value) else texts.FORM_HAS_NO_INTERVAL
    return Estimate.without_bounds(float(value), reason)
