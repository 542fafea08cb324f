"""Logarithmic scale of an output: whether its runs allow the one that a study asks for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.units import Scale
from uqpen.results.design_view import DesignView
from uqpen.results.digits import number_text, percent_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.texts import unit_suffix

__all__ = ["is_logarithmic", "linear_scale_note"]


def is_logarithmic(statistics: SourceStatistics, output: str) -> bool:
    """Check if an output is shown by its logarithm: asked for, and every run has one."""
    if not statistics.wants_logarithm(output):
        return False
    return all(values.min() > 0 for _, values in _completed_values(statistics, output))


def linear_scale_note(statistics: SourceStatistics, output: str, measure: Scale, unit: str) -> str:
    """Return why an output is not shown by its logarithm, as its study asks; else empty.

    Parameters
    ----------
    statistics : SourceStatistics
        Of the model.
    output : str
        Its name.
    measure, unit : Scale, str
        The unit that it is shown in.
    """
    if not statistics.wants_logarithm(output):
        return ""
    parts = []
    for design, values in _completed_values(statistics, output):
        if values.min() <= 0:
            view = DesignView(statistics.tree, design)
            values = view.completed_values(output) if view.shows_all_runs else values
            share = percent_text(float(f"{np.mean(values <= 0):.2g}"))
            smallest = f"{number_text(float(measure.from_si(values.min())))}{unit_suffix(unit)}"
            parts.append(f"{share} of the completed runs of {design} (the smallest is {smallest})")
    if not parts:
        return ""
    return (
        'the scale is linear, though the study asks for scale = "log": values at or below 0 have '
        f"no logarithm, and these are {' and '.join(parts)}"
    )


def _completed_values(
    statistics: SourceStatistics, output: str
) -> Iterator[tuple[str, FloatArray]]:
    """Yield the designs with values of an output, which are runs or equally spaced ranks of them.

    The first rank is the smallest run.
    """
    for design in statistics.sources:
        if statistics.kind(design) != "design":
            continue
        ranks = statistics.get(design, output, "cdf_value")
        view = DesignView(statistics.tree, design)
        if ranks is None and view.keeps_runs:
            values = view.completed_values(output)
        else:
            values = np.empty(0) if ranks is None else np.asarray(ranks.values)
        known = values[np.isfinite(values)]
        if known.size:
            yield design, known
