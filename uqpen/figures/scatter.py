"""Each output against each input, run by run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.figures.curves import span
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.style import VERMILION
from uqpen.figures.texts import plain
from uqpen.labels import RUN, STATUS, Status
from uqpen.streams import Stream
from uqpen.summary.digits import grouped

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["jittered", "kinds_of", "scatter", "thinned"]

FloatArray = npt.NDArray[np.float64]

# Runs that are drawn in a panel at the most, and in all panels together.
_MOST_RUNS, _MOST_IN_ALL = 1000, 8000
_MOST_LOST = 100
_FEWEST_RUNS = 250


def scatter(part: Part) -> Iterator[Panel]:
    """Runs of one design: each output against each input."""
    design = next(iter(part.samples), None)
    if design is None:
        return
    inputs = part.random_inputs(design)
    outputs = [*part.numbers, *part.kinds]
    panels = max(1, len(inputs) * len(outputs))
    every = part.runs(design)
    is_ok = every[STATUS].values == Status.OK
    most = max(_FEWEST_RUNS, min(_MOST_RUNS, _MOST_IN_ALL // panels))
    ok, lost = (every.isel({RUN: np.flatnonzero(which)}) for which in (is_ok, ~is_ok))
    parts = (thinned(ok, most), thinned(lost, _MOST_LOST))
    told = "; ".join(
        f"{grouped(some.sizes[RUN])} of {grouped(whole.sizes[RUN])} runs {what}"
        for some, whole, what in zip(parts, (ok, lost), ("that came back", "lost"), strict=True)
        if whole.sizes[RUN]
    )
    told = f"drawn of {design}: {told}"
    colour = part.look(design).colour
    for output in outputs:
        for name in inputs:
            title = part.titled(f"{output}, {name}")
            yield Panel(
                title, partial(_draw, part, name, output, parts, colour, told), 2.2, group=output
            )


def thinned(runs: xr.Dataset, most: int) -> xr.Dataset:
    """Some of the runs, the same ones each time; in order, as a table's need not be at random."""
    size = runs.sizes[RUN]
    if size <= most:
        return runs
    chosen = Stream(0, "figures", "runs").generator().choice(size, most, replace=False)
    return runs.isel({RUN: np.sort(chosen)})


def _draw(
    part: Part,
    name: str,
    output: str,
    runs: tuple[xr.Dataset, xr.Dataset],
    colour: str,
    told: str,
    axes: Axes,
) -> Iterator[str]:
    ok, lost = runs
    x, x_lost = (part.measure(name).from_si(each[name].values) for each in runs)
    y = _heights(axes, part, output, ok)
    axes.plot(x, y, ".", color=colour, markersize=2.2, alpha=0.6)
    axes.set(xlabel=part.axis(name), ylabel=part.axis(output))
    if not ok.sizes[RUN]:
        axes.set_yticks([])
    elif output in part.numbers:
        lower, upper, is_cut = span([y])
        axes.set_ylim(lower, upper)
        if is_cut:
            yield "axes of outputs end where all but 1 % lies inside"
    if lost.sizes[RUN]:
        axes.plot(
            x_lost,
            np.full(x_lost.size, 0.02),
            "x",
            color=VERMILION,
            markersize=4,
            transform=axes.get_xaxis_transform(),
            label="lost runs, at the foot",
            clip_on=False,
        )
    yield told


def _heights(axes: Axes, part: Part, output: str, runs: xr.Dataset) -> FloatArray:
    """Where each run stands; those of one kind beside each other, so that they can be seen."""
    if output in part.numbers:
        heights: FloatArray = part.measure(output).from_si(runs[output].values)
        return heights
    kinds = kinds_of(runs[output])
    axes.set_yticks(range(len(kinds)), [plain(label, 20) for label in kinds.values()])
    axes.set_ylim(-0.6, len(kinds) - 0.4)
    return jittered(runs[output].values, kinds)


def kinds_of(output: xr.DataArray) -> dict[int, str]:
    """What the kinds of an output are called, by their codes; not that of lost runs."""
    told: dict[Any, Any] = dict(output.attrs)
    codes = np.asarray(told["flag_values"]).tolist()
    labels = map(str, np.atleast_1d(told.get("flag_labels", told["flag_meanings"].split())))
    return {code: label for code, label in zip(codes, labels, strict=True) if label != "lost"}


def jittered(codes: npt.NDArray[np.integer], kinds: Iterable[int]) -> FloatArray:
    """The row of each run's kind, and up to a quarter beside it, so that many can be seen."""
    row_of = {code: row for row, code in enumerate(kinds)}
    rows = np.array([row_of.get(code, np.nan) for code in codes.tolist()])
    golden = (np.arange(rows.size) * 0.6180339887498949) % 1
    return rows + 0.5 * (golden - 0.5)
