"""Figures of an archive: its results, drawn from the archive alone.

A figure is made of panels. Each member of the family takes the part of an archive that is asked
for, and yields the panels that this has something for; nothing is drawn before all are known.
"""

from __future__ import annotations

__all__ = ["FIGURES", "OF_BENCHMARKS"]

FIGURES = {
    "cdf": "uqpen.charts.distributions:cdf_charts",
    "exceedance": "uqpen.charts.distributions:exceedance_charts",
    "bounds": "uqpen.charts.distributions:bound_charts",
    "histogram": "uqpen.charts.histograms:histogram_charts",
    "scatter": "uqpen.charts.scatter:scatter_charts",
    "convergence": "uqpen.charts.convergence_history:convergence_charts",
    "methods": "uqpen.charts.source_comparison:source_charts",
    "sensitivity": "uqpen.charts.measures:sensitivity_charts",
    "responses": "uqpen.charts.measures:response_charts",
    "surrogate": "uqpen.charts.surrogate:surrogate_charts",
    "models": "uqpen.charts.distributions:model_charts",
    "sweep": "uqpen.charts.sweeps:sweep_charts",
    "measurements": "uqpen.charts.measured_values:measurement_charts",
    "posterior": "uqpen.charts.measured_values:posterior_charts",
    "fan": "uqpen.charts.curves:fan_charts",
    "model-curves": "uqpen.charts.curves:model_curve_charts",
    "sensitivity-along": "uqpen.charts.curves:driver_charts",
    "map": "uqpen.charts.curves:moment_maps",
    "trajectory": "uqpen.charts.trajectory:trajectory_charts",
    "velocity-profile": "uqpen.charts.trajectory:velocity_profile_chart",
    "losses": "uqpen.charts.failed_runs:failure_charts",
    "errors": "uqpen.charts.method_comparison:error_charts",
    "rates": "uqpen.charts.method_comparison:slope_charts",
    "coverage": "uqpen.charts.method_comparison:coverage_charts",
}

# Those of an archive of a benchmark of methods, which has no others.
OF_BENCHMARKS = ("errors", "rates", "coverage")
