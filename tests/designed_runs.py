"""Points, runs and estimates of a design of a model of one output, in metres."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import xarray as xr

from uqpen.core.model import Bounds, Input, Output
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Distribution
from uqpen.execution import Evaluator, evaluate
from uqpen.models.python_function import PythonFunction
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["REQUESTED", "estimates_of", "joint_of", "law_of", "points", "runs_of"]

OUTPUT = Output("y", "m")
REQUESTED = [QuantityOfInterest(OUTPUT, "m")]


def joint_of(
    entries: Mapping[str, Distribution | float], bounds: Mapping[str, Bounds] | None = None
) -> JointDistribution:
    """Return the joint distribution of independent inputs; a number is a fixed one."""
    variables = {
        name: Input(name, "m", bounds=(bounds or {}).get(name, Bounds())) for name in entries
    }
    inputs = (
        FixedInput(variables[name], entry, "m")
        if isinstance(entry, float)
        else RandomInput(variables[name], entry, "m")
        for name, entry in entries.items()
    )
    return JointDistribution(tuple(inputs), tuple(variables.values()))


def law_of(*distributions: Distribution, bounds: Bounds | None = None) -> JointDistribution:
    """Return that of random inputs x1, x2 and so on, of the same bounds."""
    entries = {f"x{number}": each for number, each in enumerate(distributions, 1)}
    return joint_of(entries, dict.fromkeys(entries, bounds or Bounds()))


def points(design: Design, joint: JointDistribution, name: str = "mine") -> Any:
    """Return the points of a design of one round."""
    (only,) = design.rounds(joint, Stream(1, "designs", name))
    return only


def runs_of(
    design: Design, joint: JointDistribution, function: Callable[..., Any], vectorized: bool = True
) -> xr.Dataset:
    """Return the runs of a function of the inputs."""
    names = [variable.name for variable in joint.variables]
    model = PythonFunction(
        lambda **inputs: {"y": function(**inputs)},
        "mine",
        joint.variables,
        (OUTPUT,),
        dict.fromkeys([*names, "y"], "m"),
        vectorized,
    )
    runs = evaluate(Evaluator(model), points(design, joint), {})
    return runs.assign_attrs(sampling=str(design.sampling))


def estimates_of(
    design: Design, joint: JointDistribution, function: Callable[..., Any], vectorized: bool = True
) -> Any:
    """Return the statistics of those runs."""
    return analyze(runs_of(design, joint, function, vectorized), REQUESTED)["y"]
