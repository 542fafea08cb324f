"""Migration of benchmark archives of schema 2 to the present layout."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import xarray as xr

from uqpen.archive.benchmark_layout import BENCHMARK_GROUP, BENCHMARK_VARIABLES, ArchiveVariable
from uqpen.archive.estimates import pack
from uqpen.archive.schema_2 import read_statistic
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

# A source of the reference's statistics, as groups of a study had them.
_SOURCE = "reference"


def migrate_benchmark(tree: xr.DataTree) -> xr.DataTree:
    """Return a benchmark archive of schema 2 in the layout of schema 3.

    Parameters
    ----------
    tree : DataTree
        The archive as it was written. It is not modified, and the schema number does not change.
    """
    groups: dict[str, xr.Dataset] = {"/": tree.to_dataset(inherit=False)}
    outputs = [str(name) for name in _children(tree, _ESTIMATES)]
    old = {str(name): node.to_dataset() for name, node in _children(tree, REFERENCE).items()}
    gone = {REFERENCE, *(group for group, _ in _PLACES.values())}
    for name, node in tree.children.items():
        if name not in gone:
            groups |= {each.path: each.to_dataset(inherit=False) for each in node.subtree}
    for output, arrays in _statistics_by_output(old, outputs).items():
        groups[f"/{REFERENCE}/{output}"] = pack(arrays)
    groups |= _benchmark_groups(tree, outputs)
    return xr.DataTree.from_dict(groups)


def _statistics_by_output(
    groups: Mapping[str, xr.Dataset], outputs: Iterable[str]
) -> dict[str, dict[str, xr.DataArray]]:
    """Return the estimate arrays of one source by output and statistic.

    Parameters
    ----------
    groups : mapping of str to Dataset
        The statistics by group (``moments``, ``quantiles``, …), with variables named after their
        output.
    outputs : iterable of str
        The outputs' names.
    """
    tree = xr.DataTree.from_dict({f"/{group}/{_SOURCE}": told for group, told in groups.items()})
    return {output: dict(_statistics(tree, output)) for output in outputs}


def _statistics(tree: xr.DataTree, output: str) -> Iterator[tuple[str, xr.DataArray]]:
    for name in CATALOGUE:
        array = read_statistic(tree, _SOURCE, output, name)
        if array is not None:
            yield name, array.rename(name)


def _benchmark_groups(
    tree: xr.DataTree, outputs: Iterable[str]
) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the groups of the outputs and of their statistics, by their paths."""
    for output in outputs:
        estimates = _dataset(tree, _ESTIMATES, output)
        yield f"/{BENCHMARK_GROUP}/{output}", xr.Dataset(attrs=_output_attributes(estimates))
        for statistic in map(str, estimates.data_vars):
            found = {
                name: array
                for name, variable in BENCHMARK_VARIABLES.items()
                if (array := _variable(tree, output, statistic, variable)) is not None
            }
            yield f"/{BENCHMARK_GROUP}/{output}/{statistic}", xr.Dataset(found)


def _output_attributes(estimates: xr.Dataset) -> dict[str, str]:
    """Return what the variables of its mean said of an output."""
    told = estimates["mean"].attrs if "mean" in estimates else {}
    described = {key: str(told[key]) for key in ("units", "display_units") if key in told}
    return {"long_name": str(told.get("long_name", "")).removeprefix("mean of "), **described}


def _variable(
    tree: xr.DataTree, output: str, statistic: str, variable: ArchiveVariable
) -> xr.DataArray | None:
    group, suffix = _PLACES[variable.name]
    dataset, name = _dataset(tree, group, output), f"{statistic}{suffix}"
    return dataset[name] if name in dataset.data_vars else None


def _dataset(tree: xr.DataTree, group: str, output: str) -> xr.Dataset:
    outputs = _children(tree, group)
    return outputs[output].to_dataset(inherit=False) if output in outputs else xr.Dataset()


def _children(tree: xr.DataTree, group: str) -> Mapping[str, xr.DataTree]:
    return tree.children[group].children if group in tree.children else {}
