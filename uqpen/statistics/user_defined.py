"""Statistics that user-defined analyses yield, checked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, pack
from uqpen.archive.structure import find_attribute_faults, find_dataset_faults
from uqpen.core.catalogue import CATALOGUE, NAMES_IN_USE, REQUESTED_DIMENSIONS, TABLE_COLUMNS
from uqpen.core.errors import QuantityError
from uqpen.core.labels import BOUND, BOUNDS, INPUT, INTERVAL, NAME, RESERVED
from uqpen.core.statistic import RECORD, RECORD_NUMBERS, RECORD_WORDS, Statistic, UnitRule
from uqpen.core.units import scale
from uqpen.statistics import texts
from uqpen.statistics.estimate import refused
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

_UNIT_RULES = ("value", "difference")

# A dimension is a column of the long table, beside its own.
_USED_DIMENSIONS = RESERVED.union(TABLE_COLUMNS, INTERVAL_TEXTS) - {INPUT}

_ESTIMATE_ARRAY = "an estimate array, as Estimate.to_array and Estimate.stack make it"


def user_defined_statistics(
    analyses: Iterable[UserDefinedAnalysis],
    sample: Sample,
    quantity: QuantityOfInterest,
    known: Mapping[str, xr.DataArray],
) -> dict[str, xr.DataArray]:
    """Compute the statistics that user-defined analyses yield for an output.

    Parameters
    ----------
    analyses : iterable of UserDefinedAnalysis
        In the order of the study.
    sample : Sample
        Of the output. Without a completed run, there are no statistics.
    known : mapping of str to DataArray
        The statistics that the output already has. Their coordinates take precedence.

    Returns
    -------
    dict of str to DataArray
        Estimate arrays that an archive can contain in addition to the known ones.

    Raises
    ------
    StudyError
        If an analysis fails, or yields a statistic that cannot be in an archive.
    """
    found: dict[str, xr.DataArray] = {}
    if sample.size == 0:
        return found
    for analysis in analyses:
        for statistic in analysis(sample, quantity):
            if analysis.is_built_in:
                name, array = statistic
                is_weighted = sample.weights is not None
                found[name] = refused(array, texts.NOT_WEIGHTED) if is_weighted else array
                continue
            if fault := _statistic_fault(statistic, known, found):
                raise analysis.error(quantity, *fault)
            name, array = statistic
            for record in (each for each in analysis.records if each.name == name):
                if fault := _unlike_record(record, array, quantity):
                    raise analysis.error(quantity, f"{name} {fault[0]}", fault[1])
                array = array.assign_attrs(_record_attributes(record))
            # A coordinate that other statistics have already keeps their attributes.
            shared = _coordinates({**found, **known})
            own = {key: shared[str(key)] for key in array.coords if key in shared}
            if sample.weights is not None and not analysis.takes_weights:
                array = refused(array, texts.NOT_WEIGHTED)
            found[name] = array.assign_coords(own)
    return found


def _statistic_fault(
    statistic: object, known: Mapping[str, xr.DataArray], found: Mapping[str, xr.DataArray]
) -> tuple[str, str] | None:
    """Return the fault in a result of an analysis, and the expected form; empty for none."""
    if not (isinstance(statistic, tuple) and len(statistic) == 2):
        return f"something of type {type(statistic).__name__}", "a name and an estimate array"
    name, array = statistic
    if expected := _name_fault(name, found):
        return f"the statistic {name!r}", expected
    if wrong := _array_fault(array):
        return f"{name} {wrong}", _ESTIMATE_ARRAY
    others = {**found, **known}
    if fault := _coordinate_fault(array, others):
        return f"{name} with {fault[0]}", fault[1]
    wrong = next(_archive_faults({**others, name: array}), "")
    return (wrong, _ESTIMATE_ARRAY) if wrong else None


def _unlike_record(
    record: Statistic, array: xr.DataArray, quantity: QuantityOfInterest
) -> tuple[str, str] | None:
    """Return in which respect an estimate array is not as its record states; None if it is."""
    unit = "1" if record.unit is UnitRule.NONE else quantity.output.unit
    if array.attrs["units"] != unit:
        return f"in {array.attrs['units']}", f"the unit of its record: {unit}"
    if array.dims[:-1] != record.dims:
        return f"along {array.dims[:-1]}", f"the dimensions of its record: {record.dims}"
    return None


def _record_attributes(record: Statistic) -> dict[str, str | int]:
    """Return the attributes by which an archive shows a statistic without its function."""
    shown, is_plain = record.shown, record.unit is UnitRule.NONE
    words = {f"{RECORD}{name}": getattr(shown, name) for name in RECORD_WORDS}
    numbers = {f"{RECORD}{name}": int(getattr(shown, name)) for name in RECORD_NUMBERS}
    found = {**words, **numbers} | ({} if is_plain else {"unit_rule": record.unit.name.lower()})
    return {name: value for name, value in found.items() if value}


def _name_fault(name: object, found: Mapping[str, object]) -> str:
    """Return the expected form of an invalid name; empty for a valid one."""
    if not isinstance(name, str) or not NAME.match(name):
        return "a name of letters, digits and _, at most 100"
    if name in CATALOGUE:
        return "a name that no built-in statistic has"
    if name in NAMES_IN_USE or name.endswith(f"_{INTERVAL}"):
        return "a name that archives do not use themselves"
    return "a name that it has not yielded before, nor another analysis" if name in found else ""


def _array_fault(array: object) -> str:
    """Return why something is no estimate array; empty where it is one."""
    if not isinstance(array, xr.DataArray):
        return f"of type {type(array).__name__}"
    if array.dims[-1:] != (BOUND,) or array.dtype != np.float64 or not array.size:
        return f"an array of {array.dtype} along {', '.join(map(str, array.dims)) or 'nothing'}"
    if BOUND not in array.coords or array[BOUND].values.tolist() != list(BOUNDS):
        return f"without {', '.join(BOUNDS)} along {BOUND}"
    for name in INTERVAL_TEXTS:
        if name not in array.coords or not _is_text(array.coords[name].values):
            return f"without texts {name} of its intervals"
        if array.coords[name].dims != array.dims[:-1]:
            return f"without a text {name} for each entry"
    return _attribute_fault(array.attrs)


def _attribute_fault(attributes: Mapping[Any, Any]) -> str:
    """Return the fault in the attributes of an array; empty for none."""
    for name in ("units", "long_name"):
        if not isinstance(attributes.get(name), str) or not attributes[name]:
            return f"without {name}"
    try:
        scale(attributes["units"])
    except QuantityError as error:
        return f"in units that are none ({error})"
    rule = attributes.get("unit_rule", _UNIT_RULES[0])
    if rule not in _UNIT_RULES:
        return f'with the unit_rule {rule!r}, neither "value" nor "difference"'
    for name, value in attributes.items():
        if not isinstance(name, str) or np.asarray(value).dtype.kind not in "Uiuf":
            return f"with an attribute {name!r} that is neither text nor number"
    return ""


def _is_text(values: Any) -> bool:
    return all(isinstance(each, str) for each in np.ravel(np.asarray(values, dtype=object)))


def _coordinates(arrays: Mapping[str, xr.DataArray]) -> dict[str, xr.Variable]:
    """Return the coordinates of arrays, except the texts on their intervals."""
    return {
        str(name): coordinate.variable
        for array in arrays.values()
        for name, coordinate in array.coords.items()
        if name not in INTERVAL_TEXTS
    }


def _coordinate_fault(
    array: xr.DataArray, known: Mapping[str, xr.DataArray]
) -> tuple[str, str] | None:
    """Return the fault in the coordinates of an array, and the expected form."""
    shared = _coordinates(known)
    for dimension in map(str, array.dims[:-1]):
        if not NAME.match(dimension) or dimension in _USED_DIMENSIONS or dimension in CATALOGUE:
            return f"a dimension {dimension!r}", "a name that archives do not use themselves"
        if dimension not in array.coords or not array.indexes[dimension].is_unique:
            return f"a dimension {dimension}", "a coordinate along it that tells its entries apart"
        if dimension in REQUESTED_DIMENSIONS and dimension not in shared:
            return f"a dimension {dimension}", "one that built-in statistics of the output have"
    for name, coordinate in _coordinates({"": array}).items():
        if name in shared and not _is_same(shared[name], coordinate):
            return f"another {name} than other statistics", "the same, or another dimension"
        if not (coordinate.dtype.kind in "iuf" or _is_text(coordinate.values)):
            return f"a coordinate {name} of {coordinate.dtype}", "texts or numbers"
    return None


def _is_same(one: xr.Variable, other: xr.Variable) -> bool:
    return one.dims == other.dims and np.array_equal(one.values, other.values)


def _archive_faults(arrays: Mapping[str, xr.DataArray]) -> Iterator[str]:
    """Yield why an archive with these statistics could not be opened."""
    if both := sorted(arrays.keys() & _coordinates(arrays).keys()):
        yield f"{both[0]} is a statistic and a coordinate"
        return
    dataset = pack(arrays)
    yield from find_dataset_faults(dataset, CATALOGUE)
    yield from find_attribute_faults(xr.DataTree(dataset))
