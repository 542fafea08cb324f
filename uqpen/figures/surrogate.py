"""The predictions of a surrogate, compared with the runs of the model."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import REFUTED, RUN, RUNS, STATUS, SURROGATES
from uqpen.core.status import Status
from uqpen.figures.panel import Axes, Panel
from uqpen.figures.scatter import thin_runs
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.source_style import GREY
from uqpen.results.surrogate_tables import fit_diagnostics, fitted_outputs
from uqpen.results.texts import title_with_unit
from uqpen.surrogates.diagnostics import quality_text
from uqpen.surrogates.restoring import is_restorable, restore_surrogate

__all__ = ["fit_quality", "predict", "surrogate_panels", "test_design"]

_MOST_RUNS = 1000


def surrogate_panels(view: ArchiveView) -> Iterator[Panel]:
    """A surrogate's predictions, compared with runs of the model.

    The runs are its check runs or, without any, those that it was fitted to. Surrogates of the
    package and of installed ones are evaluated; no code of the archive is.
    """
    for name in group_names(view.tree, SURROGATES):
        made = view.tree.children[SURROGATES].children[name]
        design = test_design(view, made)
        is_hidden = view.source not in (None, name) or not is_restorable(made)
        if is_hidden or not view.design(design).has_completed_runs:
            continue
        for output in fitted_outputs(made):
            if output in view.numeric_outputs:
                title = view.title(f"{output} by {name}: {fit_quality(made, output)}")
                yield Panel(title, partial(_draw, view, name, design, output), height=3.0)


def test_design(view: ArchiveView, made: xr.DataTree) -> str:
    """The design that a surrogate is compared with: its check, or else its training runs."""
    check = str(made.attrs.get("check", ""))
    return check if check in view.designs else str(made.attrs["design"])


def _draw(view: ArchiveView, name: str, design: str, output: str, axes: Axes) -> Iterator[str]:
    made = view.tree.children[SURROGATES].children[name]
    runs = read_group(view.tree, RUNS, design)
    runs = runs.isel({RUN: np.flatnonzero(runs[STATUS].values == Status.OK)})
    shown = thin_runs(runs, _MOST_RUNS)
    truth = view.scale(output).from_si(shown[output].values)
    guess = view.scale(output).from_si(predict(made, name, shown, output))
    ends = np.array([min(truth.min(), guess.min()), max(truth.max(), guess.max())])
    axes.plot(ends, ends, color=GREY, linewidth=0.9, label="surrogate = model")
    axes.plot(truth, guess, ".", color=view.look(name).colour, markersize=2.5, alpha=0.6)
    axes.set_xlabel(title_with_unit("run of the model", view.unit(output)))
    axes.set_ylabel(title_with_unit("surrogate", view.unit(output)))
    is_fitted_to = design == str(made.attrs["design"])
    role = "its training runs" if is_fitted_to else "not training runs"
    counted = f"{grouped_number(shown.sizes[RUN])} of {grouped_number(runs.sizes[RUN])}"
    yield f"{name}: {counted} runs of {design}, {role}"


def predict(made: xr.DataTree, name: str, runs: xr.Dataset, output: str) -> np.ndarray:
    """Return a surrogate's predictions of runs, in SI; an `ArchiveError` if it is not whole."""
    model = restore_surrogate(made, name)
    try:
        inputs = {
            key: np.broadcast_to(runs[key].values, runs.sizes[RUN]) for key in model.random_inputs
        }
        return model.evaluate(inputs).outputs[output]
    except KeyError as error:
        raise ArchiveError(f"/{SURROGATES}/{name}: is damaged: {error} is missing") from None


def fit_quality(made: xr.DataTree, output: str) -> str:
    """Return the quality of the fit, as the surrogate's table has it."""
    attributes = fit_diagnostics(made, output)
    refuted = ", refuted" * (REFUTED in attributes)
    for of, key in (("check runs", "check_q2_of_output"), ("runs left out", "q2")):
        if np.isfinite(attributes.get(key, np.nan)):
            return f"Q² {quality_text(float(attributes[key]))} ({of}){refuted}"
    return f"Q² unknown{refuted}"
