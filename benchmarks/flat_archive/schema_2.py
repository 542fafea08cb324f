"""Schema 2: a group for each kind of statistics, names of outputs before those of statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

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
from flat_archive.runs import models_of, outputs_of, put_model_apart, put_root, put_runs

__all__ = ["flat_of_schema_2", "put_statistics"]

_MOMENTS = ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs")
_SHARES = ("first_order", "total_order", "shapley")
_SENSITIVITY = (
    *_SHARES,
    "second_order",
    *(f"{of}_{share}" for of in ("log", "exceedance", "category") for share in _SHARES),
    *("pearson", "spearman", "partial", "partial_rank", "delta"),
    *("mu", "mu_star", "sigma", "response", "contribution"),
)

# By group: what follows the output's name in a variable, and the statistic in schema 3.
_STATISTICS: Mapping[str, Mapping[str, str]] = {
    "moments": {name: name for name in _MOMENTS},
    "quantiles": {"": "quantile"},
    "holds": {"": "tolerance_limit"},
    "exceedance": {"": "exceedance"},
    "shares": {"": "share"},
    "cdfs": {"probability": "cdf", "band": "cdf_band"},
    "sensitivity": {name: name for name in _SENSITIVITY},
}
# Statistics that /comparison repeats, and what follows the output's name there.
_COMPARED = {
    **_STATISTICS["moments"],
    **_STATISTICS["sensitivity"],
    "quantile": "quantile",
    "exceedance": "exceedance",
    "share": "share",
}
# Dimensions that have an output's name before their own, and what they are called in schema 3.
_DIMENSIONS = {
    "probability": "probability",
    "hold": "content",
    "threshold": "threshold",
    "category": "category",
}
# What stands beside the entries of a dimension.
_BESIDE = ("value", "label", "runs_needed", "first", "second")
# What schema 3 calls the probabilities of statuses, and what these are along.
_PROBABILITY_NAME = "probability that a run ends so"
_STATUS_NAME = "end of a run"
_NOT_TOLD = ("none", "none", "this source does not tell it")


def flat_of_schema_2(tree: Tree) -> Flat:
    """Flatten the archive of a study; its groups are taken out of the tree."""
    flat = Flat()
    check_bounds(tree.groups.values())
    put_root(flat, tree)
    outputs = {}
    for model, path in models_of(tree):
        outputs[model] = outputs_of(tree, path)
        _put_model(flat, tree, model, path, outputs[model])
    for model in tree.children("/differences"):
        path = f"/differences/{model}"
        _put_sources(flat, tree, Key(model, "differences"), path, outputs[model])
    return flat


def _put_model(flat: Flat, tree: Tree, model: str, path: str, outputs: Sequence[str]) -> None:
    sampling = {
        design: tree.groups[f"{path}/runs/{design}"].attributes["sampling"]
        for design in tree.children(f"{path}/runs")
    }
    put_runs(flat, tree, model, path)
    blocks = {
        design: tree.groups[f"{path}/statuses/{design}"].attributes
        for design, how in sampling.items()
        if how == "pick-freeze"
    }
    publications = _put_sources(flat, tree, Key(model, "statistics"), path, outputs, blocks)
    _put_failures(flat, tree, model, path)
    for name in tree.children(f"{path}/surrogates"):
        _put_surrogate(flat, tree.take(f"{path}/surrogates/{name}"), Key(model, "surrogates", name))
    put_model_apart(flat, tree, model, path)
    sources = _put_comparison(flat, tree.take(f"{path}/comparison"), model, outputs)
    put(flat.facts, Key(model, "sources", what="order"), (*sources, *publications))


def _put_sources(
    flat: Flat,
    tree: Tree,
    key: Key,
    path: str,
    outputs: Sequence[str],
    blocks: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[str]:
    """Put the statistics of all sources at their places.

    Returns
    -------
    list of str
        The publications among the sources.
    """
    publications: dict[str, None] = {}
    for family in _STATISTICS:
        for source in tree.children(f"{path}/{family}"):
            group = tree.take(f"{path}/{family}/{source}")
            place = key._replace(source=source)
            attributes = dict(group.attributes)
            if "source" in attributes:
                publications[source] = None
                _put_publication(flat, place, attributes)
            if "minus" in attributes:
                put(flat.facts, place._replace(what="minus"), attributes.pop("minus"))
            put_statistics(
                flat,
                place,
                Group(attributes, group.variables),
                family,
                outputs,
                of_sample=(blocks or {}).get(source),
            )
    return list(publications)


def _put_publication(flat: Flat, key: Key, attributes: dict[str, Any]) -> None:
    """Put what a publication says beside its figures, and take it from the attributes."""
    of_source = key._replace(kind="sources")
    put(flat.facts, of_source._replace(what="cited"), attributes.pop("source"))
    put(flat.facts, of_source._replace(what="kind"), "publication")
    ending = "_largest_contribution"
    for name in [name for name in attributes if name.endswith(ending)]:
        place = key._replace(output=name.removesuffix(ending), what=ending.removeprefix("_"))
        put(flat.facts, place, attributes.pop(name))


class _Place(NamedTuple):
    """What a variable of a group is: the statistic of an output, along some dimensions."""

    key: Key
    dimensions: dict[str, str]


def put_statistics(
    flat: Flat,
    key: Key,
    group: Group,
    family: str,
    outputs: Sequence[str],
    *,
    of_sample: Mapping[str, Any] | None = None,
) -> None:
    """Put the statistics of one source in one group at their places.

    Parameters
    ----------
    flat : Flat
        Where they go.
    key : Key
        Theirs, as far as it is known.
    group : Group
        What stands there; its attributes are of each of its statistics.
    family : str
        The name of the group.
    outputs : sequence of str
        The longest first.
    of_sample : mapping of str, optional
        Of pick-freeze blocks: what those statistics are of that take their sample only. The
        attributes of ``/sensitivity`` are wrong for these.
    """
    used = {BOUND}
    found = False
    # Of the runs that statistics of the sample are of.
    by_sample = of_sample or group.attributes
    for name, variable in group.variables.items():
        if name == BOUND or variable.dimensions[-1:] != (BOUND,):
            continue
        found = True
        place = _place(key, name, variable.dimensions[:-1], _STATISTICS[family], outputs)
        _put_variable(flat, place, name, group, used)
        is_of_sample = of_sample is not None and "blocks_used" not in variable.attributes
        describe(flat, place.key, by_sample if is_of_sample else group.attributes)
    if group.attributes and not found:
        raise NoPlaceError(f"{key}: attributes of no statistic: {group.attributes}")
    if family == "cdfs":
        for output in outputs:
            if output in group.variables:
                used.add(output)
                place_of_values = key._replace(output=output, name="cdf_value")
                put_column(flat, place_of_values, group.variables[output])
                describe(flat, place_of_values, by_sample)
    _refuse_rest(key, group, used)


def _refuse_rest(key: Key, group: Group, used: set[str]) -> None:
    if left := set(group.variables) - used:
        raise NoPlaceError(f"{key}: no place for {', '.join(sorted(left))}")


def _place(
    key: Key,
    name: str,
    dimensions: Sequence[str],
    endings: Mapping[str, str],
    outputs: Sequence[str],
) -> _Place:
    for output in outputs:
        ending = "" if name == output else name.removeprefix(f"{output}_")
        if (name == output or ending != name) and ending in endings:
            renamed = {f"{output}_{old}": new for old, new in _DIMENSIONS.items()}
            along = {each: renamed.get(each, each) for each in dimensions}
            return _Place(key._replace(output=output, name=endings[ending]), along)
    raise NoPlaceError(f"{key}: {name} is no statistic of any output")


def _put_variable(flat: Flat, place: _Place, name: str, group: Group, used: set[str]) -> None:
    """Put the estimates of a variable at their places, with their coordinates and texts."""
    variable = group.variables[name]
    used.add(name)
    for dimension, short in place.dimensions.items():
        _put_coordinate(flat, place.key, dimension, short, group, used)
    entries = {s: group.variables[d].values.tolist() for d, s in place.dimensions.items()}
    texts = _texts(name, variable, tuple(place.dimensions), group, used)
    put_estimates(flat, place.key, list(entries), entries, variable, texts)


def _put_coordinate(
    flat: Flat, key: Key, dimension: str, short: str, group: Group, used: set[str]
) -> None:
    """Put what describes a dimension at its place; the entries are in the keys of estimates."""
    used.add(dimension)
    describe(flat, key._replace(name=short), group.variables[dimension].attributes)
    for suffix in _BESIDE:
        beside = group.variables.get(f"{dimension}_{suffix}")
        if beside is not None and beside.dimensions == (dimension,):
            used.add(f"{dimension}_{suffix}")
            put_column(flat, key._replace(name=f"{short}_{suffix}"), beside)


def _texts(
    name: str, variable: Variable, dimensions: tuple[str, ...], group: Group, used: set[str]
) -> dict[str, npt.NDArray[Any]]:
    """The texts of each estimate: attributes, or coordinates named after it or its dimension."""
    shape = variable.values.shape[: len(dimensions)]
    texts = {}
    for what in PER_ENTRY:
        texts[what] = np.full(shape, variable.attributes.get(what, ""), dtype=object)
        for stem in (name, *dimensions):
            held = group.variables.get(f"{stem}_{what}")
            if held is not None and f"{stem}_{PER_ENTRY[1]}" in group.variables:
                if held.dimensions != dimensions or what in variable.attributes:
                    raise NoPlaceError(f"{stem}_{what} is not along {dimensions}")
                used.add(f"{stem}_{what}")
                texts[what] = held.values
                break
    return texts


def _put_failures(flat: Flat, tree: Tree, model: str, path: str) -> None:
    """Put the probabilities of statuses, and where runs were lost, at their places."""
    for design in tree.children(f"{path}/statuses"):
        group = tree.take(f"{path}/statuses/{design}")
        key = Key(model, "failures", design, name="probability")
        describe(flat, key, {**group.attributes, "long_name": _PROBABILITY_NAME})
        describe(flat, key._replace(name="status"), {"long_name": _STATUS_NAME})
        statuses = [name for name in group.variables if name != BOUND]
        put(flat.facts, key._replace(what="order along status"), tuple(statuses))
        for status in statuses:
            variable = group.variables[status]
            # In schema 3 they share a name to be read, `_PROBABILITY_NAME`.
            shared = {k: v for k, v in variable.attributes.items() if k != "long_name"}
            _put_status(flat, key, status, variable._replace(attributes=shared))
    for design in tree.children(f"{path}/losses"):
        group = tree.take(f"{path}/losses/{design}")
        used = {BOUND}
        for name in ("larger", "further_out"):
            key = Key(model, "failures", design, name=name)
            _put_variable(flat, _Place(key, {"input": "input"}), name, group, used)
            describe(flat, key, group.attributes)
        for name in ("lowest", "highest"):
            used.add(name)
            key = Key(model, "failures", design, name=name)
            put_column(flat, key, group.variables[name])
            describe(flat, key, group.attributes)
        _refuse_rest(Key(model, "failures", design), group, used)


def _put_status(flat: Flat, key: Key, status: str, variable: Variable) -> None:
    """Put the probability of one status at its place."""
    place = key._replace(at=(("status", status),))
    apart = Flat()
    texts = _texts(status, variable, (), Group({}, {}), set())
    put_estimates(apart, key, (), {}, variable, texts)
    put(flat.estimates, place, apart.estimates[key])
    for each, text in apart.texts.items():
        put(flat.texts, each._replace(at=place.at), text)
    for each, fact in apart.facts.items():
        put(flat.facts, each, fact)


def _put_surrogate(flat: Flat, group: Group, key: Key) -> None:
    """Put a surrogate at its place: what is of one output apart from what is of all."""
    attributes = dict(group.attributes)
    for what in ("check", "runs_spent"):
        place = key._replace(kind="sources", what=what)
        put(flat.facts, place, attributes.pop(what))
    ending = "_not_fitted"
    for name in [name for name in attributes if name.endswith(ending)]:
        told = {ending.removeprefix("_"): attributes.pop(name)}
        describe(flat, key._replace(output=name.removesuffix(ending)), told)
    describe(flat, key, attributes)
    outputs = sorted(str(attributes["outputs"]).split(), key=len, reverse=True)
    for name, variable in group.variables.items():
        place = key._replace(name=name)
        for output in outputs:
            ending = name.removeprefix(f"{output}_")
            if ending in ("degree", "coefficient", "fit_noise"):
                place = key._replace(output=output, name=ending)
                break
        put_fit(flat, place, variable)


def put_fit(flat: Flat, key: Key, variable: Variable) -> None:
    """Put a variable of a surrogate at its place; how well an output is fitted is the output's."""
    own = ("units", "long_name", "display_units", "role")
    put(flat.columns, key, variable.values)
    told = variable.attributes.items()
    describe(flat, key, {k: v for k, v in told if k in own or not key.output})
    if key.output:
        diagnostics = {k: v for k, v in told if k not in own}
        describe(flat, key._replace(name=""), diagnostics)


