"""Estimates in datasets of an archive: packing and unpacking, with the texts of their intervals.

Analyses yield *estimate arrays*, and readers get them. An estimate array is a DataArray with the
name of its statistic. It has the statistic's dimensions and ``bound`` (estimate, lower, upper), and
three text coordinates, ``interval``, ``interval_label`` and ``note``, along all dimensions except
``bound``.

In a dataset these texts are attributes of the variable where all entries agree. Otherwise a
variable ``<statistic>_interval`` of small integers stands beside it. Its attributes
``flag_interval``, ``flag_interval_label`` and ``flag_note`` list the texts: 1 000 entries then take
a kilobyte.

An estimate by a surrogate that real runs have corrected has two coordinates of numbers besides,
``surrogate_estimate`` and ``equivalent_runs``: in a dataset the variables
``<statistic>_surrogate_estimate`` and ``<statistic>_equivalent_runs``. One that stand-ins have made
narrower has ``equivalent_runs``.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.indexes import PandasIndex

from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    EQUIVALENT_RUNS,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    NOTE,
    SURROGATE_ESTIMATE,
)
from uqpen.core.units import DIMENSIONLESS

INTERVAL_TEXTS = (INTERVAL, INTERVAL_LABEL, NOTE)

# Numbers beside a corrected estimate, and what they are.
_CORRECTIONS = {
    SURROGATE_ESTIMATE: "by the surrogate alone",
    EQUIVALENT_RUNS: "number of plain runs with an interval as wide",
}

_CODES = f"_{INTERVAL}"
_FLAG = "flag_"

_BOUND_INDEX = PandasIndex.from_variables({BOUND: xr.Variable(BOUND, list(BOUNDS))}, options={})
BOUND_COORDINATE = _BOUND_INDEX.create_variables()[BOUND]

# Equal labels have one index: those of inputs, quantiles and ranks stand at each output again. What
# is kept takes a few MB at most.
_KEPT_INDEXES, _MOST_LABELS = 64, 4096


def labelled_array(
    values: npt.NDArray[Any],
    dims: tuple[Hashable, ...],
    coordinates: Mapping[Any, Any],
    attributes: Mapping[Any, Any],
    name: str | None = None,
    texts: Mapping[Any, xr.Variable] | None = None,
) -> xr.DataArray:
    """Return what the constructor of an array returns, without its copies of all coordinates.

    Those copies, text by text, took two fifths of the statistics of 300 outputs. All arrays have
    the index of `BOUND_COORDINATE` in common, and others that have equal labels. Coordinates are
    variables or what makes one, with their indexes if they are `xarray.Coordinates`; `texts` are
    further ones without an index, which nothing else holds.

    ValueError if a coordinate has another dimension than the array, or another size.
    """
    variable = xr.Variable(dims, values, dict(attributes), fastpath=True)
    variables: dict[Hashable, xr.Variable] = {}
    indexes: dict[Hashable, xr.Index] = {}
    if isinstance(coordinates, xr.Coordinates):
        variables |= {key: each.copy(deep=False) for key, each in coordinates.variables.items()}
        indexes |= coordinates.xindexes
    else:
        for key, given in coordinates.items():
            variables[key], index = _coordinate(key, given)
            indexes |= {} if index is None else {key: index}
    variables |= texts or {}
    for key, each in variables.items():
        for dim, size in each.sizes.items():
            if variable.sizes.get(dim) != size:
                found = f"coordinate {key} has {size} values along {dim}"
                raise ValueError(f"{found}, but the array has the sizes {dict(variable.sizes)}")
    # What users may call copies each coordinate, or makes an index of it again.
    return xr.DataArray(variable, variables, name=name, indexes=indexes, fastpath=True)


def array_entries(array: xr.DataArray) -> list[xr.DataArray]:
    """Return the entries of an array along its first dimension, as iteration yields them.

    xarray looks at each coordinate anew for each entry, which took half of the time of tables.
    """
    (first, *others), coordinates = array.dims, array.coords.variables
    along = {key: each.values for key, each in coordinates.items() if first in each.dims}
    if any(coordinates[key].dims[0] != first for key in along):
        return list(array)
    others_indexes = {key: each for key, each in array.xindexes.items() if key not in along}
    found = []
    for place in range(array.sizes[first]):
        own = {
            key: xr.Variable(each.dims[1:], along[key][place, ...], dict(each.attrs), fastpath=True)
            if key in along
            else each.copy(deep=False)
            for key, each in coordinates.items()
        }
        variable = xr.Variable(others, array.values[place, ...], dict(array.attrs), fastpath=True)
        entry = xr.DataArray(variable, own, name=array.name, indexes=others_indexes, fastpath=True)
        found.append(entry)
    return found


def _coordinate(key: Hashable, given: Any) -> tuple[xr.Variable, xr.Index | None]:
    """Return a coordinate and its index; None for one that is not along its own dimension."""
    if given is BOUND_COORDINATE:
        return BOUND_COORDINATE.copy(deep=False), _BOUND_INDEX
    variable = _as_variable(key, given)
    if variable.dims != (key,):
        return variable.to_base_variable(), None
    labels = _hashable(variable.values)
    if not labels:
        return _indexed(key, variable)
    coordinate, index = _indexed_labels(key, variable.dtype.str, labels)
    coordinate = coordinate.copy(deep=False)
    coordinate.attrs = variable.attrs
    return coordinate, index


def _indexed(key: Hashable, variable: xr.Variable) -> tuple[xr.Variable, xr.Index]:
    index = PandasIndex.from_variables({key: variable}, options={})
    return index.create_variables({key: variable})[key], index


@lru_cache(_KEPT_INDEXES)
def _indexed_labels(
    key: Hashable, dtype: str, labels: bytes | tuple[str, ...]
) -> tuple[xr.Variable, xr.Index]:
    """Return a coordinate of some labels, and its index."""
    if isinstance(labels, bytes):
        return _indexed(key, xr.Variable(key, np.frombuffer(labels, np.dtype(dtype))))
    return _indexed(key, xr.Variable(key, np.array(labels, dtype=object)))


def _hashable(values: npt.NDArray[Any]) -> bytes | tuple[str, ...]:
    """Return labels as their bytes, or as texts; empty for those that are not kept."""
    if values.size > _MOST_LABELS or values.dtype.kind not in "OUifb":
        return ()
    if values.dtype.kind != "O":
        return values.tobytes()
    return tuple(values.tolist()) if _are_texts(values) else ()


def _are_texts(values: npt.NDArray[Any]) -> bool:
    return all(type(each) is str for each in values.ravel().tolist())


def _as_variable(key: Hashable, given: Any) -> xr.Variable:
    """Return a variable, or the one of what makes one; labels alone are along their own name."""
    if isinstance(given, xr.Variable):
        return given
    if isinstance(given, xr.DataArray):
        return given.variable
    if not isinstance(given, tuple):
        return xr.Variable((key,) if np.ndim(given) else (), given)
    dims, values, attributes, *_ = (*given, None)
    # xarray looks for dates among objects, which takes longer than all else.
    is_ready = isinstance(values, np.ndarray) and (
        values.dtype.kind in "Uifb" or (values.dtype.kind == "O" and _are_texts(values))
    )
    return xr.Variable(dims, values, attributes, fastpath=is_ready)


# Packing and unpacking


def estimate_array(
    values: Any,
    dims: Mapping[str, int],
    texts: Mapping[str, Any],
    *,
    units: str,
    long_name: str,
    attributes: Mapping[str, Any] | None = None,
    coordinates: Mapping[Any, Any] | None = None,
) -> xr.DataArray:
    """Build an estimate array.

    Parameters
    ----------
    values : array_like, shape (*dims, 3)
        Estimate, lower and upper bound; NaN for what there is not.
    dims : mapping of str to int
        The dimensions before ``bound`` and their sizes.
    texts : mapping of str to array_like
        By `INTERVAL_TEXTS`: one text for all entries, or one for each.
    """
    shape = tuple(dims.values())
    own = {}
    for name in INTERVAL_TEXTS:
        entries = np.empty(shape, dtype=object)
        entries[...] = np.asarray(texts[name], dtype=object).reshape(
            () if isinstance(texts[name], str) else shape
        )
        # Otherwise xarray looks for dates among them, which takes most of the time.
        own[name] = xr.Variable(tuple(dims), entries, fastpath=True)
    return labelled_array(
        np.asarray(values, dtype=np.float64).reshape(*shape, len(BOUNDS)),
        (*dims, BOUND),
        {BOUND: BOUND_COORDINATE, **(coordinates or {})},
        {"units": units, "long_name": long_name, **(attributes or {})},
        texts=own,
    )


def interval_text(array: xr.DataArray, name: str) -> str:
    """Return one of `INTERVAL_TEXTS` of a single entry of an estimate array; empty for none."""
    text = array.coords.variables.get(name)
    return "" if text is None else str(text.values)


def pack(arrays: Mapping[str, xr.DataArray] | Iterable[tuple[str, xr.DataArray]]) -> xr.Dataset:
    """Put estimate arrays, and arrays without bounds, into a dataset as an archive has it."""
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, array in dict(arrays).items():
        attributes = dict(array.attrs)
        own = array.coords.variables  # each alone would be an array with coordinates of its own
        coordinates |= {
            str(key): each
            for key, each in own.items()
            if key not in INTERVAL_TEXTS and key not in _CORRECTIONS
        }
        for key, what in _CORRECTIONS.items():
            if key in own:
                units = attributes.get("units") if key == SURROGATE_ESTIMATE else None
                described = {"units": units or DIMENSIONLESS, "long_name": f"{name}, {what}"}
                variables[f"{name}_{key}"] = (array.dims[:-1], own[key].values, described)
        if BOUND in array.dims:
            if not np.isfinite(array.values[..., 1:]).any():
                attributes.pop(INTERVAL_LEVEL, None)
            texts, codes = _packed_texts(name, array)
            attributes |= texts
            variables |= codes
        variables[name] = (array.dims, array.values, attributes)
    return xr.Dataset(variables, coordinates)


def _packed_texts(name: str, array: xr.DataArray) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the texts of intervals as attributes where all entries agree, else as a variable.

    That says which of the known texts, in order of appearance, each entry has.
    """
    columns = [array.coords.variables[text].values.ravel().tolist() for text in INTERVAL_TEXTS]
    places: dict[tuple[Any, ...], int] = {}
    codes = [places.setdefault(entry, len(places)) for entry in zip(*columns, strict=True)]
    known = [tuple(map(str, entry)) for entry in places] or [("none", "none", "")]
    if len(known) == 1:
        return {key: text for key, text in zip(INTERVAL_TEXTS, known[0], strict=True) if text}, {}
    kind = np.int8 if len(known) <= np.iinfo(np.int8).max else np.int16
    attributes = {
        "long_name": f"how the intervals of {name} were made",
        "flag_values": np.arange(len(known), dtype=kind),
        "flag_meanings": " ".join(f"k{code}" for code in range(len(known))),
        **{
            f"{_FLAG}{key}": [entry[position] for entry in known]
            for position, key in enumerate(INTERVAL_TEXTS)
        },
    }
    dims = [dim for dim in array.dims if dim != BOUND]
    values = np.array(codes, dtype=kind).reshape([array.sizes[dim] for dim in dims])
    return {}, {interval_codes_name(name): (dims, values, attributes)}


