"""All statistics of a group of an archive; none costs anything before it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import xarray as xr

from uqpen.archive.estimates import statistic_names, unpack

__all__ = ["UnpackedStatistics"]


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
