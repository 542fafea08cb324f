"""A model compared with measurements: what the tests say, and a row for each measured value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import UnpackedStatistics
from uqpen.archive.groups import group_names, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    MEASURED_CONDITION,
    RUNS,
    SAMPLING,
    VALIDATION,
)
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import AcceptanceVerdict
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.results.digits import count_text, estimate_text, number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    entries_json,
    identity,
    label_with_unit,
    shown_unit,
)
from uqpen.results.texts import unit_suffix

# Rows of a table on a screen; JSON and the archive have all.
_MOST_ROWS = 20
# Below this p value, agreement is unlikely; the level of the joint test.
UNLIKELY = 0.05


@dataclass(frozen=True, eq=False)
class MeasuredRows:
    """Measured values of an output beside what a design says of the model there."""

    design: str
    output: str
    statistics: Mapping[str, xr.DataArray]
    runs: xr.Dataset  # of the design: units and names

    @property
    def are_fresh(self) -> bool:
        """True for values that were held out: a validation of a posterior has no others."""
        return self.runs.attrs[SAMPLING] == Sampling.POSTERIOR

    @property
    def unit(self) -> str:
        """Unit that the output is shown in."""
        return shown_unit(self.runs[self.output].attrs)

    @property
    def scale(self) -> Scale:
        """Scale of that unit."""
        return scale(self.unit)

    def values(self, name: str) -> FloatArray:
        """Return a statistic of each row, in the unit that is shown."""
        found = np.asarray(self.statistics[name].values, dtype=np.float64)
        is_difference = name in ("measured_std", "predicted_std", "validation_uncertainty")
        convert = self.scale.difference_from_si if is_difference else self.scale.from_si
        shown: FloatArray = convert(found)
        return shown

    @cached_property
    def conditions(self) -> dict[str, tuple[str, FloatArray]]:
        """Conditions and places that differ: by name, the unit and the value of each row."""
        whole = self.statistics.get("condition")
        if whole is None:
            return {}
        found = {}
        for name, values in zip(whole[MEASURED_CONDITION].values, whole.values.T, strict=True):
            if np.ptp(values) > 0:  # not where any is NaN
                unit = shown_unit(self.runs[name].attrs if name in self.runs.variables else {})
                found[str(name)] = unit, np.asarray(scale(unit).from_si(values))
        return found

    def label(self, row: int) -> str:
        """Return the label of a row: its experiment, or the row itself, with the conditions.

        Experiments that were held out have numbers behind all others, which no file has.
        """
        parts = [
            f"{name} {number_text(float(values[row]), 6)}{unit_suffix(unit)}"
            for name, (unit, values) in self.conditions.items()
        ]
        in_file = self.statistics.get("file_row") if self.are_fresh else None
        experiment = str(int(self.statistics["experiment_number"][row]))
        head = experiment if in_file is None else f"row {int(in_file[row])}"
        return ", ".join([head, *parts])


def measured_rows(tree: xr.DataTree) -> Iterator[MeasuredRows]:
    """Yield the rows of each output and design at experiments of a model."""
    for design in group_names(tree, VALIDATION):
        runs = read_group(tree, RUNS, design)
        for output in tree.children[VALIDATION].children[design].children:
            group = read_group(tree, VALIDATION, design, output)
            yield MeasuredRows(design, output, UnpackedStatistics(group), runs)


# Statements, for the end of a command and the head of a page.


def validation_statements(tree: xr.DataTree) -> Iterator[tuple[str, str]]:
    """Yield what a validation says of each output, below a head of a few words."""
    for each in measured_rows(tree):
        yield each.output, " ".join(_sentences(each))


def _sentences(of: MeasuredRows) -> Iterator[str]:
    joint, draws = of.statistics.get("joint_p_value"), of.statistics.get("draws")
    values = count_text(of.statistics["experiment_number"].size, "measured value")
    by = f"by {count_text(0 if draws is None else int(draws), 'draw')} of {of.design}"
    if joint is None or not np.isfinite(joint.values[0]):
        reason = "no draw has completed" if joint is None else str(joint["note"].item())
        yield f"The model and {values} ({by}) have no joint test: {reason}."
    else:
        is_unlikely = joint.values[0] < UNLIKELY
        what = "The model disagrees with" if is_unlikely else "Nothing speaks against the model in"
        p_value = number_text(float(joint.values[0]), 2)
        yield f"{what} {values} together ({by}): p = {p_value}."
    if (verdict := of.statistics.get("verdict")) is not None:
        rows = of.statistics["row_verdict"].values.tolist()
        count = {name: rows.count(str(name)) for name in AcceptanceVerdict}
        shown = ", ".join(f"{number} {name}" for name, number in count.items() if number)
        yield f"What is accepted is {verdict.item()} (each value by itself: {shown})."
    if (seen := of.statistics.get("detectable_common_error")) is not None and np.isfinite(
        seen.values[0]
    ):
        size = number_text(float(of.scale.difference_from_si(seen.values[0])), 2)
        yield f"An error below {size}{unit_suffix(of.unit)} in all values would not be seen."
    used = of.statistics.get("used_before")
    if used is not None and used.values.any():
        number = count_text(int(used.values.sum()), "value")
        yield f"Inputs were fitted to {number} of them, which no test counts."


# Tables.


def validation_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield two tables for each output at the experiments of a design: of its rows, of all."""
    for each in measured_rows(tree):
        yield _rows_table(each)
        yield _tests_table(each)