def unpack(dataset: xr.Dataset, name: str) -> xr.DataArray | None:
    """Return a statistic from a group of an archive; None where the group does not have it.

    An estimate array has the texts of its intervals as coordinates.
    """
    if name not in dataset.data_vars:
        return None
    array = dataset[name]
    if BOUND not in array.dims:
        return array
    dims = array.dims[:-1]
    shape = array.shape[:-1]
    codes = interval_codes(dataset, name)
    texts: dict[str, xr.Variable] = {}
    for key in INTERVAL_TEXTS:
        if codes is None:
            values = np.full(shape, str(array.attrs.get(key, "")), dtype=object)
        else:
            table = np.array(np.atleast_1d(codes.attrs[f"{_FLAG}{key}"]), dtype=object)
            values = np.asarray(table[codes.values], dtype=object)
        texts[key] = xr.Variable(dims, values, fastpath=True)
    for key in _CORRECTIONS:
        if (beside := dataset.variables.get(f"{name}_{key}")) is not None:
            texts[key] = beside
    attributes = {key: value for key, value in array.attrs.items() if key not in INTERVAL_TEXTS}
    return labelled_array(array.values, array.dims, array.coords, attributes, name, texts)


def has_interval_texts(dataset: xr.Dataset, name: str) -> bool:
    """Return True if a statistic has the method of the interval of each entry.

    The group may be of any origin.
    """
    variable = dataset.variables[name]
    codes = interval_codes(dataset, name)
    if codes is None:
        return bool(str(variable.attrs.get(INTERVAL_LABEL, "")))
    if codes.dims != variable.dims[:-1] or codes.dtype.kind not in "iu":
        return False
    tables = [np.atleast_1d(codes.attrs.get(f"{_FLAG}{key}", [])) for key in INTERVAL_TEXTS]
    sizes = {len(table) for table in tables}
    if len(sizes) != 1 or any(table.dtype.kind not in "OUS" for table in tables):
        return False
    values = codes.values
    return values.size == 0 or (int(values.min()) >= 0 and int(values.max()) < sizes.pop())


