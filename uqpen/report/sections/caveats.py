"""Caveats on all estimates of a design."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.archive.read import model_trees, read_group
from uqpen.core.labels import CONDITIONAL, DEPENDENCE, INTERVAL_LEVEL, MISSING, NOTE, RUN, RUNS
from uqpen.core.sampling import Sampling
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import status_counts
from uqpen.report.counting import percent_texts
from uqpen.report.sections.quoted_statistics import no_break
from uqpen.report.sections.view_statistics import sample_account, status_probability
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.texts import capitalized

__all__ = ["caveats"]

_GENERAL = (
    "An interval on this page covers the sampling error alone. It contains neither the error of "
    "the model nor that of the assumed distributions of the inputs.",
    "The confidence level is that of each interval by itself; all of them together are right less "
    "often. No interval can include a tail that is missing in the runs.",
)


def caveats(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield the caveats on the estimates of a design, a few sentences each."""
    accounts = sample_account(view, design)
    runs = read_group(view.tree, RUNS, design)
    if CONDITIONAL in accounts:
        yield _inadmissible_caveat(view, design, str(accounts[CONDITIONAL]))
    if MISSING in accounts:
        yield (
            f"{capitalized(str(accounts[MISSING]))} did not complete "
            f"({', '.join(_missing_run_counts(view, design))}). All estimates use the completed "
            "runs. If the others would have given different results, the estimates are biased."
        )
    if view.sampling(design) is Sampling.USER_SUPPLIED:
        yield (
            f"The points of {design} are the user's own. They are presumed to be a sample of the "
            "distribution of the inputs."
        )
    if dependence := str(runs.attrs.get(DEPENDENCE, "")):
        yield f"The inputs depend on each other, as the study says: {dependence}."
    yield from _measured_input_caveats(view, design)
    if view.model in ("", next(iter(model_trees(view.archive)))):
        yield from _GENERAL


def _missing_run_counts(view: ArchiveView, design: str) -> list[str]:
    """Return counts of failed runs of a design's sample by status, without inadmissible ones."""
    counts = status_counts(view.runs(design))
    left_out = (Status.OK, Status.INADMISSIBLE)
    return [
        f"{grouped_number(count)} {STATUS_TEXT[status]}"
        for status, count in counts.items()
        if count and status not in left_out
    ]


def _probability_text(array: xr.DataArray) -> str:
    value, lower, upper = (no_break(text) for text in percent_texts(*array.values))
    if np.isfinite(array.values).all():
        level = no_break(percent_text(array.attrs[INTERVAL_LEVEL]))
        return f"{value} ({lower} to {upper}, {level} interval)"
    return f"{value} (without an interval: {interval_text(array, NOTE)})"


def _inadmissible_caveat(view: ArchiveView, design: str, condition: str) -> str:
    runs = view.runs(design)
    count = status_counts(runs)[Status.INADMISSIBLE]
    some = f"{grouped_number(count)} of the {grouped_number(runs.sizes[RUN])} points of {design}"
    were = "was" if count == 1 else "were"
    probability = status_probability(view, design, Status.INADMISSIBLE)
    likely = ""
    if probability is not None:
        likely = f" The probability of this is {_probability_text(probability)}."
    return (
        f"{some} {were} inadmissible, so outside of what the model or the study allows.{likely} "
        f"All estimates are conditional on {condition}."
    )


def _measured_input_caveats(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield the inputs whose distributions come from measurements, which are uncertain."""
    measured = [
        f"{name} ({view.attributes(name)['fit_measurements']})"
        for name in view.random_inputs(design)
        if "fit_measurements" in view.attributes(name)
    ]
    if measured:
        yield (
            "Some distributions of inputs are fitted to measurements (in brackets the number of "
            f"these): {', '.join(measured)}. No interval includes the uncertainty of these fits."
        )
