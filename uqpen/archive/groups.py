"""Groups of an archive: the declaration of each, and parts of the tree by their names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from uqpen.core.catalogue import (
    BOUND_STATISTICS,
    CALIBRATION_STATISTICS,
    CATALOGUE,
    FAILURE_STATISTICS,
    JOINT_STATISTICS,
    MODEL_FORM_STATISTICS,
    VALIDATION_STATISTICS,
)
from uqpen.core.labels import (
    BENCHMARK,
    BOUNDS_GROUP,
    CALIBRATIONS,
    DIFFERENCES,
    FAILURES_GROUP,
    FILES,
    JOINT_GROUP,
    KIND,
    MODEL_FORM,
    MODELS,
    NOISE,
    RUNS,
    STATISTICS_GROUP,
    SURROGATES,
    TRAJECTORY,
    VALIDATION,
)
from uqpen.core.statistic import Statistic

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class Group:
    """Declaration of a group, by which it is written, checked, repeated, compared and shown.

    References are texts, so that whoever opens an archive loads neither estimators nor tables.
    """

    # What the groups in it are named by, from outside to inside; none if it has variables itself.
    levels: tuple[str, ...] = ()
    is_of_model: bool = True  # true if each model of an archive has one of its own
    # Records of the statistics in its innermost groups, by which their form is checked.
    statistics: Mapping[str, Statistic] = field(default_factory=dict)
    # Reference to a function of the group. It yields faults that the records do not show, each with
    # the path below the group.
    check: str = ""
    # Of statistics of a design's runs as a whole: reference to a function of the study, the name of
    # the design and these runs, which returns the statistics.
    writer: str = ""
    # False for what `uqpen verify` does not compute again from the archived runs.
    is_repeated: bool = True
    # True if its values lie along the dimensions of fields, and are shown at a place of them.
    is_along_fields: bool = False
    # Reference to a function of the tree that has the group, which yields its tables. Without one,
    # statistics of a design's runs as a whole are a table by their records.
    tables: str = ""
    # Reference to a function of the statistics of a model and the name of a design, which returns
    # keys and values for the design. Without one, statistics by `writer` are JSON by their records.
    json: str = ""
    rank: int = 99  # place of its tables and of its rows in the long table
    title: str = ""  # title of the table by its records


# In the order in which they are written and checked.
GROUPS: Mapping[str, Group] = {
    RUNS: Group(
        levels=("design",),
        check="uqpen.archive.structure:find_run_faults",
        is_repeated=False,
        is_along_fields=True,
    ),
    # Runs that were made twice, to see noise of the model.
    NOISE: Group(
        levels=("design",), check="uqpen.archive.structure:find_pair_faults", is_repeated=False
    ),
    STATISTICS_GROUP: Group(
        levels=("source", "output"),
        statistics=CATALOGUE,
        check="uqpen.archive.structure:find_source_faults",
        is_along_fields=True,
    ),
    FAILURES_GROUP: Group(
        levels=("design",),
        statistics=FAILURE_STATISTICS,
        writer="uqpen.workflow.model_groups:failure_statistics",
        tables="uqpen.results.failed_runs:failure_tables",
        json="uqpen.results.failed_runs:failure_json",
        rank=2,
    ),
    JOINT_GROUP: Group(
        levels=("design",),
        statistics=JOINT_STATISTICS,
        writer="uqpen.workflow.model_groups:joint_statistics",
        tables="uqpen.results.joint_probabilities:joint_tables",
        json="uqpen.results.joint_probabilities:joint_json",
        rank=1,
    ),
    BOUNDS_GROUP: Group(
        levels=("design",),
        statistics=BOUND_STATISTICS,
        writer="uqpen.workflow.model_groups:bound_statistics",
        tables="uqpen.results.found_bounds:bound_tables",
        json="uqpen.results.found_bounds:bound_json",
        rank=1,
    ),
    CALIBRATIONS: Group(
        levels=("design",),
        statistics=CALIBRATION_STATISTICS,
        writer="uqpen.workflow.model_groups:calibration_statistics",
        tables="uqpen.results.calibrations:calibration_tables",
        rank=1,
    ),
    # Of each output that was measured, at the experiments of a design.
    VALIDATION: Group(
        levels=("design", "output"),
        statistics=VALIDATION_STATISTICS,
        tables="uqpen.results.validations:validation_tables",
        json="uqpen.results.validations:validation_json",
        rank=0,
    ),
    SURROGATES: Group(
        levels=("surrogate", "output"), check="uqpen.archive.structure:find_surrogate_faults"
    ),
    TRAJECTORY: Group(),
    DIFFERENCES: Group(
        levels=("model", "design", "output"),
        is_of_model=False,
        statistics=CATALOGUE,
        check="uqpen.archive.structure:find_difference_faults",
        is_along_fields=True,
        tables="uqpen.results.output_tables:difference_tables",
        rank=3,
    ),
    MODEL_FORM: Group(
        levels=("design", "output"),
        is_of_model=False,
        statistics=MODEL_FORM_STATISTICS,
        tables="uqpen.results.output_tables:model_form_tables",
        rank=4,
    ),
    FILES: Group(
        is_of_model=False, check="uqpen.archive.files:find_file_faults", is_repeated=False
    ),
}

# Those with statistics of each design's runs as a whole.
DESIGN_GROUPS = {name: group for name, group in GROUPS.items() if group.writer}


def group_place(path: str) -> tuple[str, dict[str, str]]:
    """Return which declared group a path of an archive leads to or into, and the names on its way.

    >>> group_place("/models/fine/statistics/mc/depth")
    ('statistics', {'source': 'mc', 'output': 'depth'})
    """
    parts = path.strip("/").split("/")
    name, *below = parts[2:] or [""] if parts[0] == MODELS else parts
    levels = GROUPS[name].levels if name in GROUPS else ()
    return name, dict(zip(levels, below, strict=False))


def innermost_groups(node: xr.DataTree, depth: int) -> Iterator[tuple[str, xr.DataTree]]:
    """Yield the groups at a depth below a group, each with its path from there."""
    if depth == 0:
        yield "", node
        return
    for name, child in node.children.items():
        for path, inner in innermost_groups(child, depth - 1):
            yield f"/{name}{path}", inner


def model_trees(tree: xr.DataTree) -> dict[str, xr.DataTree]:
    """Return the group of each model by its name; for a single model, the archive as ``""``."""
    if MODELS not in tree.children:
        return {"": tree}
    return {str(name): model for name, model in tree.children[MODELS].children.items()}


def is_benchmark(tree: xr.DataTree) -> bool:
    """Return True for the archive of a benchmark of methods, False for that of a study."""
    return bool(tree.attrs.get(KIND) == BENCHMARK)


def group_names(tree: xr.DataTree, name: str) -> list[str]:
    """Return the names of the groups in a group of the root, such as the designs with runs."""
    return list(tree.children[name].children) if name in tree.children else []


def read_group(tree: xr.DataTree, *path: str) -> xr.Dataset:
    """Return the dataset of a group; an empty one where the archive has none."""
    for name in path:
        if name not in tree.children:
            import xarray as xr

            return xr.Dataset()
        tree = tree.children[name]
    return tree.to_dataset(inherit=False)
