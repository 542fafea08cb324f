"""Columns of the random inputs of a design, read one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray
from uqpen.core.blocks import BlockedRuns
from uqpen.core.labels import ROLE, RUN

__all__ = ["InputColumns"]


@dataclass(frozen=True, eq=False)
class InputColumns:
    """Random inputs at all points of a design; what nobody asks for is not read.

    Parameters
    ----------
    names : tuple of str
        The random inputs.
    size : int
        Number of points.
    read : callable
        Returns the values of an input by name, shape (point,).
    """

    names: tuple[str, ...]
    size: int
    read: Callable[[str], npt.NDArray[np.float64]]

    @classmethod
    def from_runs(cls, runs: BlockedRuns) -> InputColumns:
        """Return the inputs of runs that vary along them."""
        names = [
            str(name)
            for name, variable in runs.template.data_vars.items()
            if variable.attrs.get(ROLE) == "input" and variable.dims == (RUN,)
        ]
        return cls(tuple(names), runs.size, runs.column)

    @classmethod
    def from_matrix(cls, names: tuple[str, ...], points: FloatArray) -> InputColumns:
        """Return the columns of points, shape (point, input)."""
        return cls(names, len(points), lambda name: points[:, names.index(name)])

    @classmethod
    def none(cls, size: int) -> InputColumns:
        """Return no input of a number of points."""
        return cls.from_matrix((), np.empty((size, 0)))

    def __getitem__(self, number: int) -> FloatArray:
        """Return an input by its number, shape (point,); read-only."""
        return _read_only(self.read(self.names[number]))

    @cached_property
    def matrix(self) -> FloatArray:
        """All points, shape (point, input); read-only."""
        if not self.names:
            return np.empty((self.size, 0))
        return _read_only(np.column_stack([self.read(name) for name in self.names]))


def _read_only(values: FloatArray) -> FloatArray:
    view = values.view()
    view.flags.writeable = False
    return view
