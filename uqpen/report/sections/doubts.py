"""What an archive warns of anywhere: notes of its figures, and how many bear each."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group, models_in, names_in
from uqpen.archive.told import stem
from uqpen.figures.texts import plain
from uqpen.labels import (
    BOUND,
    CHECKED,
    INTERVAL_LABEL,
    NOTE,
    REFUSED,
    RUNS,
    STATUSES,
    SURROGATES,
    UNCHECKED,
)
from uqpen.summary.digits import grouped

__all__ = ["doubts"]

# Distinct notes that are listed.
_MOST_NOTES = 20

# Groups whose figures stand in others, too, or are none.
_PASSED_OVER = ("comparison", "trajectory", "files", RUNS)
# These tell of other figures, and have notes that say so.
_DIAGNOSES = ("_kurtosis", "_effective_runs")
# Heavy tails are one warning, however heavy.
_NUMBERS = re.compile(r" \(kurtosis [^()]*\)")
_NOT_FITTED = "_not_fitted"


def doubts(tree: xr.DataTree) -> tuple[str, ...]:
    """The distinct notes of an archive's figures, the most frequent first, one line each.

    Parameters
    ----------
    tree : DataTree
        The whole archive.
    """
    counts: Counter[tuple[str, str]] = Counter()
    for node in tree.subtree:
        # What is published elsewhere has no interval, and says so in its place.
        if not set(node.path.split("/")) & set(_PASSED_OVER) and "source" not in node.attrs:
            counts.update(_notes(node.to_dataset(inherit=False)))
    first = counts.most_common(_MOST_NOTES)
    lines = [_line(label, note, count) for (label, note), count in first]
    if more := counts.total() - sum(count for _, count in first):
        lines.append(f"{grouped(more)} more figures bear other notes.")
    return (*_of_models(tree), *lines)


def _notes(figures: xr.Dataset) -> Iterator[tuple[str, str]]:
    """The verdict and note of each figure that bears a warning."""
    # Arrays with their coordinates take long to put together where outputs are many.
    for key, variable in figures.variables.items():
        if key in figures.coords or BOUND not in variable.dims or str(key).endswith(_DIAGNOSES):
            continue
        labels, notes = _told(figures, str(key))
        for label, note in zip(labels, notes, strict=True):
            if note and label != CHECKED:
                yield label if label in (REFUSED, UNCHECKED) else "", _NUMBERS.sub("", note)


def _told(figures: xr.Dataset, name: str) -> tuple[list[str], list[str]]:
    """The labels and the notes of a variable's figures."""
    variable = figures.variables[name]
    called = stem(name, [str(dimension) for dimension in variable.dims], figures.coords)
    if not called:
        return [str(variable.attrs.get(INTERVAL_LABEL, ""))], [str(variable.attrs.get(NOTE, ""))]
    labels, notes = (
        [str(text) for text in np.ravel(figures.variables[f"{called}_{what}"].values)]
        for what in (INTERVAL_LABEL, NOTE)
    )
    return labels, notes


def _line(label: str, note: str, count: int) -> str:
    figures = "1 figure" if count == 1 else f"{grouped(count)} figures"
    verdict = f"{label}: " if label else ""
    return f"{figures}: {verdict}{plain(note, 240)}"


def _of_models(tree: xr.DataTree) -> Iterator[str]:
    """Runs that are missing, surrogates that could not be fitted, laws that do not fit."""
    for name, model in models_in(tree).items():
        head = f"{name}: " if name else ""
        for design in names_in(model, STATUSES):
            if missing := group(model, STATUSES, design).attrs.get("missing"):
                yield f"{head}{design}: {missing} did not come back."
        for surrogate in names_in(model, SURROGATES):
            for key, reason in group(model, SURROGATES, surrogate).attrs.items():
                if str(key).endswith(_NOT_FITTED):
                    output = str(key).removesuffix(_NOT_FITTED)
                    yield f"{head}{surrogate} is not fitted to {output}: {plain(str(reason), 240)}."
        for text in dict.fromkeys(_bad_laws(model)):
            yield f"{head}{text}"


def _bad_laws(model: xr.DataTree) -> Iterator[str]:
    for design in names_in(model, RUNS):
        for name, variable in group(model, RUNS, design).variables.items():
            if "fit_warning" in variable.attrs:
                yield f"{name}: {plain(str(variable.attrs['fit_warning']), 240)}."
