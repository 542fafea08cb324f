"""All estimates of an archive as one long table, and all runs as another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS
from uqpen.archive.fields import field_dimensions, place_text
from uqpen.archive.groups import DESIGN_GROUPS
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.blocks import LoadedDataset, block_ranges
from uqpen.core.catalogue import DIMENSIONS, UNLISTED_DIMENSIONS
from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    DECISION,
    DERIVED_INPUT,
    DIFFERENCES,
    EQUIVALENT_RUNS,
    FAILED_RUN,
    FAILURE_REASON,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    LOWER_THRESHOLD,
    NOTE,
    ROLE,
    RUN,
    RUNS,
    STATUS,
    SURROGATE_ESTIMATE,
    THRESHOLD,
)
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.core.variables import code_labels
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.acceptance import StatedDecision
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import label_with_unit

_BEFORE = ("model", "source", "kind", "output", "statistic", "coordinates")
# Numbers of entries whose labels are texts, such as a threshold as it was written.
_NUMBERS_OF_ENTRIES = [
    companion
    for labels in DIMENSIONS.values()
    for companion, kind in labels.companions.items()
    if kind == "number"
]
# Beside corrected estimates.
_CORRECTION = (SURROGATE_ESTIMATE, EQUIVALENT_RUNS)


def long_table(tree: xr.DataTree, *, functions: bool = False) -> pd.DataFrame:
    """Return the estimates of all models of an archive, and of the differences between them.

    Parameters
    ----------
    tree : DataTree
        An archive of a study.
    functions : bool
        Whether to list distribution functions, percentiles and convergence as well.

    Returns
    -------
    DataFrame
        One row for each entry of a statistic, in SI units. Columns ``model``, ``source``, ``kind``,
        ``output`` (empty for what is of the runs as a whole), ``statistic``, ``coordinates`` such
        as ``probability=0.95``, one for each dimension that is used (``probability``,
        ``threshold`` with the number ``threshold_value``, ``input`` …), ``estimate``, ``lower`` and
        ``upper`` (NaN where there is none), ``unit``, ``interval``, ``interval_label`` and
        ``note``. Corrected estimates add ``surrogate_estimate`` and ``equivalent_runs``. A design
        that decided a claim has a row of the statistic ``decision``: its probability with an
        interval that holds whenever the runs stop, and the verdict as its note; the event itself
        has no other interval. The model is empty where an archive has one alone and for the shares
        of model form, and such as ``fine minus coarse`` for a difference.

    Examples
    --------
    >>> tree = uqpen.open_archive("archives/rods.nc")  # doctest: +SKIP
    >>> table = long_table(tree)  # doctest: +SKIP
    >>> means = table[table["statistic"] == "mean"]  # doctest: +SKIP
    >>> means.pivot(index="output", columns="source")["estimate"]  # doctest: +SKIP
    """
    rows = [
        row
        for name, model in model_trees(tree).items()
        for row in statistics_rows(SourceStatistics(model), name, functions=functions)
    ]
    for other in group_names(tree, DIFFERENCES):
        differences = SourceStatistics.of_differences(tree, other)
        rows += statistics_rows(differences, other, functions=functions)
    rows += statistics_rows(SourceStatistics.of_model_form(tree), functions=functions)
    return rows_frame(rows)


def statistics_rows(
    statistics: SourceStatistics, model: str = "", *, functions: bool = False
) -> Iterator[dict[str, Any]]:
    """Yield the rows of one model, or of one difference, for `long_table`."""
    for source in statistics.sources:
        minus = statistics.minus(source) if statistics.is_difference else ""
        described = {
            "model": f"{model} minus {minus}" if minus else model,
            "source": source,
            "kind": statistics.kind(source),
        }
        for output in statistics.outputs:
            decision = None if statistics.is_difference else statistics.decision(source)
            for name, array in statistics.statistics(source, output).items():
                if functions or UNLISTED_DIMENSIONS.isdisjoint(map(str, array.dims)):
                    for row in estimate_rows(array, **described, output=output, statistic=name):
                        yield _with_decision(row, decision, statistics.si_unit(output))
            if decision is not None and decision.output == output:
                yield {
                    **described,
                    "output": decision.output,
                    "statistic": DECISION,
                    "coordinates": decision.claim,
                    "estimate": decision.probability,
                    "lower": decision.lower,
                    "upper": decision.upper,
                    "unit": DIMENSIONLESS,
                    INTERVAL: "holds whenever one stops",
                    INTERVAL_LABEL: "conservative",
                    NOTE: f"{decision.verdict_text}; {decision.guarantee}",
                }
        if not statistics.is_difference:
            yield from _rows_of_runs(statistics, source, described)


def _with_decision(
    row: dict[str, Any], decision: StatedDecision | None, unit: str
) -> dict[str, Any]:
    """Return a row; that of the event which a claim is on without its own interval.

    The runs stopped where they decided on this event. So its interval of a fixed number of runs
    does not hold, and that of the decision does.
    """
    names = (f"{THRESHOLD}_value", f"{LOWER_THRESHOLD}_value")
    value = next((float(row[name]) for name in names if name in row), math.nan)
    if decision is None or not decision.concerns(row["output"], row["statistic"], value, unit):
        return row
    none = {"lower": math.nan, "upper": math.nan, INTERVAL: "none", INTERVAL_LABEL: "none"}
    return row | none | {NOTE: "its interval is that of the decision"}


def _rows_of_runs(
    statistics: SourceStatistics, design: str, described: dict[str, str]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a design's runs as a whole."""
    runs = read_group(statistics.tree, RUNS, design)
    for group in sorted(DESIGN_GROUPS, key=lambda name: DESIGN_GROUPS[name].rank):
        for name, array in statistics.of_runs(group, design).items():
            for row in estimate_rows(array, **described, output="", statistic=name):
                # Values of an input are each in its own unit.
                if "units" not in array.attrs and row.get(INPUT) in runs:
                    row["unit"] = str(runs[row[INPUT]].attrs.get("units", ""))
                yield row


