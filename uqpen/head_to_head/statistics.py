"""The statistics that methods are judged by, and where the analyses put them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.question import Question
from uqpen.labels import BOUNDS, ENTRIES, EXCEEDANCE, MOMENTS, QUANTILES
from uqpen.units import DIMENSIONLESS

__all__ = ["GROUPS", "Statistic", "statistics_of"]

FloatArray = npt.NDArray[np.float64]

# The analyses whose answers are compared.
GROUPS = (MOMENTS, QUANTILES, EXCEEDANCE)

# Where a value's own size says little, because zero is a place as any other, errors are relative
# to the standard deviation.
_SMALL = 0.01


@dataclass(frozen=True)
class Statistic:
    """What is asked of an output, of which there may be several entries.

    Parameters
    ----------
    question : Question
        Of which output.
    name : str
        ``"mean"``, ``"std"``, ``"quantile"`` or ``"exceedance"``.
    group, variable : str
        Where the analyses answer it.
    dimension : str
        What several entries lie along; empty for a single one.
    entries : tuple of float or str
        What they are called.
    """

    question: Question
    name: str
    group: str
    variable: str
    dimension: str = ""
    entries: tuple[float | str, ...] = ("",)

    @property
    def output(self) -> str:
        """The name of its output."""
        return self.question.output.name

    @property
    def units(self) -> str:
        """Of its values."""
        return DIMENSIONLESS if self.name == EXCEEDANCE else self.question.output.unit

    @property
    def display_units(self) -> str:
        """The unit to show its values in."""
        return DIMENSIONLESS if self.name == EXCEEDANCE else self.question.display_unit

    @property
    def long_name(self) -> str:
        """What it is, in words."""
        words = {"std": "standard deviation", EXCEEDANCE: "probability of exceeding a value"}
        return f"{words.get(self.name, self.name)} of {self.question.output.title}"

    @property
    def is_place(self) -> bool:
        """Whether it says where values lie, and so may be zero without being small."""
        return self.name in ("mean", "quantile")

    def figures(self, groups: Mapping[str, xr.Dataset]) -> FloatArray:
        """Its estimates with their bounds.

        Parameters
        ----------
        groups : mapping of str to Dataset
            What analyses answered, by group.

        Returns
        -------
        ndarray, shape (entry, bound)
            NaN where nothing was answered.
        """
        shape = (len(self.entries), len(BOUNDS))
        answers = groups.get(self.group)
        if answers is None or self.variable not in answers:
            return np.full(shape, np.nan)
        return np.asarray(answers[self.variable].values, dtype=np.float64).reshape(shape)

    def scale(self, truth: FloatArray, spread: float) -> FloatArray:
        """What errors are relative to.

        Parameters
        ----------
        truth : ndarray, shape (entry,)
            The reference's values.
        spread : float
            The standard deviation of the output.
        """
        size = np.abs(truth)
        if self.is_place:
            size = np.where(size < _SMALL * spread, spread, size)
        scale: FloatArray = np.where(size > 0, size, 1.0)
        return scale


def statistics_of(questions: Sequence[Question]) -> Iterator[Statistic]:
    """The statistics of every output that is a number, output by output."""
    for question in questions:
        name = question.output.name
        if question.output.categories:
            continue
        yield Statistic(question, "mean", MOMENTS, f"{name}_mean")
        yield Statistic(question, "std", MOMENTS, f"{name}_std")
        yield Statistic(
            question, "quantile", QUANTILES, name, ENTRIES["quantile"], tuple(question.quantiles)
        )
        if question.exceeds:
            texts = tuple(threshold.text for threshold in question.exceeds)
            yield Statistic(question, EXCEEDANCE, EXCEEDANCE, name, ENTRIES[EXCEEDANCE], texts)
