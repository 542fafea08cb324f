"""Notes of an archive, and the number of estimates with each."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE, UNLISTED_DIMENSIONS
from uqpen.core.labels import (
    BOUND,
    DIFFERENCES,
    MISSING,
    NOTE,
    RANK,
    RUNS,
    SURROGATES,
)
from uqpen.results.digits import count_text, grouped_number
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.texts import plain_text
from uqpen.surrogates.storage import unfitted_outputs

__all__ = ["archive_notes"]

# Distinct notes that are listed.
_MOST_NOTES = 20

# Diagnostics of other estimates, which have notes of their own.
_DIAGNOSES = (
    "kurtosis",
    "effective_runs",
    "effective_size",
    *(name for name in CATALOGUE if name.startswith("tail_")),
)
# Growing parts of the runs repeat the notes of the whole, and so do all percentiles.
_REPEATED = UNLISTED_DIMENSIONS - {RANK}
# Heavy tails are one warning, however heavy.
_NUMBERS = re.compile(r" \(kurtosis [^()]*\)")


def archive_notes(tree: xr.DataTree) -> tuple[str, ...]:
    """The distinct notes of an archive's estimates, the most frequent first, one line each."""
    counts: Counter[str] = Counter()
    for model in model_trees(tree).values():
        counts.update(_estimate_notes(SourceStatistics(model)))
        counts.update(_failure_notes(model))
    for name in group_names(tree, DIFFERENCES):
        counts.update(_estimate_notes(SourceStatistics.of_differences(tree, name)))
    first = counts.most_common(_MOST_NOTES)
    lines = [_note_line(note, count) for note, count in first]
    if more := counts.total() - sum(count for _, count in first):
        lines.append(f"{grouped_number(more)} more estimates have other notes.")
    return (*_model_notes(tree), *lines)


def _estimate_notes(statistics: SourceStatistics) -> Iterator[str]:
    # A published estimate has no interval, and its own note on that.
    sources = [name for name in statistics.sources if not statistics.citation(name)]
    outputs = statistics.scalar_outputs
    every = [statistics.statistics(source, output) for source in sources for output in outputs]
    counted = [
        each
        for each in CATALOGUE.values()
        if each.name not in _DIAGNOSES and _REPEATED.isdisjoint(each.dims)
    ]
    for arrays in every:
        for each in counted:
            if each.name in arrays:
                yield from _notes(arrays[each.name], is_whole=each.is_function)


def _failure_notes(model: xr.DataTree) -> Iterator[str]:
    statistics = SourceStatistics(model)
    found = [statistics.failures(source) for source in statistics.sources]
    for name in ("probability", "larger", "further_out"):
        for arrays in found:
            if name in arrays:
                yield from _notes(arrays[name])


def _notes(array: xr.DataArray, *, is_whole: bool = False) -> Iterator[str]:
    """Yield the notes of an array's entries, or of the whole once."""
    if BOUND not in array.dims:
        return
    notes = np.ravel(array.coords[NOTE].values).tolist()
    for note in filter(None, notes[: 1 if is_whole else None]):
        yield _NUMBERS.sub("", note)


def _note_line(note: str, count: int) -> str:
    return f"{count_text(count, 'estimate')}: {plain_text(note, 240)}"


def _model_notes(tree: xr.DataTree) -> Iterator[str]:
    """Yield missing runs, surrogates that are not fitted, and distributions that do not fit."""
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        statistics = SourceStatistics(model)
        for design in statistics.sources:
            ends = statistics.failures(design).get("probability")
            if ends is not None and (missing := ends.attrs.get(MISSING)):
                yield f"{head}{design}: {missing} did not complete."
        for surrogate in group_names(model, SURROGATES):
            group = model.children[SURROGATES].children[surrogate]
            for output, reason in unfitted_outputs(group).items():
                reason_text = plain_text(reason, 240)
                yield f"{head}{surrogate} is not fitted to {output}: {reason_text}."
        yield from dict.fromkeys(f"{head}{text}" for text in _rejected_fits(model))


def _rejected_fits(model: xr.DataTree) -> Iterator[str]:
    for design in group_names(model, RUNS):
        for name, variable in read_group(model, RUNS, design).variables.items():
            if "fit_warning" in variable.attrs:
                yield f"{name}: {plain_text(str(variable.attrs['fit_warning']), 240)}."
