"""Inputs with which the contract tests are made."""

from __future__ import annotations

from uqpen.core.model import Input
from uqpen.distributions.continuous import Normal, Uniform
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput

__all__ = ["example_joint_distribution"]


def example_joint_distribution() -> JointDistribution:
    """Return a joint distribution of two independent random inputs and a fixed one."""
    length, mass, share = Input("length", "m"), Input("mass", "kg"), Input("share", "1")
    entries = (
        RandomInput(length, Uniform(1.0, 3.0), "m"),
        FixedInput(mass, 5.0, "kg"),
        RandomInput(share, Normal(0.0, 1.0), "1"),
    )
    return JointDistribution(entries, (length, mass, share))
