"""Panels of failed runs: their number by status, and their inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import INPUT, RUNS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import run_count, status_counts
from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_style import GREY, source_style
from uqpen.results.table import identity

__all__ = [
    "ASSOCIATIONS",
    "ASSOCIATION_SLOTS",
    "by_strength",
    "failed_run_counts",
    "failure_panels",
]

# The statistics of the inputs of failed runs, and their names in a legend.
ASSOCIATIONS = (("larger", "larger"), ("further_out", "further out"))
# Their places among colours and markers; those before are of the statuses of failed runs.
ASSOCIATION_SLOTS = (5, 6)


def failure_panels(view: ArchiveView) -> Iterator[Panel]:
    """Probability of each way to fail, and inputs of failed runs."""
    designs = [name for name in view.designs if view.source in (None, name)]
    failed = [design for design in designs if failed_run_counts(view, design)]
    if failed:
        title = view.title("failed runs")
        height = 0.9 + 0.3 * len(failed)
        yield Panel(title, partial(_draw_shares, view, failed), height, tuple(failed))
    for design in designs:
        failures = view.statistics.failures(design)
        associations = {name: failures[name] for name, _ in ASSOCIATIONS if name in failures}
        if any(np.isfinite(each.values[:, 0]).any() for each in associations.values()):
            associations = by_strength(associations)
            inputs = tuple(map(str, next(iter(associations.values()))[INPUT].values))
            title = view.title(f"{design}: inputs of failed runs")
            height = 0.9 + 0.3 * len(inputs)
            yield Panel(title, partial(_draw_associations, associations), height, inputs)


def by_strength(associations: Mapping[str, xr.DataArray]) -> dict[str, xr.DataArray]:
    """Return associations along ``input``, that of the strongest input first."""
    strengths = [np.nan_to_num(np.abs(a.values[:, 0] - 0.5)) for a in associations.values()]
    order = np.argsort(-np.max(strengths, axis=0), kind="stable")
    return {name: array[{INPUT: order}] for name, array in associations.items()}


def failed_run_counts(view: ArchiveView, design: str) -> dict[Status, int]:
    """Count the failed runs of a design by status, without statuses of no run."""
    counts = status_counts(read_group(view.tree, RUNS, design))
    return {status: n for status, n in counts.items() if n and status is not Status.OK}


def _draw_shares(view: ArchiveView, designs: list[str], axes: Axes) -> Iterator[str]:
    dots: list[EstimateDot] = []
    named: set[Status] = set()
    for row, design in enumerate(designs):
        probabilities = view.statistics.status_probabilities(design)
        failed = failed_run_counts(view, design)
        for number, (status, count) in enumerate(failed.items()):
            place = row + (number + 1) / (len(failed) + 1) - 0.5
            style = source_style(int(status) - 1)
            label = "" if status in named else STATUS_TEXT[status]
            named.add(status)
            if status.meaning in probabilities:
                estimate = probabilities[status.meaning]
                dots.append(EstimateDot.from_array(estimate, identity, place, style, label))
            else:
                share = count / run_count(read_group(view.tree, RUNS, design))
                alone = np.array([share, np.nan, np.nan])
                dots.append(EstimateDot(alone, place, style, label))
    axes.set_xlabel("probability of a failed run")
    yield from draw_dots(axes, dots)
    axes.set_xlim(left=0)


def _draw_associations(associations: Mapping[str, xr.DataArray], axes: Axes) -> Iterator[str]:
    axes.axvline(0.5, color=GREY, linewidth=0.8)
    dots = []
    for number, (name, label) in enumerate(ASSOCIATIONS):
        for row, chance in enumerate(associations.get(name, ())):
            if np.isfinite(chance.values[0]):
                place = row + 0.3 * (number - 0.5)
                style = source_style(ASSOCIATION_SLOTS[number])
                legend = "" if row else label
                dots.append(EstimateDot.from_array(chance, identity, place, style, legend))
    axes.set(xlabel="P(failed run's input is so)", xlim=(-0.02, 1.02))
    yield from draw_dots(axes, dots)
    yield "0.5: the input is not associated with failure"
