"""Archives of schema 2, whose statistics stood in groups by kind and were named after outputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array, pack
from uqpen.archive.reworded import reworded_array
from uqpen.archive.tree import group_names, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUND,
    CITED,
    DIFFERENCES,
    FAILURES_GROUP,
    INPUT,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    LARGEST_CONTRIBUTION,
    MODELS,
    NOT_FITTED,
    ROLE,
    RUN,
    RUNS,
    RUNS_SPENT,
    SOURCE_KIND,
    STATISTICS_GROUP,
    STATUS,
    SURROGATES,
    TRAJECTORY,
)
from uqpen.core.statistic_dimensions import CATEGORY, CONTENT_LEVEL, PROBABILITY, THRESHOLD

__all__ = ["migrate_from_2", "read_statistic"]

_SENSITIVITY = "sensitivity"

# The group of each statistic, and what followed the output in its variable's name.
_PLACES = {
    **{
        name: ("moments", f"_{name}")
        for name in ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs")
    },
    "quantile": ("quantiles", ""),
    "tolerance_limit": ("holds", ""),
    "exceedance": ("exceedance", ""),
    "share": ("shares", ""),
    "cdf": ("cdfs", "_probability"),
    "cdf_band": ("cdfs", "_band"),
    "cdf_value": ("cdfs", ""),
}

# What a dimension was called there, after its output.
_DIMENSIONS = {
    PROBABILITY: "probability",
    CONTENT_LEVEL: "hold",
    THRESHOLD: "threshold",
    CATEGORY: "category",
}

_GROUPS = ("moments", "quantiles", "holds", "exceedance", "cdfs", "shares", _SENSITIVITY)


def migrate_from_2(tree: xr.DataTree) -> xr.DataTree:
    """Return a copy of an archive of schema 2 with its statistics by source, output and name.

    The group ``/comparison`` is left out: it was a copy of other groups.
    """
    groups = {"/": xr.Dataset(attrs=tree.attrs)}
    for name, model in model_trees(tree).items():
        root = f"/{MODELS}/{name}" if name else ""
        if name:
            groups[root] = xr.Dataset(attrs=model.attrs)
        for path, dataset in _model_groups(model):
            groups[f"{root}{path}"] = dataset
    for other in group_names(tree, DIFFERENCES):
        pair = tree.children[DIFFERENCES].children[other]
        for source in group_names(pair, "moments"):
            minus = {"minus": read_group(pair, "moments", source).attrs["minus"]}
            for output, dataset in _statistics(pair, source, left_out=("minus",)):
                path = f"/{DIFFERENCES}/{other}/{source}/{output}"
                groups[path] = dataset.assign_attrs(minus)
    if "files" in tree.children:
        groups["/files"] = read_group(tree, "files")
    return xr.DataTree.from_dict(groups)


def _model_groups(model: xr.DataTree) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the groups of one model."""
    yield from _unchanged(model, RUNS)
    designs, surrogates = group_names(model, RUNS), group_names(model, SURROGATES)
    for design in designs:
        if failures := _read_failures(model, design):
            yield f"/{FAILURES_GROUP}/{design}", pack(failures)
    for name in surrogates:
        for path, dataset in _surrogate_groups(read_group(model, SURROGATES, name)):
            yield f"/{SURROGATES}/{name}{path}", dataset
    named = (name for kind in _GROUPS for name in group_names(model, kind))
    for source in dict.fromkeys([*designs, *surrogates, *named]):
        path = f"/{STATISTICS_GROUP}/{source}"
        yield path, xr.Dataset(attrs=_source_attributes(model, source))
        for output, dataset in _statistics(model, source):
            yield f"{path}/{output}", dataset
    yield from _unchanged(model, TRAJECTORY)