def _rows_table(of: MeasuredRows) -> OutputTable:
    verdicts = of.statistics.get("row_verdict")
    where = "values held out of" if of.are_fresh else "the experiments of"
    title = label_with_unit(f"{of.output} at {where} {of.design}", of.unit)
    columns = ["measured", "model", "error", "z", *["verdict"] * (verdicts is not None)]
    table = OutputTable(title, columns)
    rows = of.statistics["experiment_number"].size
    if "measured" not in of.statistics:
        return table

    def with_std(value: str, std: str, row: int) -> str:
        middle, spread = float(of.values(value)[row]), float(of.values(std)[row])
        return estimate_text(middle, middle - spread, middle + spread)

    for row in range(min(rows, _MOST_ROWS)):
        sign = {1: "≥ ", 0: "", -1: "≤ "}[int(of.statistics["bound_side"][row])]
        cells = [
            f"{sign}{with_std('measured', 'measured_std', row)}",
            with_std("predicted_mean", "predicted_std", row),
            table.cell(of.statistics["comparison_error"][row], of.scale.difference_from_si),
            number_text(float(of.statistics["z_score"][row]), 3),
        ]
        if verdicts is not None:
            cells.append(str(verdicts.values[row]))
        table.rows.append((of.label(row), cells))
    mark = table.note_mark("± one standard deviation; the error ± k times its uncertainty")
    table.columns[0] += mark
    if rows > _MOST_ROWS:
        more = count_text(rows - _MOST_ROWS, "more row")
        table.title += table.note_mark(f"the archive and JSON have {more}")
    return table


# Of all rows: the statistic, its label, and whether it is in the unit of the output.
_TESTS = (
    ("joint_p_value", "all values together: p", False),
    ("share_inside", "share inside the band", False),
    ("share_p_value", "share inside: p by draws", False),
    ("area", "area metric", False),
    ("area_null", "area metric of no error: mean", False),
    ("area_null_quantile", "area metric of no error: quantile at the level", False),
    ("area_p_value", "area metric: p by draws", False),
    ("ks_p_value", "distribution of the PIT: p by draws", False),
    ("detectable_common_error", "error in all values that is found in 80 %", True),
    ("mean_crps", "mean score (CRPS)", True),
    ("score_difference", "score of the first model minus this one", True),
    ("residual_p_value", "residuals of values used before: p", False),
)


def _tests_table(of: MeasuredRows) -> OutputTable:
    table = OutputTable(f"{of.output}: all values of {of.design}", ["value"])
    for name, label, has_unit in _TESTS:
        if (array := of.statistics.get(name)) is None:
            continue
        convert = of.scale.difference_from_si if has_unit else identity
        if array.dims:
            text = table.cell(array, convert)
        else:
            value = float(convert(float(array)))
            text = NOTHING if math.isnan(value) else number_text(value, 3)
        label = label_with_unit(label, of.unit if has_unit else DIMENSIONLESS)
        table.rows.append((label, [text]))
    return table


def validation_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return what measurements say of a model at the experiments of a design, by output."""
    found = {
        each.output: {
            "units": str(each.runs[each.output].attrs.get("units", DIMENSIONLESS)),
            **{name: entries_json(array) for name, array in each.statistics.items()},
        }
        for each in measured_rows(statistics.tree)
        if each.design == design
    }
    return {VALIDATION: found} if found else {}
