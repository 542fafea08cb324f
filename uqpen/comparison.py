"""All sources of a figure side by side: its estimate and interval from each, and the runs spent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.interval_metadata import INTERVAL_METADATA, metadata_coordinates, metadata_prefix
from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    EXCEEDANCE,
    INTERVAL_LEVEL,
    MOMENTS,
    NOTE,
    QUANTILES,
    RUNS_SPENT,
    SENSITIVITY,
    SHARES,
    SOURCE,
)
from uqpen.statistics.estimate import LEVEL

__all__ = ["Source", "compare_sources"]

FloatArray = npt.NDArray[np.float64]

# The groups that are compared, and what is put behind an output's name where a group has a
# variable of just that name.
_COMPARED = {
    MOMENTS: "",
    QUANTILES: "_quantile",
    EXCEEDANCE: "_exceedance",
    SHARES: "_share",
    SENSITIVITY: "",
}


@dataclass(frozen=True)
class Source:
    """A design or a surrogate with what it tells.

    Parameters
    ----------
    kind : str
        ``"design"`` or ``"surrogate"``.
    runs : int
        How many runs of the model it took, for a surrogate those that check it too.
    groups : mapping of str to Dataset
        What it tells, group by group.
    """

    kind: str
    runs: int
    groups: Mapping[str, xr.Dataset]


class _Variable(NamedTuple):
    """A variable of one source, taken apart."""

    dimensions: tuple[str, ...]
    values: FloatArray
    interval_metadata: Mapping[str, npt.NDArray[np.object_]]
    coordinates: Mapping[str, xr.Variable]
    attributes: Mapping[str, str]


def compare_sources(sources: Mapping[str, Source]) -> xr.Dataset:
    """Every figure along ``source``.

    Parameters
    ----------
    sources : mapping of str to Source
        By name.

    Returns
    -------
    Dataset
        A variable for each figure, along ``source``, what dimension the figure has of its own, and
        ``bound``; NaN for a source that does not tell it. How each interval was made stands in
        coordinates called after the variable.
    """
    by_source = {name: dict(_source_variables(source)) for name, source in sources.items()}
    names = dict.fromkeys(name for known in by_source.values() for name in known)
    axes = _axes(
        [source_variable for known in by_source.values() for source_variable in known.values()]
    )
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {name: axis.values for name, axis in axes.items()}
    for name in names:
        source_variables = [known.get(name) for known in by_source.values()]
        _join_sources(name, source_variables, axes, variables, coordinates)
    kinds = np.array([source.kind for source in sources.values()], dtype=object)
    runs = np.array([source.runs for source in sources.values()], dtype=np.int64)
    spent = {"units": "1", "long_name": "runs of the model that the source took"}
    return xr.Dataset(
        variables,
        {
            **coordinates,
            BOUND: list(BOUNDS),
            SOURCE: (SOURCE, np.array(list(sources), dtype=object), {"long_name": "source"}),
            f"{SOURCE}_kind": (SOURCE, kinds, {"long_name": "what the source is"}),
            RUNS_SPENT: (SOURCE, runs, spent),
        },
    )


def _source_variables(source: Source) -> Iterator[tuple[str, _Variable]]:
    """What a source tells, by the name that it has in the comparison."""
    for group, ending in _COMPARED.items():
        dataset = source.groups.get(group, xr.Dataset())
        for name in map(str, dataset.data_vars):
            if BOUND in dataset.variables[name].dims:
                yield f"{name}{ending}", _take_apart(dataset, name)


def _take_apart(dataset: xr.Dataset, name: str) -> _Variable:
    array = dataset.variables[name]
    dimensions = tuple(map(str, array.dims[:-1]))
    beside = {
        str(key): dataset.variables[key]
        for key in dataset.coords
        if dataset.variables[key].dims and set(dataset.variables[key].dims) <= set(dimensions)
    }
    prefix = metadata_prefix(name, dimensions, beside)
    metadata = {}
    for what in INTERVAL_METADATA:
        texts = beside[f"{prefix}_{what}"].values if prefix else str(array.attrs.get(what, ""))
        metadata[what] = np.full(array.shape[:-1], texts, dtype=object)
    endings = tuple(f"_{what}" for what in INTERVAL_METADATA)
    kept = {key: variable for key, variable in beside.items() if not key.endswith(endings)}
    attributes = {key: array.attrs[key] for key in ("units", "long_name") if key in array.attrs}
    return _Variable(dimensions, array.values, metadata, kept, attributes)


class _Axis(NamedTuple):
    """All entries of a dimension, whichever source has them, and where each stands."""

    values: xr.Variable
    positions: Mapping[object, int]


def _axes(source_variables: Sequence[_Variable]) -> dict[str, _Axis]:
    """The dimensions of all figures: a source may tell of more inputs than another."""
    known: dict[str, list[xr.Variable]] = {}
    for source_variable in source_variables:
        for name in source_variable.dimensions:
            known.setdefault(name, []).append(source_variable.coordinates[name])
    axes = {}
    for name, variables in known.items():
        entries = dict.fromkeys(entry for each in variables for entry in each.values.tolist())
        values = np.array(list(entries), dtype=variables[0].dtype)
        whole = xr.Variable(name, values, variables[0].attrs)
        axes[name] = _Axis(whole, {entry: i for i, entry in enumerate(entries)})
    return axes


def _join_sources(
    name: str,
    source_variables: Sequence[_Variable | None],
    axes: Mapping[str, _Axis],
    variables: dict[str, Any],
    coordinates: dict[str, Any],
) -> None:
    """Put one figure of all sources among the variables, and what belongs to it beside them."""
    like = next(
        source_variable for source_variable in source_variables if source_variable is not None
    )
    dimensions = (SOURCE, *like.dimensions)
    shape = (len(source_variables), *(len(axes[each].positions) for each in like.dimensions))
    values = np.full((*shape, len(BOUNDS)), np.nan)
    texts = {what: np.full(shape, "none", dtype=object) for what in INTERVAL_METADATA}
    texts[NOTE][:] = "this source does not tell it"
    for position, source_variable in enumerate(source_variables):
        if source_variable is None:
            continue
        places = [
            [
                axes[each].positions[entry]
                for entry in source_variable.coordinates[each].values.tolist()
            ]
            for each in source_variable.dimensions
        ]
        at = np.ix_([position], *places)
        values[at] = source_variable.values[np.newaxis]
        for what in INTERVAL_METADATA:
            texts[what][at] = source_variable.interval_metadata[what][np.newaxis]
        # What stands beside a dimension is known where all of its entries are.
        if [len(each) for each in places] == list(shape[1:]):
            beside = source_variable.coordinates.items()
            coordinates |= {key: each for key, each in beside if key not in axes}
    variables[name] = ((*dimensions, BOUND), values, {**like.attributes, INTERVAL_LEVEL: LEVEL})
    coordinates.update(metadata_coordinates(name, dict(zip(dimensions, shape, strict=True)), texts))
