"""What a surrogate says of runs, against what the model said."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqpen.archive.read import group, names_in
from uqpen.errors import ArchiveError
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.scatter import thinned
from uqpen.figures.style import GREY
from uqpen.figures.texts import with_unit
from uqpen.labels import RUN, RUNS, STATUS, SURROGATES, Status
from uqpen.summary.digits import grouped
from uqpen.surrogates.restoring import from_dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["predicted", "quality", "surrogate", "tested_by"]

_MOST_RUNS = 1000


def surrogate(part: Part) -> Iterator[Panel]:
    """What a surrogate says of runs, against the model.

    They are its check runs or, without any, those that it was fitted to. Only polynomials out of
    the archive are evaluated, no model.
    """
    for name in names_in(part.tree, SURROGATES):
        made = group(part.tree, SURROGATES, name)
        design = tested_by(part, made)
        if part.source not in (None, name) or not part.came_back(design):
            continue
        for output in str(made.attrs["outputs"]).split():
            if output in part.numbers:
                title = part.titled(f"{output} by {name}: {quality(made, output)}")
                yield Panel(title, partial(_draw, part, name, design, output), height=3.0)


def tested_by(part: Part, made: xr.Dataset) -> str:
    """The design that a surrogate is compared with: its check, or that it was fitted to."""
    check = str(made.attrs.get("check", ""))
    return check if check in part.designs else str(made.attrs["design"])


def _draw(part: Part, name: str, design: str, output: str, axes: Axes) -> Iterator[str]:
    made = group(part.tree, SURROGATES, name)
    runs = group(part.tree, RUNS, design)
    runs = runs.isel({RUN: np.flatnonzero(runs[STATUS].values == Status.OK)})
    shown = thinned(runs, _MOST_RUNS)
    truth = part.measure(output).from_si(shown[output].values)
    guess = part.measure(output).from_si(predicted(made, name, shown, output))
    ends = np.array([min(truth.min(), guess.min()), max(truth.max(), guess.max())])
    colour = part.look(name).colour
    axes.plot(ends, ends, color=GREY, linewidth=0.9, label="surrogate = model")
    axes.plot(truth, guess, ".", color=colour, markersize=2.5, alpha=0.6)
    unit = part.unit(output)
    axes.set(xlabel=with_unit("run of the model", unit), ylabel=with_unit("surrogate", unit))
    is_fitted_to = design == str(made.attrs["design"])
    whose = "the very runs it was fitted to" if is_fitted_to else "which it was not fitted to"
    counted = f"{grouped(shown.sizes[RUN])} of {grouped(runs.sizes[RUN])}"
    yield f"{name}: {counted} runs of {design}, {whose}"


def predicted(made: xr.Dataset, name: str, runs: xr.Dataset, output: str) -> np.ndarray:
    """What a surrogate says of runs, in the SI unit of the output.

    Raises
    ------
    ArchiveError
        If the surrogate is not whole.
    """
    try:
        model = from_dataset(made, name)
    except (KeyError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ArchiveError(f"/{SURROGATES}/{name}: is damaged: {reason}") from None
    inputs = {key: np.broadcast_to(runs[key].values, runs.sizes[RUN]) for key in model.basis.names}
    return model.evaluate(inputs).outputs[output]


def quality(made: xr.Dataset, output: str) -> str:
    """How well it fits, as its table has it."""
    told = made[f"{output}_coefficient"].attrs
    for of, key in (("check runs", "check_q2_of_output"), ("runs left out", "q2")):
        if np.isfinite(told[key]):
            return f"Q² {float(told[key]):.5g} ({of})"
    return "Q² unknown"