def interval_codes_name(statistic: str) -> str:
    """Return the name of the variable with the codes of a statistic's texts."""
    return f"{statistic}{_CODES}"


def interval_codes(dataset: xr.Dataset, name: str) -> xr.Variable | None:
    """Return the codes of a statistic's texts; None where all of its entries agree."""
    return dataset.variables.get(interval_codes_name(name))


def statistic_names(dataset: xr.Dataset) -> list[str]:
    """Return the statistics of a dataset, without the variables that belong to another one."""
    names = [str(name) for name in dataset.data_vars]
    belonging = {
        each for name in names for each in (interval_codes_name(name), *correction_names(name))
    }
    return [name for name in names if name not in belonging]


def correction_names(statistic: str) -> list[str]:
    """Return the names of the variables with the numbers beside corrected estimates."""
    return [f"{statistic}_{key}" for key in _CORRECTIONS]


class UnpackedStatistics(Mapping[str, xr.DataArray]):
    """Estimate arrays of a dataset by their names.

    Each is unpacked when it is first asked for: a table of 300 outputs shows a few statistics of
    each, and to unpack one takes as long as to show it.

    Parameters
    ----------
    dataset : Dataset
        Of a group of an archive.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset
        self._arrays: dict[str, xr.DataArray | None] = dict.fromkeys(statistic_names(dataset))

    def __getitem__(self, name: str) -> xr.DataArray:
        array = self._arrays[name]
        if array is None:
            array = unpack(self._dataset, name)
            if array is None:
                raise KeyError(name)
            self._arrays[name] = array
        return array

    def __contains__(self, name: object) -> bool:
        return name in self._arrays

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def attributes(self) -> Iterator[Mapping[Any, Any]]:
        """Yield the attributes of each statistic as they are stored, without unpacking any."""
        for name in self._arrays:
            yield self._dataset.variables[name].attrs
