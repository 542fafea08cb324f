"""Migration of benchmark archives of schema 2 to the present layout."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import xarray as xr

from uqpen.archive.benchmark_layout import BENCHMARK_GROUP, BENCHMARK_VARIABLES
from uqpen.archive.estimates import pack
from uqpen.archive.schema_2 import read_statistic
from uqpen.archive.tree import group_names, read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import REFERENCE

__all__ = ["migrate_benchmark"]

_ESTIMATES, _VERDICTS = "estimates", "verdicts"

# The group of each variable, and what followed the statistic in its name.
_PLACES = {
    "estimate": (_ESTIMATES, ""),
    "error": ("errors", ""),
    "coverage": ("errors", "_coverage"),
    "scale": ("errors", "_scale"),
    "slope": ("slopes", ""),
    "winner": (_VERDICTS, "_winner"),
    "runner_up": (_VERDICTS, "_runner_up"),
    "level": (_VERDICTS, "_level"),
    "verdict": (_VERDICTS, "_verdict"),
    "remark": (_VERDICTS, "_note"),
    "lead": (_VERDICTS, "_lead"),
}

# The name by which the reference is a source, as those of a study were.
_SOURCE = "reference"


def migrate_benchmark(tree: xr.DataTree) -> xr.DataTree:
    """Return a copy of a benchmark archive of schema 2 in the layout of schema 3."""
    groups = {"/": tree.to_dataset(inherit=False)}
    outputs = group_names(tree, _ESTIMATES)
    gone = {REFERENCE, *(group for group, _ in _PLACES.values())}
    for name, node in tree.children.items():
        if name not in gone:
            groups |= {each.path: each.to_dataset(inherit=False) for each in node.subtree}
    reference = xr.DataTree.from_dict(
        {
            f"/{kind}/{_SOURCE}": read_group(tree, REFERENCE, kind)
            for kind in group_names(tree, REFERENCE)
        }
    )
    for output in outputs:
        arrays = {name: read_statistic(reference, _SOURCE, output, name) for name in CATALOGUE}
        statistics = {
            name: array.rename(name) for name, array in arrays.items() if array is not None
        }
        groups[f"/{REFERENCE}/{output}"] = pack(statistics)
    groups |= _benchmark_groups(tree, outputs)
    return xr.DataTree.from_dict(groups)


def _benchmark_groups(
    tree: xr.DataTree, outputs: Iterable[str]
) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the groups of the outputs and of their statistics, by their paths."""
    for output in outputs:
        estimates = read_group(tree, _ESTIMATES, output)
        yield f"/{BENCHMARK_GROUP}/{output}", xr.Dataset(attrs=_output_attributes(estimates))
        for statistic in map(str, estimates.data_vars):
            found = {}
            for name in BENCHMARK_VARIABLES:
                group, suffix = _PLACES[name]
                dataset = read_group(tree, group, output)
                if f"{statistic}{suffix}" in dataset.data_vars:
                    found[name] = dataset[f"{statistic}{suffix}"]
            yield f"/{BENCHMARK_GROUP}/{output}/{statistic}", xr.Dataset(found)


def _output_attributes(estimates: xr.Dataset) -> dict[str, str]:
    """Return the attributes of an output, from the variables of its mean."""
    attributes = estimates["mean"].attrs if "mean" in estimates else {}
    described = {
        key: str(attributes[key]) for key in ("units", "display_units") if key in attributes
    }
    return {"long_name": str(attributes.get("long_name", "")).removeprefix("mean of "), **described}
