"""Validation of a surrogate's estimates by independent runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE, LOWER_THRESHOLD, PROBABILITY, THRESHOLD
from uqpen.core.labels import (
    CHECKED,
    INTERVAL_LABEL,
    NOT_COMPARABLE,
    NOTE,
    REFUSED,
    UNCHECKED,
    VERDICTS,
)
from uqpen.report.blocks import Block, Remarks, Table, Text
from uqpen.report.sections.view_statistics import STATISTIC_FAMILIES, failure_probabilities
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.table import OutputTable, below_label, exceedance_label, quantile_label

__all__ = ["surrogate_validation", "verdict_counts"]

# Refusals that are listed at the most.
_MOST_LISTED = 12

_LOSSES, _SENSITIVITY = "probabilities of failure", "measures of sensitivity"
# Families of a surrogate's estimates, by their names in the table.
_FAMILIES = (
    *(family for family in STATISTIC_FAMILIES if family != _SENSITIVITY),
    _LOSSES,
    _SENSITIVITY,
)
_MEANINGS = {
    CHECKED: "checked: inside the intervals of the runs",
    REFUSED: "refused: outside the interval of some runs",
    UNCHECKED: "unchecked: no runs decide",
}
# The same function point by point, and a measure of heavy tails.
_NOT_COUNTED = ("cdf", "effective_runs")


class _ValidatedEstimate(NamedTuple):
    """An estimate of a surrogate, and the verdict on it."""

    family: str
    name: str
    verdict: str
    note: str


def surrogate_validation(view: ArchiveView, name: str) -> Iterator[Block]:
    """Yield the number of estimates that validation runs confirm, and those they contradict."""
    every = _validated_estimates(view, name)
    if not every:
        return
    yield Text(_counts_text(name, every))
    lines = [f"{each.name}: {each.note}." for each in every if each.verdict == REFUSED]
    if more := lines[_MOST_LISTED:]:
        lines[_MOST_LISTED:] = [f"And {grouped_number(len(more))} more."]
    if lines:
        yield Remarks("Refused", tuple(lines))
    yield Table(_validation_table(name, every), is_folded=True)


def _counts_text(name: str, every: Sequence[_ValidatedEstimate]) -> str:
    """Return the sentences on the number of estimates with each verdict."""
    counts = Counter(each.verdict for each in every)
    sentences = [
        f"{grouped_number(len(every))} estimates by {name} were compared with independent runs.",
        *(f"{grouped_number(counts[label])} are {text}." for label, text in _MEANINGS.items()),
    ]
    if lacking := counts[NOT_COMPARABLE]:
        sentences.append(
            f"{grouped_number(lacking)} are not comparable: failed runs are missing from the "
            "independent runs, but not from the surrogate."
        )
    return " ".join(sentences)


def verdict_counts(view: ArchiveView, name: str) -> Counter[str]:
    """Return the number of a surrogate's estimates with each verdict."""
    return Counter(each.verdict for each in _validated_estimates(view, name))


def _validated_estimates(view: ArchiveView, name: str) -> list[_ValidatedEstimate]:
    statistics = view.statistics
    found = {output: statistics.statistics(name, output) for output in statistics.scalar_outputs}
    return [
        each
        for family in _FAMILIES
        for each in (
            _failure_rows(view, name) if family == _LOSSES else _family_verdicts(family, found)
        )
    ]


def _failure_rows(view: ArchiveView, name: str) -> Iterator[_ValidatedEstimate]:
    ends = failure_probabilities(view, name)
    if ends is not None:
        yield from _verdicts(_LOSSES, ends, "")


def _family_verdicts(
    family: str, found: Mapping[str, Mapping[str, xr.DataArray]]
) -> Iterator[_ValidatedEstimate]:
    """Yield the verdicts on the estimates of a family, given all arrays by output and name."""
    names = [each for each in STATISTIC_FAMILIES[family] if each not in _NOT_COUNTED]
    for output, arrays in found.items():
        for name in names:
            if name in arrays:
                is_function = CATALOGUE[name].is_function
                title = f"distribution function of {output}" * is_function
                yield from _verdicts(family, arrays[name], title)


def _verdicts(family: str, array: xr.DataArray, title: str) -> Iterator[_ValidatedEstimate]:
    """Yield the verdict on each entry, or on an array with a title as a whole."""
    labels, notes = (array.coords[text].values for text in (INTERVAL_LABEL, NOTE))
    for place in [(0,) * labels.ndim] if title else np.ndindex(labels.shape):
        estimates = array.values[..., 0] if title else array.values[place][..., 0]
        if labels[place] in VERDICTS and np.isfinite(estimates).any():
            label = title or _estimate_name(array, place)
            yield _ValidatedEstimate(family, label, str(labels[place]), str(notes[place]))


def _estimate_name(array: xr.DataArray, place: tuple[int, ...]) -> str:
    entries = []
    for dimension, position in zip(array.dims, place, strict=False):
        entry = array[dimension].values.tolist()[position]
        if dimension == PROBABILITY:
            entry = quantile_label(entry)
        elif dimension == THRESHOLD:
            entry = exceedance_label(entry)
        elif dimension == LOWER_THRESHOLD:
            entry = below_label(entry)
        entries.append(str(entry))
    return ", ".join([str(array.attrs["long_name"]), *entries])


def _validation_table(name: str, every: list[_ValidatedEstimate]) -> OutputTable:
    table = OutputTable(f"{name}: verdicts on its estimates", list(VERDICTS))
    for family in _FAMILIES:
        found = [each.verdict for each in every if each.family == family]
        if found:
            table.rows.append(
                (family, [grouped_number(found.count(verdict)) for verdict in VERDICTS])
            )
    return table
