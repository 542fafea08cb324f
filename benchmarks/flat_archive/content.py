"""The content of an archive, flattened."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import numpy as np
import numpy.typing as npt

__all__ = [
    "BOUND",
    "PER_ENTRY",
    "Flat",
    "Group",
    "Key",
    "NoPlaceError",
    "Tree",
    "Variable",
    "check_bounds",
    "describe",
    "put",
    "put_column",
    "put_estimates",
    "put_plain",
    "read",
]

BOUND = "bound"
_BOUNDS = ["estimate", "lower", "upper"]

# Texts that each estimate has: attributes, or the tables of a variable of codes.
PER_ENTRY = ("interval", "interval_label", "note")
# It is said or not where no estimate has an interval; it matters where one has.
_LEVEL = "interval_level"

# Attributes that are sentences, so that they may be reworded.
_SENTENCES = frozenset(
    {
        "long_name",
        "estimator",
        "estimand",
        "conditional_on",
        "missing",
        "reason",
        "not_fitted",
        "fit_warning",
        "of_long_name",
    }
)


class NoPlaceError(Exception):
    """Something in an archive has no place in its flat form, or two places with two values."""


class Key(NamedTuple):
    """The place of a value.

    Parameters
    ----------
    model : str
        Its name; empty in a study of one model.
    kind : str
        The part of the archive, such as ``"statistics"``, ``"failures"`` or ``"runs"``.
    source : str
        A design, a surrogate, a publication or a method.
    output : str
        Empty where it is of no output.
    name : str
        A statistic or a variable.
    at : tuple of (str, entry)
        The coordinates of an estimate, in the order of their names.
    what : str
        The name of an attribute or a text; empty for the value itself.
    """

    model: str = ""
    kind: str = ""
    source: str = ""
    output: str = ""
    name: str = ""
    at: tuple[tuple[str, Any], ...] = ()
    what: str = ""


@dataclass
class Flat:
    """All that an archive holds, by key.

    Parameters
    ----------
    estimates : dict
        Estimate, lower and upper bound; NaN where there is none.
    columns : dict
        Arrays: inputs, outputs and statuses of runs, coefficients, trajectories.
    texts : dict
        Sentences, and the reasons of lost runs; none of them is empty.
    facts : dict
        All other attributes: units, counts, levels, orders.
    """

    estimates: dict[Key, tuple[float, float, float]] = field(default_factory=dict)
    columns: dict[Key, npt.NDArray[Any]] = field(default_factory=dict)
    texts: dict[Key, str] = field(default_factory=dict)
    facts: dict[Key, object] = field(default_factory=dict)


class Variable(NamedTuple):
    """A variable of a file."""

    dimensions: tuple[str, ...]
    values: npt.NDArray[Any]
    attributes: dict[str, Any]


class Group(NamedTuple):
    """A group of a file, without the groups in it."""

    attributes: dict[str, Any]
    variables: dict[str, Variable]


@dataclass
class Tree:
    """The groups of a file by path; those that have found their place are taken out."""

    groups: dict[str, Group]

    def children(self, path: str) -> list[str]:
        """The names of the groups in a group, in the order of the file."""
        start = f"{path.rstrip('/')}/"
        inside = (each[len(start) :] for each in self.groups if each.startswith(start))
        return list(dict.fromkeys(each.partition("/")[0] for each in inside if each))

    def take(self, path: str) -> Group:
        """Take a group out; an empty one if there is none."""
        return self.groups.pop(path, Group({}, {}))

    def left(self) -> list[str]:
        """The paths of groups that nobody took, but for empty ones."""
        return [path for path, group in self.groups.items() if group.attributes or group.variables]


def read(path: Path) -> Tree:
    """Read all groups of a file; attributes become plain numbers, texts and tuples."""
    groups: dict[str, Group] = {}
    with netCDF4.Dataset(path) as root:
        root.set_auto_mask(False)
        root.set_auto_scale(False)
        waiting = [root]
        while waiting:
            group = waiting.pop(0)
            variables = {
                name: Variable(each.dimensions, np.asarray(each[...]), _attributes(each))
                for name, each in group.variables.items()
            }
            groups[group.path] = Group(_attributes(group), variables)
            waiting += group.groups.values()
    return Tree(groups)


def _attributes(owner: Any) -> dict[str, Any]:
    """Attributes but for the one by which xarray knows coordinates."""
    names = (name for name in owner.ncattrs() if name != "coordinates")
    return {name: _plain(owner.getncattr(name)) for name in names}


def _plain(value: Any) -> Any:
    plain = value.tolist() if hasattr(value, "tolist") else value
    return tuple(plain) if isinstance(plain, list) else plain


def put(into: dict[Key, Any], key: Key, value: Any) -> None:
    """Put a value at its place, where there may only be the same."""
    known = into.setdefault(key, value)
    if known is not value and not _is_same(known, value):
        raise NoPlaceError(f"{key}: {known!r} and {value!r}")


def _is_same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        if one.dtype.kind == "f":
            return bool(np.array_equal(one, other, equal_nan=True))
        return bool(np.array_equal(one, other))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_is_same, one, other))
    return bool(one == other) or (one != one and other != other)


def describe(flat: Flat, key: Key, attributes: Mapping[str, Any]) -> None:
    """Put attributes at their places, the sentences among the texts."""
    for what, value in attributes.items():
        if what not in _SENTENCES:
            put(flat.facts, key._replace(what=what), value)
        elif value:
            put(flat.texts, key._replace(what=what), str(value))


def put_estimates(
    flat: Flat,
    key: Key,
    dimensions: Sequence[str],
    entries: Mapping[str, Sequence[Any]],
    variable: Variable,
    texts: Mapping[str, npt.NDArray[Any]],
) -> None:
    """Put each estimate of a variable at its place.

    Parameters
    ----------
    flat : Flat
        Where they go.
    key : Key
        Theirs, without coordinates.
    dimensions : sequence of str
        The variable's own, but for ``bound``.
    entries : mapping of str to sequence
        The coordinate along each dimension.
    variable : Variable
        With the bounds along its last dimension; without that, it has none.
    texts : mapping of str to ndarray
        By `PER_ENTRY`: those of each estimate.
    """
    values = np.asarray(variable.values, dtype=np.float64)
    if variable.dimensions[-1:] != (BOUND,):
        values = np.stack([values, *[np.full(values.shape, np.nan)] * 2], axis=-1)
    along = [[(name, entry) for entry in entries[name]] for name in dimensions]
    places = [tuple(sorted(place, key=_name)) for place in itertools.product(*along)]
    for name in dimensions:
        put(flat.facts, key._replace(what=f"order along {name}"), tuple(entries[name]))
    for place, bounds in zip(places, values.reshape(-1, len(_BOUNDS)).tolist(), strict=True):
        put(flat.estimates, key._replace(at=place), tuple(bounds))
    for what, each in texts.items():
        for place, text in zip(places, each.ravel().tolist(), strict=True):
            if text:
                put(flat.texts, key._replace(at=place, what=what), text)
    described = {k: v for k, v in variable.attributes.items() if k not in (*PER_ENTRY, _LEVEL)}
    if np.isfinite(values[..., 1:]).any():
        described[_LEVEL] = variable.attributes.get(_LEVEL, math.nan)
    describe(flat, key, described)


def _name(pair: tuple[str, Any]) -> str:
    return pair[0]


def put_column(flat: Flat, key: Key, variable: Variable) -> None:
    """Put an array at its place, and its attributes beside it."""
    put(flat.columns, key, variable.values)
    describe(flat, key, variable.attributes)


def put_plain(flat: Flat, key: Key, group: Group) -> None:
    """Put a group at its place as it is: variables by their names, with their dimensions."""
    describe(flat, key, group.attributes)
    for name, variable in group.variables.items():
        place = key._replace(name=name)
        put(flat.facts, place._replace(what="dimensions"), variable.dimensions)
        put_column(flat, place, variable)


def check_bounds(groups: Iterable[Group]) -> None:
    """Make sure that bounds stand in the one order there is."""
    for group in groups:
        bound = group.variables.get(BOUND)
        if bound is not None and bound.values.tolist() != _BOUNDS:
            raise NoPlaceError(f"bounds in another order: {bound.values.tolist()}")
