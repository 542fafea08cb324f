"""A study: a group for each source and output, variables named by the statistic alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flat_archive.content import (
    BOUND,
    PER_ENTRY,
    Flat,
    Group,
    Key,
    NoPlaceError,
    Tree,
    Variable,
    check_bounds,
    describe,
    put,
    put_column,
    put_estimates,
)
from flat_archive.runs import models_of, put_model_apart, put_root, put_runs

__all__ = ["entry_texts", "flat_of_study", "put_output"]

# A variable of codes into the texts, after the statistic's name, and its tables.
_CODES = "_interval"
_TABLES = {what: f"flag_{what}" for what in PER_ENTRY}

# Attributes of a group that are of the group, not of each statistic in it.
_OF_GROUP = ("largest_contribution", "minus")


def flat_of_study(tree: Tree) -> Flat:
    """Flatten the archive of a study; its groups are taken out of the tree."""
    flat = Flat()
    check_bounds(tree.groups.values())
    put_root(flat, tree)
    for model, path in models_of(tree):
        put_runs(flat, tree, model, path)
        sources = _put_sources(flat, tree, Key(model, "statistics"), f"{path}/statistics")
        put(flat.facts, Key(model, "sources", what="order"), tuple(sources))
        for design in tree.children(f"{path}/failures"):
            group = tree.take(f"{path}/failures/{design}")
            put_output(flat, Key(model, "failures", design), group)
        for name in tree.children(f"{path}/surrogates"):
            _put_surrogate(flat, tree, Key(model, "surrogates", name), f"{path}/surrogates/{name}")
        put_model_apart(flat, tree, model, path)
    for model in tree.children("/differences"):
        _put_sources(flat, tree, Key(model, "differences"), f"/differences/{model}")
    return flat


def _put_sources(flat: Flat, tree: Tree, key: Key, path: str) -> list[str]:
    """Put the statistics of all sources at their places; the names of these are returned."""
    sources = tree.children(path)
    for source in sources:
        group = tree.take(f"{path}/{source}")
        if group.variables:
            raise NoPlaceError(f"{path}/{source}: variables of no output")
        place = key._replace(source=source)
        attributes = dict(group.attributes)
        for what in _OF_GROUP:
            if what in attributes:
                put(flat.facts, place._replace(what=what), attributes.pop(what))
        describe(flat, place._replace(kind="sources"), attributes)
        for output in tree.children(f"{path}/{source}"):
            inside = tree.take(f"{path}/{source}/{output}")
            put_output(flat, place._replace(output=output), inside)
    return sources


def put_output(flat: Flat, key: Key, group: Group) -> None:
    """Put the statistics of a group at their places.

    Parameters
    ----------
    flat : Flat
        Where they go.
    key : Key
        Theirs, but for names and coordinates.
    group : Group
        Of one source and output; its attributes are of each of its statistics.
    """
    attributes = dict(group.attributes)
    if "minus" in attributes:
        put(flat.facts, key._replace(output="", what="minus"), attributes.pop("minus"))
    if "largest_contribution" in attributes:
        place = key._replace(what="largest_contribution")
        put(flat.facts, place, attributes.pop("largest_contribution"))
    found = False
    for name, variable in group.variables.items():
        if name == BOUND or _TABLES["interval"] in variable.attributes:
            continue
        place = key._replace(name=name)
        if variable.dimensions[-1:] == (BOUND,):
            found = True
            _put_statistic(flat, place, name, group)
            describe(flat, place, attributes)
        elif variable.dimensions == (name,):
            describe(flat, place, variable.attributes)
        else:
            put_column(flat, place, variable)
    _check_codes(key, group)
    if attributes and not found:
        raise NoPlaceError(f"{key}: attributes of no statistic: {attributes}")


def _check_codes(key: Key, group: Group) -> None:
    """Make sure that each variable of codes belongs to a statistic."""
    for name, variable in group.variables.items():
        if _TABLES["interval"] in variable.attributes:
            owner = group.variables.get(name.removesuffix(_CODES))
            if owner is None or (*variable.dimensions, BOUND) != owner.dimensions:
                raise NoPlaceError(f"{key}: {name} belongs to no statistic")


def _put_statistic(flat: Flat, key: Key, name: str, group: Group) -> None:
    variable = group.variables[name]
    dimensions = variable.dimensions[:-1]
    entries = {each: group.variables[each].values.tolist() for each in dimensions}
    texts = entry_texts(name, variable, group)
    put_estimates(flat, key, dimensions, entries, variable, texts)


def entry_texts(name: str, variable: Variable, group: Group) -> dict[str, npt.NDArray[Any]]:
    """The texts of each estimate: attributes, or what the codes stand for."""
    shape = tuple(
        size
        for size, dimension in zip(variable.values.shape, variable.dimensions, strict=True)
        if dimension != BOUND
    )
    codes = group.variables.get(f"{name}{_CODES}")
    if codes is None or _TABLES["interval"] not in codes.attributes:
        told = {what: str(variable.attributes.get(what, "")) for what in PER_ENTRY}
        return {what: np.full(shape, text, dtype=object) for what, text in told.items()}
    if any(what in variable.attributes for what in PER_ENTRY):
        raise NoPlaceError(f"{name} has texts and codes of texts")
    flags = _listed(codes.attributes["flag_values"])
    texts = {}
    for what, table in _TABLES.items():
        told_by = dict(zip(flags, _listed(codes.attributes[table]), strict=True))
        told_of = [told_by[code] for code in codes.values.ravel().tolist()]
        texts[what] = np.array(told_of, dtype=object).reshape(shape)
    return texts


def _listed(value: Any) -> tuple[Any, ...]:
    """NetCDF does not tell a single value from a list of one."""
    return value if isinstance(value, tuple) else (value,)


def _put_surrogate(flat: Flat, tree: Tree, key: Key, path: str) -> None:
    """Put a surrogate at its place: the polynomials of all outputs, then the fit to each."""
    group = tree.take(path)
    if group.variables:
        raise NoPlaceError(f"{path}: variables of no output")
    attributes = dict(group.attributes)
    for what in ("check", "runs_spent"):
        if what in attributes:
            put(flat.facts, key._replace(kind="sources", what=what), attributes.pop(what))
    describe(flat, key, attributes)
    polynomials = tree.take(f"{path}/input")
    for name, variable in polynomials.variables.items():
        _put_fit(flat, key._replace(name=name), variable)
    for output in tree.children(path):
        inside = tree.take(f"{path}/{output}")
        place = key._replace(output=output)
        describe(flat, place, inside.attributes)
        for name, variable in inside.variables.items():
            if name != "input":
                _put_fit(flat, place._replace(name=name), variable)
            elif variable.values.tolist() != polynomials.variables[name].values.tolist():
                raise NoPlaceError(f"{path}/{output}: other inputs than the polynomials")


def _put_fit(flat: Flat, key: Key, variable: Variable) -> None:
    """Put a variable of a surrogate at its place; how well an output is fitted is the output's."""
    own = ("units", "long_name", "display_units", "role")
    put(flat.columns, key, variable.values)
    told = variable.attributes.items()
    describe(flat, key, {k: v for k, v in told if k in own or not key.output})
    if key.output:
        diagnostics = {k: v for k, v in told if k not in own}
        describe(flat, key._replace(name=""), diagnostics)
