"""What an archive warns of anywhere: notes of its figures, and how many bear each."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.interval_metadata import metadata_prefix
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.labels import (
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
from uqpen.figures.texts import plain_text
from uqpen.results.digits import grouped_number

__all__ = ["archive_notes"]

# Distinct notes that are listed.
_MOST_NOTES = 20

# Groups whose figures stand in others, too, or are none.
_SKIPPED_GROUPS = ("comparison", "trajectory", "files", RUNS)
# These tell of other figures, and have notes that say so.
_DIAGNOSES = ("_kurtosis", "_effective_runs")
# Heavy tails are one warning, however heavy.
_NUMBERS = re.compile(r" \(kurtosis [^()]*\)")
_NOT_FITTED = "_not_fitted"


def archive_notes(tree: xr.DataTree) -> tuple[str, ...]:
    """The distinct notes of an archive's figures, the most frequent first, one line each.

    Parameters
    ----------
    tree : DataTree
        The whole archive.
    """
    counts: Counter[tuple[str, str]] = Counter()
    for node in tree.subtree:
        # What is published elsewhere has no interval, and says so in its place.
        if not set(node.path.split("/")) & set(_SKIPPED_GROUPS) and "source" not in node.attrs:
            counts.update(_group_notes(node.to_dataset(inherit=False)))
    first = counts.most_common(_MOST_NOTES)
    lines = [_note_line(label, note, count) for (label, note), count in first]
    if more := counts.total() - sum(count for _, count in first):
        lines.append(f"{grouped_number(more)} more figures bear other notes.")
    return (*_model_notes(tree), *lines)


def _group_notes(dataset: xr.Dataset) -> Iterator[tuple[str, str]]:
    """The verdict and note of each figure that bears a warning."""
    # Arrays with their coordinates take long to put together where outputs are many.
    for key, variable in dataset.variables.items():
        if key in dataset.coords or BOUND not in variable.dims or str(key).endswith(_DIAGNOSES):
            continue
        labels, notes = _labels_and_notes(dataset, str(key))
        for label, note in zip(labels, notes, strict=True):
            if note and label != CHECKED:
                yield label if label in (REFUSED, UNCHECKED) else "", _NUMBERS.sub("", note)


def _labels_and_notes(dataset: xr.Dataset, name: str) -> tuple[list[str], list[str]]:
    """The labels and the notes of a variable's figures."""
    variable = dataset.variables[name]
    prefix = metadata_prefix(name, [str(dimension) for dimension in variable.dims], dataset.coords)
    if not prefix:
        return [str(variable.attrs.get(INTERVAL_LABEL, ""))], [str(variable.attrs.get(NOTE, ""))]
    labels, notes = (
        [str(text) for text in np.ravel(dataset.variables[f"{prefix}_{what}"].values)]
        for what in (INTERVAL_LABEL, NOTE)
    )
    return labels, notes


def _note_line(label: str, note: str, count: int) -> str:
    count_text = "1 figure" if count == 1 else f"{grouped_number(count)} figures"
    verdict = f"{label}: " if label else ""
    return f"{count_text}: {verdict}{plain_text(note, 240)}"


def _model_notes(tree: xr.DataTree) -> Iterator[str]:
    """Runs that are missing, surrogates that could not be fitted, laws that do not fit."""
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        for design in group_names(model, STATUSES):
            if missing := read_group(model, STATUSES, design).attrs.get("missing"):
                yield f"{head}{design}: {missing} did not come back."
        for surrogate in group_names(model, SURROGATES):
            for key, reason in read_group(model, SURROGATES, surrogate).attrs.items():
                if str(key).endswith(_NOT_FITTED):
                    output = str(key).removesuffix(_NOT_FITTED)
                    yield (
                        f"{head}{surrogate} is not fitted to {output}: "
                        f"{plain_text(str(reason), 240)}."
                    )
        for text in dict.fromkeys(_rejected_fits(model)):
            yield f"{head}{text}"


def _rejected_fits(model: xr.DataTree) -> Iterator[str]:
    for design in group_names(model, RUNS):
        for name, variable in read_group(model, RUNS, design).variables.items():
            if "fit_warning" in variable.attrs:
                yield f"{name}: {plain_text(str(variable.attrs['fit_warning']), 240)}."
