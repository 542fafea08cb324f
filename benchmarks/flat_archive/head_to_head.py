"""Methods head to head: each word of a path, a name or a coordinate says what a value is.

A variable is a figure: ``/benchmark/<output>/mean`` holds ``error`` and ``coverage``. Words that a
later layout brings go into the tables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

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
    put_estimates,
)
from flat_archive.runs import put_root
from flat_archive.study import entry_texts, put_output

__all__ = ["flat_of_head_to_head"]

_STATISTICS = ("mean", "std", "quantile", "exceedance")
# Words that say what figure a value is, and its name here.
_FIGURES = {
    **{name: name for name in ("coverage", "scale", "lead", "winner", "runner_up", "level")},
    **{name: name for name in ("verdict", "runs", "replicates", "source", "contests")},
    "note": "remark",
    "remark": "remark",
    **dict.fromkeys(("estimate", "estimates"), "estimate"),
    **dict.fromkeys(("error", "errors"), "error"),
    **dict.fromkeys(("slope", "slopes"), "slope"),
}
# Words that only hold others together.
_PLACES = frozenset({"methods", "verdicts", "benchmark"})
_DIMENSIONS = {"method": "contestant"}
# What the group of an output says of it, beside its name.
_OF_OUTPUT = ("units", "display_units")
_METHOD, _OUTPUT, _STATISTIC, _FIGURE = "contestant", "output", "statistic", "figure"


def flat_of_head_to_head(tree: Tree) -> Flat:
    """Flatten an archive of methods head to head; its groups are taken out of the tree."""
    flat = Flat()
    check_bounds(tree.groups.values())
    put_root(flat, tree)
    words = _words(tree)
    methods = tuple(word for word, what in words.items() if what == _METHOD)
    put(flat.facts, Key("", "head to head", what=f"order along {_METHOD}"), methods)
    for name in tree.children("/reference"):
        key, group = Key("", "reference", "reference", name), tree.take(f"/reference/{name}")
        put_output(flat, key, group)
    told = {name: tree.take(f"/benchmark/{name}") for name in tree.children("/benchmark")}
    for path in list(tree.groups):
        group = tree.take(path)
        spoken = path.strip("/").split("/")
        if group.attributes:
            describe(flat, Key("", "head to head", name=spoken[-1]), group.attributes)
        for name, variable in group.variables.items():
            _put_variable(flat, [*spoken, name], variable, group, words)
    for name, group in told.items():
        _check_output(flat, name, group)
    return flat


def _check_output(flat: Flat, name: str, group: Group) -> None:
    """Check that the group of an output repeats what its mean says of it, and nothing else."""
    mean = Key("", "head to head", "estimate", name, "mean")
    expected = {what: flat.facts.get(mean._replace(what=what)) for what in _OF_OUTPUT}
    expected["long_name"] = flat.texts[mean._replace(what="long_name")].removeprefix("mean of ")
    if group.variables or group.attributes != expected:
        raise NoPlaceError(f"/benchmark/{name}: {group.attributes}, but its mean says {expected}")


def _words(tree: Tree) -> dict[str, str]:
    """What the words that a study brings stand for: its methods and outputs."""
    methods: Sequence[Any] = tree.children("/methods")
    for name in ("contestant", "method"):
        if name in tree.groups.get("/methods", Group({}, {})).variables:
            methods = tree.groups["/methods"].variables[name].values.tolist()
    known = dict.fromkeys(tree.children("/reference"), _OUTPUT)
    if clash := known.keys() & {*_FIGURES, *_PLACES, *_STATISTICS, *methods}:
        raise NoPlaceError(f"names with two meanings: {', '.join(clash)}")
    return known | dict.fromkeys(map(str, methods), _METHOD)


def _put_variable(
    flat: Flat, spoken: Sequence[str], variable: Variable, group: Group, words: Mapping[str, str]
) -> None:
    name = spoken[-1]
    dimensions = [each for each in variable.dimensions if each != BOUND]
    if name == BOUND or "flag_interval" in variable.attributes:
        return
    if variable.dimensions == (name,):
        # A later schema may have groups in place of the entries along methods.
        if _DIMENSIONS.get(name, name) != _METHOD:
            describe(flat, Key("", "head to head", name=name), variable.attributes)
        return
    meaning = _meaning(spoken, words)
    fixed = [(_METHOD, meaning[_METHOD])] if _METHOD in meaning else []
    named = [_DIMENSIONS.get(each, each) for each in dimensions]
    entries = {
        short: group.variables[each].values.tolist()
        for each, short in zip(dimensions, named, strict=True)
    }
    output, statistic = meaning.get(_OUTPUT, ""), meaning.get(_STATISTIC, "")
    key = Key("", "head to head", meaning[_FIGURE], output, statistic)
    _put_entries(flat, key, name, variable, group, named, entries, fixed)


def _put_entries(
    flat: Flat,
    key: Key,
    name: str,
    variable: Variable,
    group: Group,
    dimensions: Sequence[str],
    entries: Mapping[str, Sequence[Any]],
    fixed: Sequence[tuple[str, Any]],
) -> None:
    """Put the entries of a variable at their places, as estimates or as texts."""
    apart = Flat()
    if variable.values.dtype.kind in "OUS":
        numbers = variable._replace(values=np.full(variable.values.shape, np.nan))
        put_estimates(apart, key, dimensions, entries, numbers, {"text": variable.values})
        apart.estimates.clear()
    else:
        texts = {w: t for w, t in entry_texts(name, variable, group).items() if w in PER_ENTRY}
        put_estimates(apart, key, dimensions, entries, variable, texts)
    for into, found in ((flat.estimates, apart.estimates), (flat.texts, apart.texts)):
        for each, value in found.items():
            is_of_entry = bool(each.at) or each.what in ("", "text", *PER_ENTRY)
            at = tuple(sorted((*each.at, *fixed))) if is_of_entry else each.at
            put(into, each._replace(at=at), value)
    for each, fact in apart.facts.items():
        if each.what != f"order along {_METHOD}":
            put(flat.facts, each, fact)


def _meaning(spoken: Sequence[str], words: Mapping[str, str]) -> dict[str, str]:
    """What the words of a path and a name say; a later word refines an earlier one."""
    meaning: dict[str, str] = {}
    for word in spoken:
        if word in words:
            meaning[words[word]] = word
        elif word in _STATISTICS:
            meaning[_STATISTIC] = word
        elif word in _FIGURES:
            meaning[_FIGURE] = _FIGURES[word]
        elif word not in _PLACES:
            statistic, _, figure = word.partition("_")
            if statistic not in _STATISTICS or figure not in _FIGURES:
                raise NoPlaceError(f"/{'/'.join(spoken)}: nobody knows the word {word}")
            meaning |= {_STATISTIC: statistic, _FIGURE: _FIGURES[figure]}
    if _STATISTIC in meaning:
        meaning.setdefault(_FIGURE, "estimate")
    if _FIGURE not in meaning:
        raise NoPlaceError(f"/{'/'.join(spoken)}: no word says what figure it is")
    return meaning
