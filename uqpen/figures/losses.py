"""How many runs were lost, to what, and where among the inputs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqpen.analyses.where_lost import LOSSES
from uqpen.archive.read import group, names_in
from uqpen.evaluation import status_counts
from uqpen.figures.estimates import Dot, draw_dots
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.style import GREY, look
from uqpen.labels import INPUT, RUN, RUNS, STATUS_TEXT, STATUSES, Status
from uqpen.summary.table import unchanged

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["CHANCES", "losses", "lost_of"]

# What is told of the inputs of lost runs, and what a person reads.
CHANCES = (("larger", "larger"), ("further_out", "further out"))


def losses(part: Part) -> Iterator[Panel]:
    """Runs lost to what, and which inputs go with that."""
    designs = [name for name in part.designs if part.source in (None, name)]
    lost = [design for design in designs if lost_of(part, design)]
    if lost:
        title = part.titled("runs that were lost")
        height = 0.9 + 0.3 * len(lost)
        yield Panel(title, partial(_draw_shares, part, lost), height, tuple(lost))
    for design in designs:
        if design in names_in(part.tree, LOSSES):
            told = group(part.tree, LOSSES, design)
            if not any(np.isfinite(told[name].values[:, 0]).any() for name, _ in CHANCES):
                continue
            inputs = tuple(map(str, told[INPUT].values))
            title = part.titled(f"{design}: inputs of lost runs")
            height = 0.9 + 0.3 * len(inputs)
            yield Panel(title, partial(_draw_places, told), height, inputs)


def lost_of(part: Part, design: str) -> dict[Status, int]:
    """How many runs of a design were lost in which way; only ways that some were."""
    counts = status_counts(group(part.tree, RUNS, design))
    return {status: n for status, n in counts.items() if n and status is not Status.OK}


def _draw_shares(part: Part, designs: list[str], axes: Axes) -> Iterator[str]:
    dots: list[Dot] = []
    named: set[Status] = set()
    for row, design in enumerate(designs):
        told = group(part.tree, STATUSES, design)
        lost = lost_of(part, design)
        for number, (status, count) in enumerate(lost.items()):
            share = count / group(part.tree, RUNS, design).sizes[RUN]
            known = told.get(status.meaning)
            place = row + (number + 1) / (len(lost) + 1) - 0.5
            label = "" if status in named else STATUS_TEXT[status]
            named.add(status)
            appearance = look(int(status) - 1)
            if known is None:
                alone = np.array([share, np.nan, np.nan])
                dots.append(Dot(alone, place, appearance, label))
            else:
                dots.append(Dot.of(known, unchanged, place, appearance, label))
    axes.set_xlabel("probability of losing a run")
    yield from draw_dots(axes, dots)
    axes.set_xlim(left=0)


def _draw_places(told: xr.Dataset, axes: Axes) -> Iterator[str]:
    axes.axvline(0.5, color=GREY, linewidth=0.8)
    dots = []
    for number, (name, label) in enumerate(CHANCES):
        for row, chance in enumerate(told[name]):
            if np.isfinite(chance.values[0]):
                place = row + 0.3 * (number - 0.5)
                dots.append(Dot.of(chance, unchanged, place, look(number), "" if row else label))
    axes.set(xlabel="P(a lost run's input is so)", xlim=(-0.02, 1.02))
    yield from draw_dots(axes, dots)
    yield "0.5: the input does not go with the losses"
