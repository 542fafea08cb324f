"""Figures of an archive: what it holds, drawn from the archive alone.

A figure is made of panels. Each member of the family takes the part of an archive that is asked
for, and yields the panels that this has something for; nothing is drawn before all are known.
"""

from __future__ import annotations

__all__ = ["FIGURES"]

FIGURES = {
    "cdf": "uqpen.figures.distributions:cdf",
    "exceedance": "uqpen.figures.distributions:exceedance",
    "histogram": "uqpen.figures.histogram:histogram",
    "scatter": "uqpen.figures.scatter:scatter",
    "methods": "uqpen.figures.methods:methods",
    "sensitivity": "uqpen.figures.sensitivity:sensitivity",
    "responses": "uqpen.figures.responses:responses",
    "surrogate": "uqpen.figures.surrogate:surrogate",
    "models": "uqpen.figures.models:models",
    "trajectory": "uqpen.figures.trajectory:trajectory",
    "velocity-profile": "uqpen.figures.velocity_profile:velocity_profile",
    "losses": "uqpen.figures.losses:losses",
}
