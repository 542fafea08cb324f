"""Inputs, runs and functions that several benchmarks share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.variables import Input
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import points_in_memory, points_of
from uqpen.designs.rounds import run_rounds
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal
from uqpen.execution import join_rounds


def independent(**laws: Distribution) -> JointDistribution:
    """Return independent inputs without a unit."""
    inputs = tuple(Input(name, "1") for name in laws)
    pairs = zip(inputs, laws.values(), strict=True)
    return JointDistribution(tuple(RandomInput(*pair, "1") for pair in pairs), inputs)


def standard_normals(dimension: int) -> JointDistribution:
    """Return independent standard normal inputs x0, x1, …."""
    return independent(**{f"x{number}": Normal(0.0, 1.0) for number in range(dimension)})


def runs_of(
    design: Design,
    joint: JointDistribution,
    stream: Stream,
    make: Callable[[xr.Dataset], xr.Dataset],
) -> xr.Dataset:
    """Return the runs of all rounds of a design, which are made from its points."""
    rounds = run_rounds(
        design, joint, stream, lambda drawn, _: {"": make(points_in_memory(points_of(drawn)))}
    )
    runs = join_rounds([each[""] for each in rounds], range(len(rounds)))
    return runs.assign_attrs({SAMPLING: str(design.sampling)})


def with_output(points: xr.Dataset, values: FloatArray, name: str = "y") -> xr.Dataset:
    """Return runs at points with an output; a run without a finite value has failed."""
    status = np.where(np.isfinite(values), Status.OK, Status.NOT_FINITE).astype(np.int8)
    output = (RUN, values, {"units": "1", ROLE: "output"})
    return points.assign({name: output, STATUS: (RUN, status)})