def estimate_rows(array: xr.DataArray, **described: str) -> Iterator[dict[str, Any]]:
    """Yield the entries of an estimate array, or of an array without bounds.

    Columns that are the same in all rows, such as ``source``, are passed by their names.
    """
    dims = [str(dim) for dim in array.dims if dim != BOUND]
    labels = [array[dim].values.tolist() for dim in dims]
    texts = {key: array.coords[key].values for key in INTERVAL_TEXTS if key in array.coords}
    numbers = {key: array.coords[key].values for key in _CORRECTION if key in array.coords}
    values_of = [name for name in _NUMBERS_OF_ENTRIES if name in array.coords]
    beside = {name: (array.coords[name].dims[0], array.coords[name].values) for name in values_of}
    unit = str(array.attrs.get("units", ""))
    for index in np.ndindex(*(array.sizes[dim] for dim in dims)):
        at = {dim: of_dim[i] for dim, of_dim, i in zip(dims, labels, index, strict=True)}
        yield {
            **described,
            "coordinates": ", ".join(f"{dim}={label}" for dim, label in at.items()),
            **at,
            **{
                key: float(values[index[dims.index(str(dim))]])
                for key, (dim, values) in beside.items()
            },
            **dict(zip(BOUNDS, np.ravel(array.values[index]).tolist(), strict=False)),
            **{key: float(values[index]) for key, values in numbers.items()},
            "unit": unit,
            **{key: str(values[index]) for key, values in texts.items()},
        }


