"""What the figures of an archive lie along, and of what type all is that is told of them.

Declared by names, and the same wherever a group of statistics stands: of a study's only model, of
one of several, of their differences, of a reference.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.interval_metadata import interval_metadata
from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    CONDITIONAL,
    EXCEEDANCE,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    LARGEST_CONTRIBUTION,
    MISSING,
    MOMENTS,
    NOTE,
    PAIR,
    QUANTILES,
    ROLE,
    RUNS_SPENT,
    SENSITIVITY,
    SHARES,
    STATUSES,
    TOLERANCE_LIMITS,
)
from uqpen.core.units import scale

__all__ = ["find_attribute_faults", "find_estimate_faults", "find_reference_faults", "has_kind"]

# What the figures of a group lie along before their bounds: how the dimension's name goes on after
# that of the variable.
_ENTRIES = {
    MOMENTS: "",
    STATUSES: "",
    QUANTILES: "probability",
    TOLERANCE_LIMITS: "hold",
    EXCEEDANCE: "threshold",
    SHARES: "category",
    SENSITIVITY: "",
}
# What else stands along it.
_COMPANIONS = {"hold": ("runs_needed", "count"), "category": ("label", "text")}
# Of an event's measures of sensitivity: what the event is one of.
_EVENT_INDICES = re.compile(r"(.+)_(?:exceedance|(category))_(?:first_order|total_order|shapley)\Z")
_SECOND_ORDER = re.compile(r".+_second_order\Z")

# What an attribute of some name is, wherever it stands.
_ATTRIBUTES = {
    **dict.fromkeys(
        (INTERVAL, INTERVAL_LABEL, NOTE, ROLE, CONDITIONAL, MISSING, "units", "display_units"),
        "text",
    ),
    **dict.fromkeys(("source", "minus", "outputs", "check", "flag_meanings"), "text"),
    **dict.fromkeys((RUNS_SPENT, "runs", "runs_used", "repeats", "reference_runs"), "count"),
    **dict.fromkeys(("order", "terms", "q2", "check_q2_of_output"), "number"),
}
_TEXT_SUFFIXES = (f"_{LARGEST_CONTRIBUTION}", "_not_fitted")

_KINDS = {"text": "OUS", "count": "iu", "number": "iuf"}


def has_kind(values: npt.ArrayLike, kind: str) -> bool:
    """Whether values are texts, counts or numbers."""
    return np.asarray(values).dtype.kind in _KINDS[kind]


def find_attribute_faults(tree: xr.DataTree) -> Iterator[str]:
    """Attributes that are not of the type that their name tells of."""
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        owners: dict[str, Mapping[Any, Any]] = {node.path: dataset.attrs}
        owners |= {f"{node.path}/{key}": v.attrs for key, v in dataset.variables.items()}
        for place, attributes in owners.items():
            for name, value in attributes.items():
                is_text = str(name).endswith(_TEXT_SUFFIXES)
                kind = "text" if is_text else _ATTRIBUTES.get(str(name))
                if kind and not (np.ndim(value) == 0 and has_kind(value, kind)):
                    yield f"{place}: {name} is no {kind}"
            if not _is_unit(attributes.get("display_units", "1")):
                yield f"{place}: display_units that are no unit"


def _is_unit(text: object) -> bool:
    try:
        scale(str(text))
    except QuantityError:
        return False
    return True


def find_estimate_faults(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with the figures of a model, or of a pair of models.

    Parameters
    ----------
    tree : DataTree
        With groups of statistics, in each of which there is a group for each source.
    """
    entries: dict[str, list[Any]] = {}
    for kind in _ENTRIES:
        sources = tree.children[kind].children if kind in tree.children else {}
        for source, node in sources.items():
            dataset = node.to_dataset(inherit=False)
            for fault in _group_faults(kind, dataset, entries):
                yield f"/{kind}/{source}: {fault}"


def find_reference_faults(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with the figures of a reference, of which there is only one source."""
    entries: dict[str, list[Any]] = {}
    for kind in _ENTRIES:
        if kind in tree.children:
            dataset = tree.children[kind].to_dataset(inherit=False)
            for fault in _group_faults(kind, dataset, entries):
                yield f"/{kind}: {fault}"


def _group_faults(kind: str, dataset: xr.Dataset, entries: dict[str, list[Any]]) -> Iterator[str]:
    """What is wrong with the figures of one source, whose `entries` are those of all others."""
    for key, variable in dataset.data_vars.items():
        name = str(key)
        along = _expected_dimensions(kind, name)
        if variable.dims != (*along, BOUND) or not has_kind(variable, "number"):
            yield f"{name} is not of figures along {', '.join((*along, BOUND))}"
        elif not _is_bounded(variable):
            yield f"{name}: not the bounds of an estimate"
        elif not interval_metadata(variable, INTERVAL_LABEL):
            yield f"{name}: does not say how its interval was made"
        else:
            for dimension in along:
                yield from _coordinate_faults(dataset, dimension, entries)


def _expected_dimensions(kind: str, name: str) -> tuple[str, ...]:
    """What a figure lies along before its bounds."""
    if kind != SENSITIVITY:
        return (f"{name}_{_ENTRIES[kind]}",) if _ENTRIES[kind] else ()
    if event := _EVENT_INDICES.match(name):
        return (f"{event[1]}_{event[2] or 'threshold'}", INPUT)
    return (PAIR,) if _SECOND_ORDER.match(name) else (INPUT,)


def _is_bounded(variable: xr.DataArray) -> bool:
    return BOUND in variable.coords and variable[BOUND].values.tolist() == list(BOUNDS)


def _coordinate_faults(
    dataset: xr.Dataset, dimension: str, entries: dict[str, list[Any]]
) -> Iterator[str]:
    what = dimension.rpartition("_")[2]
    kind = "number" if what in ("probability", "hold") else "text"
    if dimension not in dataset.coords or not has_kind(dataset[dimension], kind):
        yield f"no {dimension} to tell its entries apart"
        return
    found = dataset[dimension].values.tolist()
    if dimension not in (INPUT, PAIR) and entries.setdefault(dimension, found) != found:
        yield f"another {dimension} than elsewhere"
    if what in _COMPANIONS:
        suffix, kind = _COMPANIONS[what]
        beside = dataset.variables.get(f"{dimension}_{suffix}")
        if beside is None or beside.dims != (dimension,) or not has_kind(beside, kind):
            yield f"no {dimension}_{suffix} for each entry"