def _put_comparison(flat: Flat, group: Group, model: str, outputs: Sequence[str]) -> list[str]:
    """Check that /comparison repeats what stands elsewhere, all of it and nothing else.

    Returns
    -------
    list of str
        The sources, which only stand there together.
    """
    sources = [str(name) for name in group.variables["source"].values]
    for what, name in (("kind", "source_kind"), ("runs_spent", "runs_spent")):
        for source, value in zip(sources, group.variables[name].values.tolist(), strict=True):
            put(flat.facts, Key(model, "sources", source, what=what), value)
    used = {BOUND, "source", "source_kind", "runs_spent"}
    repeated: set[Key] = set()
    for name, variable in group.variables.items():
        if name != BOUND and variable.dimensions[-1:] == (BOUND,):
            own = variable.dimensions[1:-1]
            place = _place(Key(model, "statistics"), name, own, _COMPARED, outputs)
            copy = Flat()
            along = {"source": "source", **place.dimensions}
            _put_variable(copy, _Place(place.key, along), name, group, used)
            repeated |= _check_copy(flat, copy)
    _refuse_rest(Key(model, "comparison"), group, used)
    told = {
        key
        for key in flat.estimates
        if (key.model, key.kind) == (model, "statistics")
        and key.source in sources
        and key.name in _COMPARED.values()
    }
    if told != repeated:
        raise NoPlaceError(f"/comparison lacks {sorted(told - repeated, key=str)[:3]}")
    return sources


def _check_copy(flat: Flat, copy: Flat) -> set[Key]:
    """The estimates that a variable of /comparison repeats; an error where it contradicts them."""
    repeated = set()
    for key, bounds in copy.estimates.items():
        source = dict(key.at)["source"]
        own = tuple(pair for pair in key.at if pair[0] != "source")
        place = key._replace(source=source, at=own)
        texts = tuple(copy.texts.get(key._replace(what=what), "") for what in PER_ENTRY)
        if place in flat.estimates:
            expected = flat.estimates[place]
            known = tuple(flat.texts.get(place._replace(what=what), "") for what in PER_ENTRY)
            units = Key(place.model, place.kind, source, place.output, place.name, (), "units")
            same_units = flat.facts.get(units) == copy.facts.get(units._replace(source=""))
            repeated.add(place)
        else:
            expected, known, same_units = (np.nan,) * 3, _NOT_TOLD, True
        if not np.array_equal(bounds, expected, equal_nan=True) or texts != known:
            raise NoPlaceError(f"/comparison contradicts {place}: {bounds}, {texts}")
        if not same_units:
            raise NoPlaceError(f"/comparison has other units than {place}")
    return repeated