def rows_frame(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return the table of rows, with a column for each dimension that is used.

    Where estimates are corrected, the surrogate's own figures and the numbers of plain runs stand
    last.
    """
    listed = list(rows)
    keys = {key for row in listed for key in row}
    behind = (*BOUNDS, "unit", *INTERVAL_TEXTS)
    corrections = [key for key in _CORRECTION if key in keys]
    used = keys.difference(_BEFORE, behind, corrections)
    known = [(name, *labels.companions) for name, labels in DIMENSIONS.items() if name in used]
    first = [name for names in known for name in names if name in used]
    columns: dict[str, Any] = dict.fromkeys(_BEFORE, "")
    columns |= dict.fromkeys([*first, *sorted(used.difference(first))])
    columns |= dict.fromkeys(behind, "") | dict.fromkeys((*BOUNDS, *corrections), np.nan)
    return pd.DataFrame(
        {name: [row.get(name, missing) for row in listed] for name, missing in columns.items()}
    )


# The runs.


def runs_table(tree: xr.DataTree, *, si: bool = False) -> pd.DataFrame:
    """Return the runs of all designs and models of an archive.

    Parameters
    ----------
    tree : DataTree
        An archive of a study.
    si : bool
        Whether values are in SI units, as the archive has them to the bit; else in the units of
        the study.

    Returns
    -------
    DataFrame
        The columns are ``model`` (where there are several), ``design``, ``run``, what the design
        says of a run (``replicate`` or ``weight``, say), the inputs and the outputs under headings
        ``name [unit]``, ``status`` and ``reason``. An output with dimensions has a column for each
        place. Outputs of failed runs are missing values.
    """
    designs = _designs(tree)
    if not designs:
        return pd.DataFrame()
    frames = [
        _design_table(runs, si=si).assign(model=model, design=design)
        for model, design, runs in designs
    ]
    table = pd.concat(frames, ignore_index=True).astype(_whole_numbers(designs))
    own = dict.fromkeys(name for *_, runs in designs for name in _run_coordinates(runs))
    before = [*(["model"] if len(model_trees(tree)) > 1 else []), "design", RUN, *own]
    behind = ["status", "reason"]
    between = [name for name in table if name not in {"model", *before, *behind}]
    return table[[*before, *between, *behind]]


def run_table_parts(tree: xr.DataTree, *, si: bool = False) -> Iterator[pd.DataFrame]:
    """Yield the table of `runs_table` by parts, none of more than 65 536 runs.

    All parts have its columns.
    """
    columns, designs = runs_table(_without_rows(tree), si=si).columns, _designs(tree)
    whole_numbers = _whole_numbers(designs)
    for model, design, archived in designs:
        runs = LoadedDataset(archived)
        for start, stop in block_ranges(runs.size):
            part = _design_table(runs.read(start, stop), si=si, start=start)
            named = part.assign(model=model, design=design)
            yield named.reindex(columns=columns).astype(whole_numbers)


def _without_rows(tree: xr.DataTree) -> xr.DataTree:
    """Return an archive with no run in any design."""
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    no_row = {RUN: slice(0), FAILED_RUN: slice(0)}
    return xr.DataTree.from_dict(
        {path: each.isel(no_row, missing_dims="ignore") for path, each in groups.items()}
    )


def designs_without_runs(tree: xr.DataTree) -> list[str]:
    """Return the designs whose runs an archive has not kept, each once."""
    return [*dict.fromkeys(name for _, name, runs in _designs(tree) if are_omitted(runs))]


def has_runs(tree: xr.DataTree) -> bool:
    """Return whether an archive has kept the runs of some design."""
    return not all(are_omitted(runs) for *_, runs in _designs(tree))


def _designs(tree: xr.DataTree) -> list[tuple[str, str, xr.Dataset]]:
    """Return the runs of each design of each model, behind the names of both."""
    return [
        (name, design, read_group(model, RUNS, design))
        for name, model in model_trees(tree).items()
        for design in group_names(model, RUNS)
    ]


def _run_coordinates(runs: xr.Dataset) -> dict[str, np.ndarray]:
    """Return what a design says of each run, such as its replicate."""
    return {
        str(name): coordinate.values
        for name, coordinate in runs.coords.items()
        if coordinate.dims == (RUN,) and name != RUN
    }


def _whole_numbers(designs: Iterable[tuple[str, str, xr.Dataset]]) -> dict[str, str]:
    """Return the type of each coordinate of runs that is a whole number wherever it is there.

    A design without replicates has missing values there, so the type is one with these.
    """
    kinds: dict[str, set[str]] = {}
    for *_, runs in designs:
        for name, values in _run_coordinates(runs).items():
            kinds.setdefault(name, set()).add(values.dtype.kind)
    return {name: "Int64" for name, found in kinds.items() if found <= {"i", "u"}}


def _design_table(runs: xr.Dataset, *, si: bool, start: int = 0) -> pd.DataFrame:
    """Return the runs of one design, given the number of the first."""
    size = runs.sizes[RUN]
    status = runs[STATUS].values
    columns = {RUN: np.arange(start, start + size), **_run_coordinates(runs)}
    for role in ("input", DERIVED_INPUT, "output"):
        for variable in runs.data_vars.values():
            if variable.attrs.get(ROLE) == role:
                columns |= dict(_variable_columns(variable, size, status == Status.OK, si=si))
    reasons = pd.Series([""] * size, dtype=object)
    if FAILURE_REASON in runs:
        reasons[runs[FAILED_RUN].values - start] = runs[FAILURE_REASON].values
    texts = [STATUS_TEXT[Status(int(each))] for each in status]
    return pd.DataFrame({**columns, "status": texts, "reason": reasons})


def _variable_columns(
    variable: xr.DataArray, size: int, completed: np.ndarray, *, si: bool
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the columns of an input or an output with their headings."""
    name = str(variable.name)
    if (of_codes := code_labels(variable.attrs)) and not si:
        words = np.array(of_codes, dtype=object)
        yield name, np.broadcast_to(words[np.asarray(variable.values).astype(int)], size)
        return
    if "flag_values" in variable.attrs:
        labels = category_labels(variable)
        kinds = zip(variable.values.tolist(), completed, strict=True)
        texts = [labels[code] if is_completed else None for code, is_completed in kinds]
        yield name, np.array(texts, dtype=object)
        return
    shown = "units" if si else "display_units"
    unit = str(variable.attrs.get(shown, variable.attrs.get("units", DIMENSIONLESS)))
    values = np.asarray(variable.values, dtype=np.float64)
    values = values if si else scale(unit).from_si(values)
    along = [variable.sizes[dimension] for dimension in field_dimensions(variable)]
    for place in np.ndindex(*along):
        heading = label_with_unit(f"{name}{place_text(variable, (0, *place))}", unit)
        yield heading, np.broadcast_to(values[(..., *place)], size)


def category_labels(variable: xr.DataArray) -> dict[int, str]:
    """Return the labels of an output's categories by code; that of failed runs is "lost"."""
    words = str(variable.attrs.get("flag_meanings", "")).split()
    labels = np.atleast_1d(variable.attrs.get("flag_labels", words))
    codes = np.atleast_1d(variable.attrs["flag_values"]).tolist()
    return dict(zip(codes, map(str, labels), strict=True))
