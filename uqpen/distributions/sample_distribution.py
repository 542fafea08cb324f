"""Rows of a table as the joint distribution of its columns: a posterior sample, say."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray, rows_by_weight
from uqpen.core.files import FileSnapshot
from uqpen.distributions.discrete import Discrete
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.input_group import InputGroup

__all__ = ["SampleDistribution"]


@dataclass(frozen=True, eq=False)
class SampleDistribution(InputGroup):
    """Weighted rows of values as the joint distribution of several inputs.

    A draw is a row, so it keeps the dependence of the columns. The first coordinate of the unit
    cube selects the row, each over an interval as long as its weight. So stratified points take the
    rows evenly, as systematic resampling does; the other coordinates have no effect.

    Parameters
    ----------
    inputs : tuple of str
        The columns.
    rows : ndarray, shape (row, input)
        Values in SI units.
    weights : ndarray, shape (row,)
        Relative weights, at least two above 0.
    source : str
        The file, for a description.
    file : FileSnapshot, optional
        That file.

    References
    ----------
    Kitagawa, G. (1996). J. Comput. Graph. Stat. 5, 1-25.
    """

    conditional_reason = "its draws are whole rows of a sample, of which no part is given the rest"

    inputs: tuple[str, ...]
    rows: FloatArray
    weights: FloatArray
    source: str = "a table"
    file: FileSnapshot | None = field(default=None, repr=False)

    @property
    def description(self) -> str:
        weighted = "weighted " if np.ptp(self.weights) > 0 else ""
        return f"{len(self.rows)} {weighted}rows of {self.source}"

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        return () if self.file is None else (self.file,)

    @cached_property
    def marginals(self) -> tuple[Distribution, ...]:
        return tuple(Discrete.from_sample(column, self.weights) for column in self.rows.T)

    def values(self, unit: FloatArray) -> FloatArray:
        return self.rows[rows_by_weight(self.weights, unit[:, 0])]

    def nominal(self) -> tuple[float, ...]:
        return tuple(marginal.median for marginal in self.marginals)
