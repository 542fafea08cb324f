"""What must be kept in mind with every answer of a design."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.analyses.sample import sample_of_law
from uqpen.archive.read import group, models_in
from uqpen.evaluation import status_counts
from uqpen.figures.part import Part
from uqpen.figures.texts import capitalized
from uqpen.labels import (
    CONDITIONAL,
    DEPENDENCE,
    INTERVAL_LEVEL,
    MISSING,
    NOTE,
    RUN,
    RUNS,
    STATUS_TEXT,
    STATUSES,
    Sampling,
    Status,
)
from uqpen.report.counting import in_percent
from uqpen.report.sections.quoted import unbroken
from uqpen.summary.digits import grouped, percent

__all__ = ["caveats"]

_GENERAL = (
    "An interval on this page tells the error of sampling alone: not how far the model is from "
    "reality, nor whether the inputs have the laws that the study assumes.",
    "Each of them holds by itself, at the level that it names; that all hold at once is less "
    "likely. A tail that no run has met cannot be seen in any.",
)


def caveats(part: Part, design: str) -> Iterator[str]:
    """What the answers of a design depend on, one sentence or two each.

    Parameters
    ----------
    part : Part
    design : str
        Whose runs are a sample of the input law.
    """
    accounts = group(part.tree, STATUSES, design)
    runs = group(part.tree, RUNS, design)
    if CONDITIONAL in accounts.attrs:
        yield _on_inadmissible(part, design, accounts)
    if MISSING in accounts.attrs:
        yield (
            f"{capitalized(str(accounts.attrs[MISSING]))} did not come back "
            f"({', '.join(_counted(part, design))}). All estimates are of those that did, and are "
            "off as far as the others would have given other results."
        )
    if part.sampling(design) is Sampling.GIVEN:
        yield (
            f"The points of {design} are the user's own; that they are a sample of the inputs' "
            "laws is taken for granted."
        )
    if told := str(runs.attrs.get(DEPENDENCE, "")):
        yield f"The inputs depend on each other, as the study says: {told}."
    yield from _on_measured(part, design)
    if part.model in ("", next(iter(models_in(part.archive)))):
        yield from _GENERAL


def _counted(part: Part, design: str) -> list[str]:
    """How many runs of a design's sample were lost to what, inadmissible ones left out."""
    counts = status_counts(sample_of_law(group(part.tree, RUNS, design)))
    left_out = (Status.OK, Status.INADMISSIBLE)
    return [
        f"{grouped(count)} {STATUS_TEXT[status]}"
        for status, count in counts.items()
        if count and status not in left_out
    ]


def _chance(array: xr.DataArray) -> str:
    """A probability in per cent, with its interval or the reason for none in brackets."""
    value, lower, upper = (unbroken(text) for text in in_percent(*array.values))
    if np.isfinite(array.values).all():
        level = unbroken(percent(array.attrs[INTERVAL_LEVEL]))
        return f"{value} ({lower} to {upper}, {level} interval)"
    return f"{value} (without an interval: {array.attrs.get(NOTE, '')})"


def _on_inadmissible(part: Part, design: str, accounts: xr.Dataset) -> str:
    runs = sample_of_law(group(part.tree, RUNS, design))
    count = status_counts(runs)[Status.INADMISSIBLE]
    some = f"{grouped(count)} of the {grouped(runs.sizes[RUN])} points of {design}"
    were = "was" if count == 1 else "were"
    told = accounts.get(Status.INADMISSIBLE.meaning)
    likely = "" if told is None else f", the probability of which is {_chance(told)}"
    return (
        f"{some} {were} inadmissible, so outside of what the model or the study allows{likely}. "
        f"All figures are conditional on {accounts.attrs[CONDITIONAL]}."
    )


def _on_measured(part: Part, design: str) -> Iterator[str]:
    """Inputs whose laws come from measurements, which are uncertain themselves."""
    measured = [
        f"{name} ({part.described(name)['fit_measurements']})"
        for name in part.random_inputs(design)
        if "fit_measurements" in part.described(name)
    ]
    if measured:
        yield (
            "Laws made of measurements, whose number stands in brackets, are taken as they came "
            f"out: {', '.join(measured)}. How uncertain they are is in no interval."
        )
