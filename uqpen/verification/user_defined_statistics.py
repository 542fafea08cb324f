"""Statistics of an archive that user-defined analyses have yielded."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import xarray as xr

from uqpen.archive.estimates import interval_codes_name, statistic_names
from uqpen.archive.groups import model_trees
from uqpen.core.catalogue import CATALOGUE, DIMENSIONS
from uqpen.core.labels import BOUND, SOURCE_KIND, STATISTICS_GROUP, SURROGATES, TRAJECTORY

__all__ = [
    "user_defined_statistic_names",
    "without_distributions",
    "without_groups",
    "without_surrogates",
    "without_user_defined_statistics",
]

_BUILT_IN_COORDINATES = {
    BOUND,
    *DIMENSIONS,
    *(name for dimension in DIMENSIONS.values() for name in dimension.companions),
}


def user_defined_statistic_names(tree: xr.DataTree) -> list[str]:
    """Return the statistics of designs of a study's archive that are not built in, each once."""
    return sorted({name for node in _output_nodes(tree) for name in _user_defined(node.dataset)})


def without_user_defined_statistics(tree: xr.DataTree) -> xr.DataTree:
    """Return a copy of a study's archive without the statistics that are not built in."""
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    for node in _output_nodes(tree):
        groups[node.path] = _built_in(groups[node.path])
    return xr.DataTree.from_dict(groups)


def without_distributions(tree: xr.DataTree) -> xr.DataTree:
    """Return a copy of a study's archive without the results that need the distributions.

    They are surrogates, their statistics, and the trajectory at the nominal inputs.
    """
    dropped = []
    for model in model_trees(tree).values():
        dropped += [model.children[name] for name in (SURROGATES, TRAJECTORY) if name in model]
        sources = model.children.get(STATISTICS_GROUP, xr.DataTree()).children.values()
        dropped += [each for each in sources if each.attrs.get(SOURCE_KIND) == "surrogate"]
    return without_groups(tree, dropped)


def without_surrogates(tree: xr.DataTree, names: Collection[str]) -> xr.DataTree:
    """Return a copy of a study's archive without some surrogates and their statistics."""
    groups = [
        model.children[group]
        for model in model_trees(tree).values()
        for group in (SURROGATES, STATISTICS_GROUP)
        if group in model.children
    ]
    dropped = [group.children[name] for group in groups for name in names if name in group.children]
    # A group of which nothing is left is not made again.
    dropped += [group for group in groups if set(names).issuperset(group.children)]
    return without_groups(tree, dropped)


def without_groups(tree: xr.DataTree, dropped: Iterable[xr.DataTree]) -> xr.DataTree:
    """Return a copy of an archive without some groups and what is in them."""
    without = {node.path for top in dropped for node in top.subtree}
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    return xr.DataTree.from_dict({path: groups[path] for path in groups if path not in without})


def _output_nodes(tree: xr.DataTree) -> list[xr.DataTree]:
    """Return the groups of each design's statistics of an output."""
    return [
        output
        for model in model_trees(tree).values()
        if STATISTICS_GROUP in model.children
        for source in model.children[STATISTICS_GROUP].children.values()
        if source.attrs.get(SOURCE_KIND) == "design"
        for output in source.children.values()
    ]


def _user_defined(dataset: xr.Dataset) -> list[str]:
    return [name for name in statistic_names(dataset) if name not in CATALOGUE]


def _built_in(dataset: xr.Dataset) -> xr.Dataset:
    """Return a group without user-defined statistics and the coordinates that only they need."""
    added = _user_defined(dataset)
    codes = map(interval_codes_name, added)
    kept = dataset.drop_vars([*added, *codes], errors="ignore")
    used = {dim for name in kept.data_vars for dim in kept[name].dims}
    unneeded = [
        name
        for name, coordinate in kept.coords.items()
        if name not in _BUILT_IN_COORDINATES or not used.issuperset(coordinate.dims)
    ]
    return kept if not added else kept.drop_vars(unneeded)
