"""What independent runs say of the figures of a surrogate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.interval_metadata import metadata_prefix, select_variable
from uqpen.archive.read import read_group
from uqpen.core.labels import (
    BOUND,
    CDFS,
    CHECKED,
    EXCEEDANCE,
    INTERVAL_LABEL,
    MOMENTS,
    NOTE,
    QUANTILES,
    REFUSED,
    SENSITIVITY,
    SHARES,
    STATUSES,
    TOLERANCE_LIMITS,
    UNCHECKED,
)
from uqpen.figures.archive_view import ArchiveView
from uqpen.report.blocks import Block, Remarks, Table, Text
from uqpen.results.digits import grouped_number
from uqpen.results.table import OutputTable, exceedance_label, quantile_label

__all__ = ["surrogate_validation"]

# Refusals that are listed at the most.
_MOST_LISTED = 12

# What is told of a surrogate, and what a person reads.
_GROUPS = {
    MOMENTS: "moments",
    QUANTILES: "quantiles",
    TOLERANCE_LIMITS: "values that hold",
    EXCEEDANCE: "probabilities of exceeding",
    CDFS: "distribution functions",
    SHARES: "shares of kinds",
    STATUSES: "probabilities of losses",
    SENSITIVITY: "measures of sensitivity",
}
_VERDICTS = (CHECKED, REFUSED, UNCHECKED)
# The same function, point by point; and what only says how heavy a tail is.
_NOT_COUNTED = ("_probability", "_effective_runs")


class _ValidatedEstimate(NamedTuple):
    """A figure of a surrogate, and the verdict on it."""

    group: str
    name: str
    verdict: str
    note: str


def surrogate_validation(view: ArchiveView, name: str) -> Iterator[Block]:
    """How many of its figures independent runs bear out, and which ones they contradict."""
    every = [each for kind in _GROUPS for each in _validated_estimates(view, kind, name)]
    if not every:
        return
    counts = {label: sum(each.verdict == label for each in every) for label in _VERDICTS}
    yield Text(
        f"Figure by figure, {name} was held against independent runs. Of "
        f"{grouped_number(len(every))}: "
        f"{grouped_number(counts[CHECKED])} checked, as the runs' own interval agrees; "
        f"{grouped_number(counts[REFUSED])} refused; {grouped_number(counts[UNCHECKED])} "
        "unchecked, as no "
        f"runs tell an interval."
    )
    refused = [f"{each.name}: {each.note}." for each in every if each.verdict == REFUSED]
    if refused:
        lines = refused[:_MOST_LISTED]
        if len(lines) < len(refused):
            lines.append(f"And {grouped_number(len(refused) - len(lines))} more.")
        yield Remarks("Refused", tuple(lines))
    yield Table(_validation_table(name, every), is_folded=True)


def _validated_estimates(view: ArchiveView, kind: str, name: str) -> Iterator[_ValidatedEstimate]:
    """The verdicts on the figures of a group; a distribution function is one figure."""
    dataset = read_group(view.tree, kind, name)
    for variable in map(str, dataset.data_vars):
        array = select_variable(dataset, variable)
        if BOUND not in array.dims or variable.endswith(_NOT_COUNTED):
            continue
        labels, notes = (_texts(array, what) for what in (INTERVAL_LABEL, NOTE))
        for place in np.ndindex(labels.shape):
            if labels[place] in _VERDICTS and np.isfinite(array.values[place][..., 0]).any():
                label = _estimate_name(array, variable, place)
                yield _ValidatedEstimate(kind, label, str(labels[place]), str(notes[place]))


def _texts(array: xr.DataArray, what: str) -> npt.NDArray[np.object_]:
    """What is said of each figure, or of all of them at once."""
    dimensions = [str(each) for each in array.dims if each != BOUND]
    prefix = metadata_prefix(str(array.name), dimensions, array.coords)
    said = array.coords[f"{prefix}_{what}"].values if prefix else array.attrs.get(what, "")
    return np.asarray(said, dtype=object)


def _estimate_name(array: xr.DataArray, variable: str, place: tuple[int, ...]) -> str:
    """What a figure is called in a list."""
    if variable.endswith("_band"):
        return f"distribution function of {variable.removesuffix('_band')}"
    entries = []
    for dimension, position in zip(array.dims, place, strict=False):
        entry = array[dimension].values.tolist()[position]
        if str(dimension).endswith("_probability"):
            entry = quantile_label(entry)
        elif str(dimension).endswith("_threshold"):
            entry = exceedance_label(entry)
        entries.append(str(entry))
    return ", ".join([str(array.attrs.get("long_name", variable)), *entries])


def _validation_table(name: str, every: list[_ValidatedEstimate]) -> OutputTable:
    """How many figures of each group there are, by verdict."""
    table = OutputTable(f"{name}: verdicts on its figures", list(_VERDICTS))
    for kind, label in _GROUPS.items():
        found = [each.verdict for each in every if each.group == kind]
        if found:
            table.rows.append(
                (label, [grouped_number(found.count(verdict)) for verdict in _VERDICTS])
            )
    return table