def _unchanged(model: xr.DataTree, kind: str) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield groups that have the same layout in schema 3."""
    if kind in model.children:
        for node in model.children[kind].subtree:
            below = node.path.removeprefix(model.children[kind].path)
            yield f"/{kind}{below}", node.to_dataset(inherit=False)


def _surrogate_groups(made: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the groups of a surrogate, whose variables for outputs were named after them."""
    ending = f"_{NOT_FITTED}"
    reasons = {key: text for key, text in made.attrs.items() if str(key).endswith(ending)}
    yield "", xr.Dataset(attrs={k: v for k, v in made.attrs.items() if k not in reasons})
    fits = {}
    for output in str(made.attrs["outputs"]).split():
        old = {f"{output}_{name}": name for name in ("degree", "coefficient", "fit_noise")}
        fit = made[list(old)].rename({**old, f"{output}_term": "term"})
        attributes = fit["coefficient"].attrs
        own = {key: attributes[key] for key in ("long_name", "units")}
        fit.attrs = {key: value for key, value in attributes.items() if key not in own}
        fit["coefficient"].attrs = own
        fits[f"/{output}"] = fit
        made = made.drop_vars(list(old))
    yield f"/{INPUT}", made.drop_attrs(deep=False)
    yield from fits.items()
    for name, reason in reasons.items():
        yield f"/{str(name).removesuffix(ending)}", xr.Dataset(attrs={NOT_FITTED: reason})


def _source_attributes(model: xr.DataTree, source: str) -> dict[str, Any]:
    """Return the kind of a source."""
    if runs := read_group(model, RUNS, source):
        return {SOURCE_KIND: "design", RUNS_SPENT: runs.sizes[RUN]}
    if source in group_names(model, SURROGATES):
        made = read_group(model, SURROGATES, source).attrs
        return {SOURCE_KIND: "surrogate", **{key: made[key] for key in (RUNS_SPENT, "check")}}
    found = (read_group(model, kind, source).attrs for kind in _GROUPS)
    cited = next((str(each["source"]) for each in found if "source" in each), "")
    return {SOURCE_KIND: "publication", CITED: cited}


