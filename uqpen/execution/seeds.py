"""Seeds of runs of a model with noise of its own: by what is run, not by where or when."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.blocks import BlockedDataset
from uqpen.core.labels import RUN
from uqpen.core.model import Model
from uqpen.core.streams import BLOCK

if TYPE_CHECKING:
    import xarray as xr

# Programs take signed integers of 32 bits, and some take 0 or less as "by the clock".
LARGEST_SEED = 2**31 - 2


class Occurrences:
    """Count of how often each point came before, over points that come in order."""

    def __init__(self) -> None:
        self._seen = Counter[bytes]()

    def numbers(self, inputs: Arrays) -> FloatArray:
        """Return the number of equal points before each, shape (run,), as a column of inputs."""
        return np.array([number for _, number in self.count(inputs)], dtype=np.float64)

    def copy(self) -> Occurrences:
        """Return a count that goes on by itself."""
        other = Occurrences()
        other._seen = self._seen.copy()
        return other

    def count(self, inputs: Arrays) -> list[tuple[bytes, int]]:
        """Return a hash of each point's bits, and the number of equal points before it.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            SI values; at least one input.
        """
        names = sorted(inputs)
        # A number is the same in any order of bytes; -0 is not 0.
        columns = [np.ascontiguousarray(inputs[name], dtype="<f8") for name in names]
        head = json.dumps(names).encode("ascii")
        found = []
        for row in np.stack(columns, axis=1) if columns else ():
            digest = hashlib.blake2b(head + row.tobytes(), digest_size=16).digest()
            found.append((digest, self._seen[digest]))
            self._seen[digest] += 1
        return found


class RunSeeds:
    """Seeds of the runs of a model in a design.

    A seed follows from the study's seed, the name of the model, the bits of the inputs, and how
    often the point came before in the design. So a point has the same seeds in a larger design, and
    in one with more repeats. It is hashed, so that no two seeds are near to each other.

    Parameters
    ----------
    seed : int
        The study's.
    name : str
        The name of the model in the study; empty for a single one.
    model : Model
        The model, which gets the seed by the variable that `Model.noise` names, if any.
    """

    def __init__(self, seed: int, name: str, model: Model) -> None:
        self.variable = model.noise.seed
        self._names = {each.name for each in model.inputs} - {self.variable}
        key = json.dumps([str(seed), "noise", name], ensure_ascii=True).encode("ascii")
        self._key = hashlib.sha256(key).digest()
        self.occurrences = Occurrences()

    def columns(self, inputs: Arrays) -> dict[str, Any]:
        """Return the inputs of the next runs with their seeds, if they have any."""
        return {**inputs, self.variable: self.draw(inputs)} if self.variable else {**inputs}

    def draw(self, inputs: Arrays) -> IntArray:
        """Return the seeds of the next runs of the design, shape (run,), each from 1."""
        own = {name: inputs[name] for name in inputs if name in self._names}
        return np.array([self._seed(*each) for each in self.occurrences.count(own)], np.int64)

    def assigned(self, points: xr.Dataset | BlockedDataset) -> xr.Dataset | BlockedDataset:
        """Return the points of the next round with the seeds of their runs, if these have any."""
        if not self.variable:
            return points
        if isinstance(points, BlockedDataset):
            return _SeededPoints(points, self)
        return self.assigned_part(points)

    def assigned_part(self, points: xr.Dataset) -> xr.Dataset:
        """Return the next points of a round with the seeds of their runs."""
        columns = {
            str(name): np.broadcast_to(points.variables[name].values, points.sizes[RUN])
            for name in points.data_vars
        }
        return points.assign({self.variable: (RUN, self.draw(columns))})

    def _seed(self, digest: bytes, occurrence: int) -> int:
        text = digest + occurrence.to_bytes(8, "little")
        found = hashlib.blake2b(text, digest_size=8, key=self._key).digest()
        return 1 + int.from_bytes(found, "little") % LARGEST_SEED


class _SeededPoints(BlockedDataset):
    """Points of a round with seeds; as these depend on the points before, those are counted."""

    def __init__(self, points: BlockedDataset, seeds: RunSeeds) -> None:
        self._points, self._seeds = points, seeds
        self._next, self._before = 0, seeds.occurrences.copy()

    @property
    def size(self) -> int:
        return self._points.size

    def read(self, start: int, stop: int) -> xr.Dataset:
        if start == stop:
            return self._seeds.assigned_part(self._points.read(start, stop))
        if start < self._next:
            self._next, self._seeds.occurrences = 0, self._before.copy()
        while self._next < start:
            end = min(self._next + BLOCK, start)
            self._seeds.assigned_part(self._points.read(self._next, end))
            self._next = end
        self._next = stop
        return self._seeds.assigned_part(self._points.read(start, stop))
