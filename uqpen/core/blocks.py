"""Labelled datasets along ``run`` that can be read by blocks, so that none has to be in memory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN
from uqpen.core.streams import BLOCK

if TYPE_CHECKING:
    import xarray as xr

_AlongRun = npt.NDArray[Any]


def block_ranges(size: int) -> Iterator[tuple[int, int]]:
    """Yield the first run of each block and the first run after it; no runs are one empty block.

    >>> list(block_ranges(100_000))
    [(0, 65536), (65536, 100000)]
    """
    for start in range(0, max(size, 1), BLOCK):
        yield start, min(start + BLOCK, size)


def is_true_by_blocks(check: Callable[..., Any], *variables: xr.Variable, overlap: int = 0) -> bool:
    """Check that a condition is true of each block of variables of one length.

    With an overlap, that number of entries before a block belong to it, too.
    """
    return all(
        check(*(each[max(start - overlap, 0) : stop].values for each in variables))
        for start, stop in block_ranges(len(variables[0]))
    )


class BlockedDataset(ABC):
    """Dataset along ``run`` that can be read in parts; joined in order, its blocks are the whole.

    What it returns may be shared with others, and must not be written to.
    """

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of runs."""

    @abstractmethod
    def read(self, start: int, stop: int) -> xr.Dataset:
        """Return the runs from one number to another, the last excluded.

        Where there are reasons of failed runs, they are those of these runs.
        """

    def blocks(self) -> Iterator[xr.Dataset]:
        """Yield its blocks of `BLOCK` runs in order; the last one has the rest."""
        for start, stop in block_ranges(self.size):
            yield self.read(start, stop)

    def dataset(self) -> xr.Dataset:
        """Return the whole in memory."""
        return join_blocks(self.blocks(), self.size)


class BlockedRuns(BlockedDataset):
    """Handle to the runs of a design, in memory or in a file: what analyses take."""

    @cached_property
    def template(self) -> xr.Dataset:
        """Variables, coordinates and attributes, as a dataset of no run."""
        return self.read(0, 0)

    @property
    def attrs(self) -> dict[Any, Any]:
        """Attributes, such as the sampling of the points."""
        return self.template.attrs

    def part(self, start: int, stop: int, names: Iterable[str]) -> dict[str, npt.NDArray[Any]]:
        """Return the values of some variables from one run to another, the last excluded."""
        block = self.read(start, stop)
        return {name: block.variables[name].values for name in names}

    @abstractmethod
    def column(self, name: str) -> npt.NDArray[Any]:
        """Return the values of a variable along all runs, shape (run, *dims)."""


@dataclass(frozen=True, eq=False)
class LoadedDataset(BlockedRuns):
    """Handle to a dataset; its blocks and columns are views, or are read from its file."""

    whole: xr.Dataset

    @classmethod
    def of(cls, runs: xr.Dataset | BlockedRuns) -> BlockedRuns:
        """Return a handle to runs, and a handle itself unchanged."""
        return runs if isinstance(runs, BlockedRuns) else cls(runs)

    @property
    def size(self) -> int:
        """Number of runs."""
        return int(self.whole.sizes[RUN])

    def read(self, start: int, stop: int) -> xr.Dataset:
        """Return the runs from one number to another, the last excluded."""
        if (start, stop) == (0, self.size):
            return self.dataset()
        indexers: dict[str, Any] = {RUN: slice(start, stop)}
        if FAILED_RUN in self.whole.dims:
            indexers[FAILED_RUN] = slice(*np.searchsorted(self._failed, (start, stop)))
        return self.whole.isel(indexers).load()

    def column(self, name: str) -> npt.NDArray[Any]:
        """Return the values of a variable along all runs."""
        values: npt.NDArray[Any] = self.whole.variables[name].values
        return values

    def part(self, start: int, stop: int, names: Iterable[str]) -> dict[str, npt.NDArray[Any]]:
        """Return the values of some variables, as views or read from the file."""
        return {name: self.whole.variables[name][start:stop].values for name in names}

    def dataset(self) -> xr.Dataset:
        """Return the dataset itself, or its values in memory."""
        return self.whole.compute()

    @cached_property
    def _failed(self) -> npt.NDArray[Any]:
        """Numbers of the failed runs, ascending."""
        return self.whole[FAILED_RUN].values


def join_blocks(blocks: Iterable[xr.Dataset], size: int) -> xr.Dataset:
    """Join consecutive blocks of runs to a size; each is released when the next one is there.

    All have the variables of the first. Without a failed run, the whole has no reasons of failed
    runs.
    """
    import xarray as xr

    coming = iter(blocks)
    first = next(coming)
    if first.sizes[RUN] == size:
        return _without_empty_reasons(first)
    joined = {
        str(name): np.empty((size, *each.shape[1:]), each.dtype)
        for name, each in first.variables.items()
        if each.dims[:1] == (RUN,)
    }
    failed: dict[str, list[_AlongRun]] = {
        str(name): [] for name, each in first.variables.items() if each.dims == (FAILED_RUN,)
    }
    start = 0
    for block in chain([first], coming):
        stop = start + block.sizes[RUN]
        for name, column in joined.items():
            values = block.variables[name].values
            # In a type that has room for both.
            kind = np.promote_types(column.dtype, values.dtype)
            joined[name] = column.astype(kind, copy=False)
            joined[name][start:stop] = values
        for name, parts in failed.items():
            parts.append(block.variables[name].values)
        start = stop
    found = {**joined, **{name: np.concatenate(parts) for name, parts in failed.items()}}
    variables = {
        str(name): (each.dims, found.get(str(name), each.values), each.attrs)
        for name, each in first.variables.items()
    }
    coordinates = {name: variables.pop(name) for name in map(str, first.coords)}
    whole = xr.Dataset(variables, coordinates, first.attrs)
    return _without_empty_reasons(whole[[*map(str, first.variables)]])


def _without_empty_reasons(runs: xr.Dataset) -> xr.Dataset:
    if runs.sizes.get(FAILED_RUN) == 0:
        return runs.drop_vars([FAILED_RUN, FAILURE_REASON])
    return runs
