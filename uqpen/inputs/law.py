"""The law of a model's inputs: which are fixed, which are random, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.inputs.distribution import OPEN, Distribution
from uqpen.labels import RUN
from uqpen.model import Input

__all__ = ["FixedInput", "InputLaw", "RandomInput", "points_dataset"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FixedInput:
    """An input with one value.

    Parameters
    ----------
    variable : Input
        What it is.
    value : float
        In its SI unit.
    display_unit : str
        The unit to show it in.
    """

    variable: Input
    value: float
    display_unit: str

    @property
    def nominal(self) -> float:
        """The value itself."""
        return self.value


@dataclass(frozen=True)
class RandomInput:
    """An input with a distribution.

    Parameters
    ----------
    variable : Input
        What it is.
    distribution : Distribution
        Over its SI unit.
    display_unit : str
        The unit to show it in.
    description : str
        The distribution as its author wrote it.
    """

    variable: Input
    distribution: Distribution
    display_unit: str
    description: str = ""

    @property
    def nominal(self) -> float:
        """The median: the one value that exists for every law and lies inside it."""
        return self.distribution.median


@dataclass(frozen=True)
class InputLaw:
    """The inputs of a study, in the model's order; the random ones are independent.

    Parameters
    ----------
    inputs : tuple of FixedInput or RandomInput
        At most one of each name.
    variables : tuple of Input
        All that the model takes: a table of points may give those that the study does not.
    """

    inputs: tuple[FixedInput | RandomInput, ...]
    variables: tuple[Input, ...]

    @property
    def fixed(self) -> tuple[FixedInput, ...]:
        """The inputs with one value."""
        return tuple(entry for entry in self.inputs if isinstance(entry, FixedInput))

    @property
    def random(self) -> tuple[RandomInput, ...]:
        """The inputs with a distribution."""
        return tuple(entry for entry in self.inputs if isinstance(entry, RandomInput))

    def nominal(self) -> dict[str, float]:
        """One value for each input: the fixed one, or the median."""
        return {entry.variable.name: entry.nominal for entry in self.inputs}

    def points(self, unit: FloatArray, coordinates: Mapping[str, FloatArray]) -> xr.Dataset:
        """Points of the input space from points of the unit cube.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Probabilities, one column for each random input in order.
        coordinates : mapping of str to ndarray, shape (run,)
            What an analysis will need of the design: the replicate, say.

        Returns
        -------
        Dataset
            A variable for each input, along ``run`` where it is random.
        """
        inside = np.clip(unit, *OPEN)
        values: dict[str, Any] = {
            entry.variable.name: entry.distribution.quantile(column)
            for entry, column in zip(self.random, inside.T, strict=True)
        }
        return points_dataset(self, values, coordinates, runs=len(unit))


def points_dataset(
    law: InputLaw,
    values: Mapping[str, FloatArray],
    coordinates: Mapping[str, FloatArray],
    *,
    runs: int,
) -> xr.Dataset:
    """Points as a dataset, with the law's fixed inputs wherever `values` has none."""
    fixed = {entry.variable.name: entry.value for entry in law.fixed}
    variables: dict[str, Any] = {}
    for variable in law.variables:
        if variable.name in values:
            variables[variable.name] = (RUN, values[variable.name])
        elif variable.name in fixed:
            variables[variable.name] = ((), fixed[variable.name])
    indexes = {name: (RUN, column) for name, column in coordinates.items()}
    return xr.Dataset(variables, {RUN: np.arange(runs), **indexes})
