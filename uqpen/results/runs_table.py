"""All runs of an archive as one table: a row for each run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd
import xarray as xr

from uqpen.archive.fields import field_dimensions, place_text
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.blocks import LoadedDataset, block_ranges
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, ROLE, RUN, RUNS, STATUS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.table import label_with_unit

__all__ = ["designs_without_runs", "has_runs", "run_table_parts", "runs_table"]


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
    for role in ("input", "output"):
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
    if "flag_values" in variable.attrs:
        yield name, _category_labels(variable, completed)
        return
    shown = "units" if si else "display_units"
    unit = str(variable.attrs.get(shown, variable.attrs.get("units", DIMENSIONLESS)))
    values = np.asarray(variable.values, dtype=np.float64)
    values = values if si else scale(unit).from_si(values)
    along = [variable.sizes[dimension] for dimension in field_dimensions(variable)]
    for place in np.ndindex(*along):
        heading = label_with_unit(f"{name}{place_text(variable, (0, *place))}", unit)
        yield heading, np.broadcast_to(values[(..., *place)], size)


def _category_labels(variable: xr.DataArray, completed: np.ndarray) -> np.ndarray:
    """Return the category of each run in words; empty for a failed run."""
    words = str(variable.attrs.get("flag_meanings", "")).split()
    labels = np.atleast_1d(variable.attrs.get("flag_labels", words)).tolist()
    numbers = np.atleast_1d(variable.attrs["flag_values"]).tolist()
    known = dict(zip(numbers, map(str, labels), strict=True))
    texts = [
        known[int(number)] if is_completed else None
        for number, is_completed in zip(variable.values, completed, strict=True)
    ]
    return np.array(texts, dtype=object)
