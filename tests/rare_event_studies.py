"""Studies of a rare event of two standard normal inputs, for the tests of each method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import xarray as xr

import uqpen

__all__ = ["INPUTS", "half_space", "probability", "study"]

INPUTS = {"a": uqpen.Normal(0.0, 1.0), "b": uqpen.Normal(0.0, 1.0)}


def half_space(a: Any, b: Any) -> dict[str, Any]:
    """Exceed a depth of β √2 with the probability of a standard normal variable above β."""
    return {"depth": a + b, "speed": a - b}


def study(
    design: Any,
    function: Callable[..., Any] = half_space,
    inputs: dict[str, Any] = INPUTS,
    **settings: Any,
) -> uqpen.Study:
    """Return a study; of its intervals, one in a thousand misses."""
    model = uqpen.PythonModel(
        function, {"a": "1", "b": "1"}, {"depth": "m", "speed": "m/s"}, vectorized=True
    )
    settings = {"seed": 4, "confidence_level": 0.999, **settings}
    return uqpen.Study(model, inputs, designs={"rare": design}, **settings)


def probability(tree: xr.DataTree) -> xr.DataArray:
    """Return the probability of the event, with its bounds."""
    (found,) = tree["joint_probabilities/rare"]["joint_probability"]
    return found
