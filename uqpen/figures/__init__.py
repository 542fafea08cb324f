"""Figures of an archive: its results, drawn from the archive alone.

A figure is made of panels. Each member of the family takes the part of an archive that is asked
for, and yields the panels that this has something for; nothing is drawn before all are known.
"""

from __future__ import annotations

__all__ = ["BENCHMARK_FIGURES", "FIGURES"]

FIGURES = {
    "cdf": "uqpen.figures.distributions:cdf",
    "exceedance": "uqpen.figures.exceedance:exceedance",
    "histogram": "uqpen.figures.histogram:histogram",
    "scatter": "uqpen.figures.scatter:scatter_panels",
    "methods": "uqpen.charts.source_comparison:source_charts",
    "sensitivity": "uqpen.figures.sensitivity:sensitivity_panels",
    "responses": "uqpen.figures.sensitivity:response_panels",
    "surrogate": "uqpen.figures.surrogate:surrogate_panels",
    "models": "uqpen.figures.distributions:model_panels",
    "fan": "uqpen.figures.field_curves:fan_panels",
    "model-curves": "uqpen.figures.field_curves:model_curve_panels",
    "sensitivity-along": "uqpen.figures.field_sensitivity:sensitivity_along_panels",
    "map": "uqpen.figures.field_maps:map_panels",
    "trajectory": "uqpen.figures.trajectory:trajectory_panels",
    "velocity-profile": "uqpen.figures.velocity_profile:velocity_profile_panels",
    "losses": "uqpen.figures.failure_panels:failure_panels",
}

# Likewise of an archive of a benchmark of methods; these take the archive itself.
BENCHMARK_FIGURES = {
    "errors": "uqpen.figures.benchmark_panels:error_panels",
    "coverage": "uqpen.figures.benchmark_panels:coverage_panels",
}
