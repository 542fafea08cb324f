"""Estimates for a person, as the cells of a table with its notes, and for a script, as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.archive.fields import coordinate_text
from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUND,
    COMPARISON_GROUP,
    EQUIVALENT_RUNS,
    ESTIMATOR,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    NOTE,
    PAIR,
    ROLE,
    RUNS,
    SURROGATE_ESTIMATE,
    THRESHOLD,
)
from uqpen.core.statistic import Shown, Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS, Scale
from uqpen.results.digits import SUPERSCRIPTS, estimate_text, percent_text
from uqpen.statistics.texts import DOUBTFUL_TAIL, OF_THE_MEAN, OF_THE_WHOLE, SIZES_OF_EVENT

Conversion = Callable[[Any], Any]

# A smaller sensitivity measure is 0 but for rounding: closed forms give 2e-20 or -4e-8.
_ROUNDING = 1e-6

# The cell of a source that has no estimate.
NOTHING = "–"


def identity(values: Any) -> Any:
    """Return values without a unit as they are, whatever unit their output is shown in."""
    return values


@dataclass
class OutputTable:
    """A table of one output, with a column for each source.

    Parameters
    ----------
    title : str
        Name of the output, with the unit of the estimates.
    columns : list of str
        Sources: designs and surrogates.
    rows : list
        A label, and a cell for each column.
    notes : list of str
        The notes that superscript numbers in cells refer to, in order.
    """

    title: str
    columns: list[str]
    rows: list[tuple[str, list[str]]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def note_mark(self, *notes: str) -> str:
        """Return the superscripts of notes, which are added if they are new; none for no note."""
        marks = ""
        for note in filter(None, notes):
            if note not in self.notes:
                self.notes.append(note)
            marks += " " + str(self.notes.index(note) + 1).translate(SUPERSCRIPTS)
        return marks

    def cell(
        self,
        array: xr.DataArray | None,
        convert: Conversion = identity,
        *,
        is_logarithmic: bool = False,
    ) -> str:
        """Return an estimate in the digits that it has, with the mark of its remark."""
        if array is None:
            return NOTHING
        shown = shown_estimate(array, convert, is_logarithmic=is_logarithmic)
        return shown + self.note_mark(estimate_remark(array))

    def cells(
        self,
        arrays: Mapping[str, xr.DataArray],
        convert: Conversion = identity,
        *,
        is_logarithmic: bool = False,
    ) -> list[str]:
        """Return the cells of a row from the estimates by source."""
        return [
            self.cell(arrays.get(source), convert, is_logarithmic=is_logarithmic)
            for source in self.columns
        ]


def shown_estimate(
    array: xr.DataArray, convert: Conversion, *, is_logarithmic: bool = False
) -> str:
    """Return an estimate in the digits that it has, on a linear or a logarithmic scale."""
    # What no runs and no estimator have given is published, in digits of its own.
    is_published = not {"runs", ESTIMATOR} & array.attrs.keys()
    return estimate_text(
        *shown_bounds(array, convert), is_short=is_published, is_logarithmic=is_logarithmic
    )


def shown_bounds(array: xr.DataArray, convert: Conversion) -> list[float]:
    """Return an estimate and its bounds in the shown unit; 0 for what is 0 but for rounding."""
    values = [float(value) for value in convert(array.values)]
    of_inputs = array.name in CATALOGUE and not {INPUT, PAIR}.isdisjoint(array.coords)
    is_plain = of_inputs and CATALOGUE[str(array.name)].unit is UnitRule.NONE
    if is_plain and abs(values[0]) < _ROUNDING:
        values[0] = 0.0
    return values


def conversion(statistic: Statistic, shown: Scale, *, is_difference: bool = False) -> Conversion:
    """Return the conversion of a statistic from SI to the scale that its output is shown in.

    With `is_difference`, it is a statistic of the difference of two models.
    """
    if statistic.measure.relative_to:
        return lambda values: values * 100.0
    if statistic.unit is UnitRule.NONE:
        return identity
    is_value = statistic.unit is UnitRule.VALUE and not is_difference
    return shown.from_si if is_value else shown.difference_from_si


def shown_unit(attributes: Mapping[Any, Any]) -> str:
    """Return the unit that a variable with some attributes is shown in."""
    return str(attributes.get("display_units", DIMENSIONLESS))


def label_with_unit(label: str, unit: str) -> str:
    """Return a label and, in brackets, its unit, if it has one."""
    return label if unit == DIMENSIONLESS else f"{label} [{unit}]"


def cut_coordinates(variable: xr.DataArray) -> Iterator[xr.DataArray]:
    """Yield the coordinates of the place to which a field was cut; none of another output."""
    for name, coordinate in variable.coords.items():
        if not coordinate.dims and "units" in coordinate.attrs:
            yield coordinate.rename(name)


def cut_text(variable: xr.DataArray) -> str:
    """Return the place to which a field was cut, such as ``time = 10 day``; empty without one."""
    return ", ".join(coordinate_text(each, each.item()) for each in cut_coordinates(variable))


def quantile_label(probability: float) -> str:
    """Return the label of a quantile in a table."""
    return "median" if probability == 0.5 else f"{percent_text(probability)} quantile"


def exceedance_label(threshold: str) -> str:
    """Return the label of an exceedance probability, from the value as it was written."""
    return entry_label(_OF_THRESHOLD, threshold)


# The probability that a threshold is of.
_OF_THRESHOLD = next(
    each for each in CATALOGUE.values() if each.own is not None and each.own.name == THRESHOLD
)

# How an entry of a statistic is written, by its kind.
_WRITTEN: Mapping[str, Callable[[Any], str]] = {
    "text": str,
    "number": "{:.10g}".format,
    "percent": percent_text,
    "probability": quantile_label,
}


def entry_label(statistic: Statistic, entry: Any) -> str:
    """Return the label of an entry of a statistic in a table or a list."""
    return statistic.shown.label.replace("{entry}", entry_text(statistic.shown, entry))


def entry_text(shown: Shown, entry: Any) -> str:
    """Return an entry of a statistic as its label and its sentence have it."""
    return _WRITTEN[shown.entry](entry)


def estimate_remark(array: xr.DataArray) -> str:
    """Return the remark on an estimate for a reader; empty for none."""
    note = interval_text(array, NOTE)
    if not note and interval_text(array, INTERVAL_LABEL) == "conservative":
        return "conservative: the interval may be wider than it need be"
    return note


_OF_ALL = frozenset((DOUBTFUL_TAIL, OF_THE_MEAN, OF_THE_WHOLE))


def telling_note(array: xr.DataArray) -> str:
    """Return the note of an estimate without what all of as few runs, or with noise, have."""
    parts = interval_text(array, NOTE).split("; ")
    counted = SIZES_OF_EVENT.partition("{")[0]  # of weighted runs, all probabilities have it
    telling = (part for part in parts if part not in _OF_ALL and not part.startswith(counted))
    return "; ".join(telling)


def assumes_short_tails(array: xr.DataArray) -> bool:
    """Check for a note on what all estimates of as few runs, or with noise, are of."""
    return not _OF_ALL.isdisjoint(interval_text(array, NOTE).split("; "))


def headed_models(tree: xr.DataTree) -> dict[str, xr.DataTree]:
    """Return the groups of each model of an archive, by the words before the titles of its tables.

    These are empty for a single model.
    """
    return {f"{name}: " if name else "": model for name, model in model_trees(tree).items()}


def first_runs(tree: xr.DataTree) -> xr.Dataset:
    """Return the runs of a model's first design, which describe its inputs and outputs.

    A benchmark of methods keeps no runs, but it describes the outputs.
    """
    if is_benchmark(tree):
        outputs = {
            name: read_group(tree, COMPARISON_GROUP, name).attrs | {ROLE: "output"}
            for name in group_names(tree, COMPARISON_GROUP)
        }
        return xr.Dataset({name: ((), math.nan, found) for name, found in outputs.items()})
    return read_group(tree, RUNS, next(iter(group_names(tree, RUNS)), ""))


def output_names(runs: xr.Dataset) -> list[str]:
    """Return the outputs among the variables of a runs dataset."""
    # As an array each would take time by the number of all variables.
    variables = runs.variables
    return [str(key) for key in runs.data_vars if variables[key].attrs.get(ROLE) == "output"]


# Estimates as JSON.


def estimate_json(array: xr.DataArray) -> dict[str, Any]:
    """Return an estimate, its bounds, and how they were made.

    Those of a field are lists along its dimensions.
    """
    bounds = zip(array[BOUND].values.tolist(), np.moveaxis(array.values, -1, 0), strict=True)
    content: dict[str, Any] = {str(bound): json_value(value) for bound, value in bounds}
    content |= {what: _texts_json(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := _texts_json(array, NOTE):
        content[NOTE] = note
    corrections = (name for name in (SURROGATE_ESTIMATE, EQUIVALENT_RUNS) if name in array.coords)
    return content | {name: json_value(array.coords[name].values) for name in corrections}


def _texts_json(array: xr.DataArray, name: str) -> Any:
    """Return a text on an interval; a list along the dimensions of a field where it differs."""
    if name not in array.coords:
        return ""
    texts = array.coords[name].values
    found = set(np.ravel(texts).tolist())
    return str(found.pop()) if len(found) == 1 else texts.tolist()


def entries_json(
    array: xr.DataArray, entry_json: Callable[[xr.DataArray], Any] = estimate_json
) -> Any:
    """Return the entries of a statistic, by the coordinate along each of its dimensions.

    A single estimate lies along ``bound`` alone, behind the dimensions of its field if it has one;
    an entry without bounds is a number.
    """
    for dim in array.dims:
        # Only the coordinates of a field have a unit for display.
        if dim != BOUND and "display_units" not in array[dim].attrs:
            return {
                str(label): entries_json(array[{dim: position}], entry_json)
                for position, label in enumerate(array[dim].values)
            }
    return entry_json(array) if BOUND in array.dims else json_value(array.values)


def json_value(value: Any) -> Any:
    """Return a value as JSON knows it, which has no NaN and no infinity."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, list):
        return [json_value(each) for each in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