def _statistics(
    tree: xr.DataTree, source: str, *, left_out: tuple[str, ...] = ()
) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield each output of a source with its statistics, packed."""
    claims = read_group(tree, _SENSITIVITY, source).attrs
    for output in _outputs(tree, source):
        found = {}
        for name in CATALOGUE:
            array = read_statistic(tree, source, output, name)
            if array is not None:
                array.attrs = {k: v for k, v in array.attrs.items() if k not in left_out}
                found[name] = array
        largest = claims.get(f"{output}_{LARGEST_CONTRIBUTION}")
        if found or largest is not None:
            attributes = {} if largest is None else {LARGEST_CONTRIBUTION: largest}
            yield output, pack(found).assign_attrs(attributes)


def _outputs(tree: xr.DataTree, source: str) -> list[str]:
    """Return the outputs of a model, or of a pair of models, in the order of the runs."""
    root = tree
    if RUNS not in root.children:
        root = tree.root.children[MODELS].children[tree.name or ""]
    runs = read_group(root, RUNS, group_names(root, RUNS)[0])
    return [str(name) for name, each in runs.data_vars.items() if each.attrs.get(ROLE) == "output"]


def read_statistic(
    tree: xr.DataTree, source: str, output: str, statistic: str
) -> xr.DataArray | None:
    """Return an estimate array of a model, or of a pair of models; None where there is none.

    Parameters
    ----------
    tree : DataTree
        Its children are the groups by kind.
    source, output, statistic : str
        The names of a design, surrogate or publication; of an output; of an entry of the catalogue.
    """
    group, suffix = _PLACES.get(statistic, (_SENSITIVITY, f"_{statistic}"))
    dataset, name = read_group(tree, group, source), f"{output}{suffix}"
    if name not in dataset.data_vars:
        return None
    variable = dataset.variables[name]
    renamed = {f"{output}_{old}": new for new, old in _DIMENSIONS.items()}
    dims = tuple(renamed.get(str(dim), str(dim)) for dim in variable.dims)
    if set(dims) - {BOUND} != set(CATALOGUE[statistic].dims):
        return None
    own = dict(variable.attrs)
    texts = dict(_texts(dataset, name, own, dims[:-1]))
    coordinates = dict(_coordinates(dataset, variable, output, renamed))
    of_group = dataset.attrs
    sample = read_group(tree, "statuses", source).attrs
    if group == _SENSITIVITY and sample and "blocks_used" not in own:
        # There the attributes were those of the blocks, also of what was of a sample among them.
        of_group = {**of_group, **sample}
        of_group = {key: v for key, v in of_group.items() if key in sample or key == "estimand"}
    attributes = {**own, **{key: v for key, v in of_group.items() if _is_of_runs(str(key))}}
    array = xr.DataArray(variable.values, {**coordinates, **texts}, dims, name, attributes)
    return reworded_array(array)


def _read_failures(tree: xr.DataTree, design: str) -> dict[str, xr.DataArray]:
    """Return the statistics of the failed runs of a design."""
    found = {}
    ends = read_group(tree, "statuses", design)
    if ends.data_vars:
        names = [str(name) for name in ends.data_vars]
        arrays = [ends[name] for name in names]
        ended = {key: [str(array.attrs.get(key, "")) for array in arrays] for key in INTERVAL_TEXTS}
        found["probability"] = estimate_array(
            np.stack([array.values for array in arrays]),
            {STATUS: len(names)},
            ended,
            units="1",
            long_name="probability that a run ends so",
            attributes={INTERVAL_LEVEL: 0.95, **ends.attrs},
        ).assign_coords(
            {STATUS: (STATUS, np.array(names, dtype=object), {"long_name": "end of a run"})}
        )
    associations = read_group(tree, "losses", design)
    for name, array in associations.data_vars.items():
        own = dict(array.attrs)
        texts = dict(_texts(associations, str(name), own, (INPUT,)))
        kept = {
            key: (each.dims, each.values, each.attrs)
            for key, each in array.coords.items()
            if key in (INPUT, BOUND)
        }
        found[str(name)] = xr.DataArray(array.values, {**kept, **texts}, array.dims, attrs=own)
        found[str(name)].attrs |= associations.attrs
    return {name: reworded_array(array) for name, array in found.items()}


def _is_of_runs(key: str) -> bool:
    """Return whether an attribute of a group is of the runs that its statistics are of."""
    return not key.endswith("_largest_contribution") and key != "source"


def _texts(
    dataset: xr.Dataset, name: str, attributes: dict[str, Any], renamed: tuple[str, ...]
) -> Iterator[tuple[str, tuple[Any, Any]]]:
    """Yield the methods of the intervals; remove those that stand in attributes."""
    variable = dataset.variables[name]
    if BOUND not in variable.dims:
        return
    prefixes = (name, *variable.dims[:-1])
    prefix = next((each for each in prefixes if f"{each}_{INTERVAL_LABEL}" in dataset.coords), "")
    for key in INTERVAL_TEXTS:
        own = str(attributes.pop(key, ""))
        if prefix:
            values = dataset.variables[f"{prefix}_{key}"].values.astype(object)
        else:
            values = np.full(variable.shape[:-1], own, dtype=object)
        yield key, (renamed, values)


def _coordinates(
    dataset: xr.Dataset, variable: xr.Variable, output: str, renamed: Mapping[str, str]
) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield the coordinates along a variable's dimensions by their present names."""
    for key in dataset.coords:
        name, coordinate = str(key), dataset.variables[key]
        if name.endswith(tuple(f"_{text}" for text in INTERVAL_TEXTS)):
            continue
        if not coordinate.dims or not set(coordinate.dims) <= set(variable.dims):
            continue
        along = next((old for old in renamed if name == old or name.startswith(f"{old}_")), None)
        called = name if along is None else renamed[along] + name.removeprefix(along)
        dims = tuple(renamed.get(str(dim), str(dim)) for dim in coordinate.dims)
        yield called, (dims, coordinate.values, coordinate.attrs)
