"""Inputs, an output and runs with which the contract tests are made."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Input, Output
from uqpen.core.status import Status
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal, Uniform
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["EXAMPLE_OUTPUT", "example_joint_distribution", "sum_runs"]

# The output that an adaptive design and a stopping rule are sent.
EXAMPLE_OUTPUT = QuantityOfInterest(Output("y", "1"), "1")


def example_joint_distribution() -> JointDistribution:
    """Return a joint distribution of two independent random inputs and a fixed one."""
    length, mass, share = Input("length", "m"), Input("mass", "kg"), Input("share", "1")
    entries = (
        RandomInput(length, Uniform(1.0, 3.0), "m"),
        FixedInput(mass, 5.0, "kg"),
        RandomInput(share, Normal(0.0, 1.0), "1"),
    )
    return JointDistribution(entries, (length, mass, share))


def sum_runs(points: xr.Dataset, joint: JointDistribution, output: str) -> xr.Dataset:
    """Return runs of a model whose output is the sum of the random inputs."""
    total = sum(points[entry.variable.name] for entry in joint.random)
    status = np.full(points.sizes[RUN], Status.OK, dtype=np.int8)
    return points.assign({output: total, STATUS: (RUN, status)})
