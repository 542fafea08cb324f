"""The law of a model's inputs: which are fixed, which are random, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.files import FileSnapshot
from uqpen.core.labels import DEPENDENCE, ROLE, RUN
from uqpen.core.model import Input
from uqpen.distributions.dependence import Dependence
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution

__all__ = ["FixedInput", "JointDistribution", "RandomInput", "points_dataset"]

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
    fit : mapping of str to str, int or float
        Where the distribution follows from measurements: how many, and how well it fits them.
    files : tuple of FileSnapshot
        Where those measurements stand.
    """

    variable: Input
    distribution: Distribution
    display_unit: str
    description: str = ""
    fit: Mapping[str, str | int | float] = field(default_factory=dict, hash=False)
    files: tuple[FileSnapshot, ...] = ()

    @property
    def nominal(self) -> float:
        """The median: the one value that exists for every law and lies inside it."""
        return self.distribution.median


@dataclass(frozen=True)
class JointDistribution:
    """The inputs of a study, in the model's order; the random ones independent or joined.

    Parameters
    ----------
    inputs : tuple of FixedInput or RandomInput
        At most one of each name.
    variables : tuple of Input
        All that the model takes: a table of points may give those that the study does not.
    dependence : Dependence, optional
        The copula of some of the random inputs; the others are independent.
    """

    inputs: tuple[FixedInput | RandomInput, ...]
    variables: tuple[Input, ...]
    dependence: Dependence | None = None

    @property
    def fixed(self) -> tuple[FixedInput, ...]:
        """The inputs with one value."""
        return tuple(entry for entry in self.inputs if isinstance(entry, FixedInput))

    @property
    def random(self) -> tuple[RandomInput, ...]:
        """The inputs with a distribution."""
        return tuple(entry for entry in self.inputs if isinstance(entry, RandomInput))

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        """The files that its distributions follow from, as they stood when they were read."""
        return tuple(file for entry in self.random for file in entry.files)

    @property
    def is_independent(self) -> bool:
        """Whether the random inputs are independent of each other."""
        return self.dependence is None

    def nominal(self) -> dict[str, float]:
        """One value for each input: the fixed one, or the median."""
        return {entry.variable.name: entry.nominal for entry in self.inputs}

    def points(self, unit: FloatArray, coordinates: Mapping[str, FloatArray]) -> xr.Dataset:
        """Points of the input space from points of the unit cube.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Independent probabilities, one column for each random input in order.
        coordinates : mapping of str to ndarray, shape (run,)
            What an analysis will need of the design: the replicate, say.

        Returns
        -------
        Dataset
            A variable for each input, along ``run`` where it is random.
        """
        values = self.ppf(self.conditional_probabilities(unit, {}))
        return points_dataset(self, values, coordinates, runs=len(unit))

    def conditional_probabilities(
        self, unit: FloatArray, given: Mapping[int, FloatArray]
    ) -> FloatArray:
        """Draws of the random inputs' probabilities, given those of some of them.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Independent probabilities; the columns of given inputs are not looked at.
        given : mapping of int to ndarray, shape (run,)
            By position in `random`, the probability below each given value: 0.5 for a median.
            With none, draws are of the law itself.

        Returns
        -------
        ndarray, shape (run, random input)
            What `ppf` takes. The given columns stand as they are given; of independent inputs,
            the others do so too.
        """
        points = np.clip(unit, *OPEN_INTERVAL)
        for position, column in given.items():
            points[:, position] = np.clip(column, *OPEN_INTERVAL)
        if self.dependence is None:
            return points
        names = [entry.variable.name for entry in self.random]
        joined = [names.index(name) for name in self.dependence.inputs]
        among = {joined.index(key): column for key, column in given.items() if key in joined}
        points[:, joined] = self.dependence.conditional_points(points[:, joined], among)
        return points

    def ppf(self, probabilities: FloatArray) -> dict[str, FloatArray]:
        """The random inputs' values in SI units, from their probabilities.

        Parameters
        ----------
        probabilities : ndarray, shape (run, random input)
            Of lying below the value, for each input by itself.
        """
        inside = np.clip(probabilities, *OPEN_INTERVAL)
        return {
            entry.variable.name: entry.distribution.ppf(column)
            for entry, column in zip(self.random, inside.T, strict=True)
        }


def points_dataset(
    joint: JointDistribution,
    values: Mapping[str, FloatArray],
    coordinates: Mapping[str, FloatArray],
    *,
    runs: int,
) -> xr.Dataset:
    """Points as a dataset, with the law's fixed inputs wherever `values` has none."""
    fixed = {entry.variable.name: entry.value for entry in joint.fixed}
    variables: dict[str, Any] = {}
    for variable in joint.variables:
        if variable.name in values:
            variables[variable.name] = (RUN, values[variable.name])
        elif variable.name in fixed:
            variables[variable.name] = ((), fixed[variable.name])
    indexes = {name: (RUN, column) for name, column in coordinates.items()}
    points = xr.Dataset(variables, {RUN: np.arange(runs), **indexes})
    # Of several models one may not take an input, which is described all the same.
    for variable in joint.variables:
        if variable.name in points:
            points[variable.name].attrs = {
                "long_name": variable.title,
                ROLE: "input",
                "units": variable.unit,
                "display_units": variable.preferred_unit,
            }
    for entry in joint.random:
        if entry.variable.name in points:
            points[entry.variable.name].attrs.update(entry.fit)
    if joint.dependence is not None:
        points.attrs[DEPENDENCE] = str(joint.dependence)
    return points
