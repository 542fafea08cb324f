"""Faults of the archive of a benchmark of methods, besides those of the catalogue."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.groups import group_names, read_group
from uqpen.archive.structure import find_dataset_faults, has_kind
from uqpen.core.catalogue import (
    BENCHMARK_STATISTICS,
    CATALOGUE,
    COMPARISON_DIMENSIONS,
    COMPARISON_STATISTICS,
    METHOD_STATISTICS,
    comparison_statistics,
    method_statistics,
)
from uqpen.core.labels import (
    BUDGET,
    COMPARISON_GROUP,
    REFERENCE,
    REPEAT,
    REPLICATED,
    REPLICATES_OF_BUDGET,
    RUNS_OF_BUDGET,
    RUNS_SPENT,
    SINGLE,
    SOURCE,
    SOURCE_KIND,
    STATISTICS_GROUP,
    VARIANT,
    VARIANTS,
)
from uqpen.core.statistic import Statistic

__all__ = ["find_comparison_faults", "reference_name"]


# A group by the names on its path.
_Path = tuple[str, ...]

# Labels along dimensions, by the output that has them in common; empty for all outputs.
_Labels = dict[tuple[str, str], list[Any]]


def reference_name(tree: xr.DataTree) -> str:
    """Return the name of the source that errors are measured from."""
    kinds = {
        name: read_group(tree, STATISTICS_GROUP, name).attrs.get(SOURCE_KIND)
        for name in group_names(tree, STATISTICS_GROUP)
    }
    return next((name for name, kind in kinds.items() if kind == REFERENCE), REFERENCE)


def find_comparison_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield a line for each fault of such an archive."""
    reference = reference_name(tree)
    methods = [name for name in group_names(tree, STATISTICS_GROUP) if name != reference]
    if not methods:
        yield f"/{STATISTICS_GROUP}: no method that was given runs"
    for source, texts in {reference: (), **dict.fromkeys(methods, (SOURCE, VARIANTS))}.items():
        attributes = read_group(tree, STATISTICS_GROUP, source).attrs
        if RUNS_SPENT not in attributes or not all(
            isinstance(attributes.get(name), str) for name in texts
        ):
            yield f"/{STATISTICS_GROUP}/{source}: no {', '.join((RUNS_SPENT, *texts))}"
    outputs = group_names(tree, COMPARISON_GROUP)
    if not outputs:
        yield f"no {COMPARISON_GROUP}"
    known: _Labels = {("", VARIANT): [SINGLE, REPLICATED]}
    for output in outputs:
        yield from _output_faults(tree, output, methods, known)
    budgets = known.get(("", BUDGET), [0])
    if budgets[0] < 1 or sorted(set(budgets)) != budgets:
        yield f"/{STATISTICS_GROUP}: numbers of runs that do not ascend from 1"


def _output_faults(
    tree: xr.DataTree, output: str, methods: Sequence[str], known: _Labels
) -> Iterator[str]:
    """Yield the faults of the groups of an output; `known` are the labels of others."""
    truth = (STATISTICS_GROUP, reference_name(tree), output)
    verdicts = (COMPARISON_GROUP, output)
    catalogues: dict[_Path, Mapping[str, Statistic]] = {
        **{(STATISTICS_GROUP, method, output): METHOD_STATISTICS for method in methods},
        truth: CATALOGUE,
        verdicts: COMPARISON_STATISTICS,
    }
    groups = {path: read_group(tree, *path) for path in catalogues}
    for path, dataset in groups.items():
        if not dataset:
            yield f"{_place(path)}: no statistics"
            continue
        for fault in find_dataset_faults(dataset, catalogues[path], COMPARISON_DIMENSIONS):
            yield f"{_place(path)}: {fault}"
        for dimension in filter(dataset.indexes.__contains__, COMPARISON_DIMENSIONS):
            # An output has quantiles and thresholds of its own.
            of = "" if dimension in (VARIANT, BUDGET, REPEAT) else output
            found = dataset[dimension].values.tolist()
            if known.setdefault((of, dimension), found) != found:
                yield f"{_place(path)}: another {dimension} than elsewhere"
        if catalogues[path] is METHOD_STATISTICS and not _has_run_counts(dataset):
            beside = f"{RUNS_OF_BUDGET} and {REPLICATES_OF_BUDGET}"
            yield f"{_place(path)}: no {beside} along {BUDGET}"
    if not {"units", "display_units"} <= groups[verdicts].attrs.keys():
        yield f"{_place(verdicts)}: no units of the output"
    yield from _missing_statistics(groups, truth, verdicts)


def _has_run_counts(dataset: xr.Dataset) -> bool:
    """Return whether runs and replicates stand beside the budgets, and no runs lack replicates."""
    if not {RUNS_OF_BUDGET, REPLICATES_OF_BUDGET} <= dataset.coords.keys():
        return False
    runs, replicates = dataset[RUNS_OF_BUDGET], dataset[REPLICATES_OF_BUDGET]
    return bool(np.all((runs.values <= 0) | (replicates.values >= 1)))


def _missing_statistics(
    groups: Mapping[_Path, xr.Dataset], truth: _Path, verdicts: _Path
) -> Iterator[str]:
    """Find what the groups of an output lack of the statistics that methods are compared by."""
    is_compared = False
    for statistic in BENCHMARK_STATISTICS:
        needed = {path: [each.name for each in method_statistics(statistic)] for path in groups}
        needed[truth] = [statistic.name]
        needed[verdicts] = [each.name for each in comparison_statistics(statistic)]
        missing = {
            path: [n for n in names if n not in groups[path]] for path, names in needed.items()
        }
        # The reference has statistics besides.
        if all(missing[path] == needed[path] for path in groups if path != truth):
            continue
        is_compared = True
        for path, names in missing.items():
            yield from (f"{_place(path)}: no {name}" for name in names)
        if not missing[truth]:
            used = groups[truth][statistic.name].attrs.get("runs_used", "")
            if not has_kind(used, "count"):
                yield f"{_place(truth)}: no runs_used of {statistic.name}"
    if not is_compared:
        yield f"{_place(verdicts)}: no statistic that methods are compared by"


def _place(path: _Path) -> str:
    return f"/{'/'.join(path)}"
