"""Measured values of outputs, and the covariance of their errors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.variables import Output

# Errors of one output.


@dataclass(frozen=True)
class UnknownSize:
    """Number of the errors that is not known, but for a half-normal prior."""

    name: str
    scale: float  # of the half-normal distribution, in SI units
    unit: str  # its SI unit
    like: str  # output, input or dimension in whose unit it is shown


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Error of the model itself along a condition or a dimension: a Gaussian process.

    Its covariance is squared exponential. Where the model is right at a place, the process is such
    a one times the distance from there, in lengths: its standard deviation grows from 0, and has
    the stated size at the distance of a length.

    References
    ----------
    Brynjarsdóttir, J. & O'Hagan, A. (2014). Inverse Problems 30, 114007.
    """

    along: str  # name of the condition or the dimension
    places: FloatArray  # (row,): in SI units
    std: UnknownSize
    length: UnknownSize
    zero_at: float | None = None  # place at which the model is known to be right

    def kernel(
        self, one: FloatArray, other: FloatArray, std: FloatArray, length: FloatArray
    ) -> FloatArray:
        """Return the covariance of the errors at some places with those at others.

        Parameters
        ----------
        one, other : ndarray, shapes (place,) and (other place,)
        std, length : ndarray, shape (...)

        Returns
        -------
        ndarray, shape (..., place, other place)
        """
        scale = length[..., np.newaxis, np.newaxis]
        found: FloatArray = np.exp(-0.5 * (np.subtract.outer(one, other) / scale) ** 2)
        if self.zero_at is not None:
            found = found * np.multiply.outer(one - self.zero_at, other - self.zero_at) / scale**2
        return std[..., np.newaxis, np.newaxis] ** 2 * found


@dataclass(frozen=True, eq=False)
class MeasurementErrors:
    """Errors of the measurements of one output, in SI units; all are normal.

    The standard deviation of an error is that of all its independent parts together, along a curve
    maybe with a correlation; shared parts are the same in all rows of a group.
    """

    std: FloatArray  # (row,): the part that is stated as a quantity
    share: FloatArray  # (row,): the part that is a share of the model's value
    # Of its size, if that is unknown; then `std` and `share` are beside it.
    size: UnknownSize | None = None
    shared_std: FloatArray | None = None  # (row,): the same of the part that rows of a group share
    shared_share: FloatArray | None = None
    group: IntArray | None = None  # (row,): number of the group
    # Length over which errors along a dimension are correlated, exponentially; by dimension.
    lengths: Mapping[str, float] = field(default_factory=dict)
    matrix: FloatArray | None = None  # (row, row): the covariance of all rows, in place of the rest
    freedom: float = math.inf  # degrees of freedom of a size that follows from repeats
    discrepancy: Discrepancy | None = None  # the error of the model itself, if it may have one

    @property
    def sizes(self) -> tuple[UnknownSize, ...]:
        """Numbers that are not known: of the errors of measurement, then of the model's own."""
        own, of = () if self.size is None else (self.size,), self.discrepancy
        return own if of is None else (*own, of.std, of.length)

    @property
    def depends_on_model(self) -> bool:
        """True if they depend on what the model returns."""
        shared = self.shared_share is not None and bool(self.shared_share.any())
        return self.matrix is None and (shared or bool(self.share.any()))

    def at(self, kept: IntArray) -> MeasurementErrors:
        """Return the errors of some rows."""
        names = ("std", "share", "shared_std", "shared_share", "group")
        every = ((name, getattr(self, name)) for name in names)
        found = {name: values[kept] for name, values in every if values is not None}
        if self.matrix is not None:
            found["matrix"] = self.matrix[np.ix_(kept, kept)]
        if (of := self.discrepancy) is not None:
            found["discrepancy"] = replace(of, places=of.places[kept])
        return replace(self, **found)

    def model_covariance(self, sizes: FloatArray) -> FloatArray:
        """Return the covariance of the model's own error, shape (..., row, row) or (row, row).

        `sizes` are values of those numbers, shape (size, ...).
        """
        rows = len(self.std)
        if self.discrepancy is None:
            return np.zeros((rows, rows))
        places = self.discrepancy.places
        return self.discrepancy.kernel(places, places, *sizes[-2:])

    def covariance(
        self, predicted: FloatArray, sizes: FloatArray, correlation: FloatArray
    ) -> FloatArray:
        """Return the covariance of measured values about the model, shape (..., row, row).

        Parameters
        ----------
        predicted : ndarray, shape (..., row)
            Results of the model.
        sizes : ndarray, shape (size, ...)
            Values of the numbers that are not known.
        correlation : ndarray, shape (row, row)
            Correlation of the independent part.
        """
        of_model = self.model_covariance(sizes)
        if self.matrix is not None:
            return self.matrix + of_model
        variance = self.std**2 + (self.share * predicted) ** 2
        if self.size is not None:
            variance = variance + sizes[0][..., np.newaxis] ** 2
        found: FloatArray = correlation * _outer(np.sqrt(variance)) + of_model
        if self.group is not None and self.shared_std is not None:
            assert self.shared_share is not None
            shared = np.sqrt(self.shared_std**2 + (self.shared_share * predicted) ** 2)
            found = found + _outer(shared) * np.equal.outer(self.group, self.group)
        return found


def _outer(values: FloatArray) -> FloatArray:
    """Return the products of values with each other, over their last axis."""
    products: FloatArray = values[..., :, np.newaxis] * values[..., np.newaxis, :]
    return products


# What was measured.

AT_LEAST, EXACTLY, AT_MOST = 1, 0, -1
"""Censoring of a row: its entry is a bound from below, a value, a bound from above."""


@dataclass(frozen=True, eq=False)
class MeasuredOutput:
    """Experiments of one output: a row for each value that is not blank."""

    output: Output
    experiment: IntArray  # (row,): number of the experiment
    places: Mapping[str, FloatArray]  # coordinate of each row along each dimension of the output
    values: FloatArray  # (row,): in SI units
    censoring: IntArray  # (row,): `AT_LEAST`, `EXACTLY` or `AT_MOST`
    lines: IntArray  # (row,): number of the row in the file, from 1
    errors: MeasurementErrors

    def at(self, kept: IntArray) -> MeasuredOutput:
        """Return some of its rows."""
        names = ("experiment", "values", "censoring", "lines")
        found: dict[str, Any] = {name: getattr(self, name)[kept] for name in names}
        places = {name: values[kept] for name, values in self.places.items()}
        return replace(self, **found, places=places, errors=self.errors.at(kept))

    def predicted(self, results: FloatArray) -> FloatArray:
        """Return the results at the rows, linear between declared coordinates.

        Parameters
        ----------
        results : ndarray, shape (draw, experiment, *dims)
            In SI units.

        Returns
        -------
        ndarray, shape (draw, row)
            NaN where a run failed, or a curve has ended.
        """
        corners: list[list[tuple[IntArray, Any]]] = []
        for dimension in self.output.dims:
            along = np.array(dimension.values)
            if len(along) == 1:
                corners.append([(np.zeros(len(self.values), dtype=np.int64), 1.0)])
                continue
            at = self.places[dimension.name]
            left = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(along) - 2)
            part = (at - along[left]) / (along[left + 1] - along[left])
            corners.append([(left, 1 - part), (left + 1, part)])
        total = np.zeros((len(results), len(self.values)))
        for corner in product(*corners):
            weight = np.ones(len(self.values))
            for _, each in corner:
                weight = weight * each
            at_places: tuple[Any, ...] = tuple(place for place, _ in corner)
            entries = results[(slice(None), self.experiment, *at_places)]
            # A place with the weight 0 may be behind the end of a curve.
            total += np.where(weight == 0, 0.0, entries * weight)
        return total

    @property
    def is_by_repeats(self) -> bool:
        """True if the likelihood is integrated over a size that follows from repeats."""
        return math.isfinite(self.errors.freedom) and bool((self.censoring == EXACTLY).all())

    @cached_property
    def correlation(self) -> FloatArray:
        """Correlation of the independent errors, shape (row, row)."""
        rows = len(self.values)
        if not self.errors.lengths:
            return np.eye(rows)
        distance = np.zeros((rows, rows))
        for name, length in self.errors.lengths.items():
            distance += np.abs(np.subtract.outer(self.places[name], self.places[name])) / length
        same = np.equal.outer(self.experiment, self.experiment)
        return np.where(same, np.exp(-distance), 0.0)


@dataclass(frozen=True, eq=False)
class RowErrors:
    """Errors of the rows of several outputs, one after the other.

    Errors of different outputs are independent of each other, but for what both follow from: an
    input with a value of its own in each experiment.
    """

    rows: Sequence[tuple[MeasuredOutput, slice]]
    experiment: IntArray  # (row,): number of the experiment
    moved: tuple[str, ...] = ()  # inputs with a value of their own in each experiment

    @property
    def sizes(self) -> tuple[UnknownSize, ...]:
        """Numbers of the errors that are not known, in the order of the outputs."""
        return tuple(size for each, _ in self.rows for size in each.errors.sizes)

    @property
    def scales(self) -> list[float]:
        """Scales of the priors of these."""
        return [each.scale for each in self.sizes]

    @property
    def has_discrepancy(self) -> bool:
        """True if the model may have an error of its own."""
        return any(each.errors.discrepancy is not None for each, _ in self.rows)

    @property
    def discrepancy_text(self) -> str:
        """Outputs whose model may have an error of its own, each with the condition along which."""
        found = ((each.output.name, each.errors.discrepancy) for each, _ in self.rows)
        return ", ".join(f"{name} along {of.along}" for name, of in found if of is not None)

    @property
    def freedom(self) -> float:
        """Fewest degrees of freedom of errors whose size follows from repeats; else infinite."""
        return min(each.errors.freedom for each, _ in self.rows)

    @property
    def has_one_unknown_size(self) -> bool:
        """True if the size of all errors is one unknown number, and they have no other part."""
        errors, *others = (each.errors for each, _ in self.rows)
        alone = errors.shared_std is None and not errors.std.any() and not errors.share.any()
        alone = alone and errors.discrepancy is None
        return errors.size is not None and alone and not (others or self.moved)

    @property
    def is_fixed(self) -> bool:
        """True if no result of the model, and no unknown size, changes their covariance."""
        depends = any(each.errors.depends_on_model for each, _ in self.rows)
        return not (depends or self.moved) and (not self.sizes or self.has_one_unknown_size)

    def covariance(
        self,
        predicted: FloatArray,
        sizes: FloatArray | Sequence[float] = (),
        slopes: FloatArray | None = None,
    ) -> FloatArray:
        """Return the covariance of measured values about the results of the model.

        Parameters
        ----------
        predicted : ndarray, shape (..., row)
            Results of the model.
        sizes : ndarray, shape (..., size)
            Values of `sizes`.
        slopes : ndarray, shape (moved, row), optional
            Change of each result by one standard deviation of each of `moved`: these are
            independent of each other, and new in each experiment.

        Returns
        -------
        ndarray, shape (..., row, row)
        """
        rows = len(self.experiment)
        found = np.zeros((*predicted.shape[:-1], rows, rows))
        for each, own, of_output in self.sizes_of(sizes):
            part = each.errors.covariance(predicted[..., own], of_output, each.correlation)
            found[..., own, own] = part
        if slopes is not None and len(slopes):
            same = np.equal.outer(self.experiment, self.experiment)
            found += (slopes.T @ slopes) * same
        return found

    def model_covariance(self, sizes: FloatArray) -> FloatArray:
        """Return the covariance of the model's own errors, shape (..., row, row)."""
        rows = len(self.experiment)
        found = np.zeros((*np.shape(sizes)[:-1], rows, rows))
        for each, own, of_output in self.sizes_of(sizes):
            found[..., own, own] = each.errors.model_covariance(of_output)
        return found

    def discrepancies(
        self, blank: RowErrors, off: FloatArray, covariance: FloatArray, sizes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of the model's own errors at blank rows, each (blank row,).

        Parameters
        ----------
        blank : RowErrors
            Of those rows.
        off : ndarray, shape (row,)
            Measured values minus results of a draw.
        covariance : ndarray, shape (row, row)
            Of these.
        sizes : ndarray, shape (size,)
            Values of `sizes`.
        """
        across = np.zeros((len(blank.experiment), len(off)))
        variance = np.zeros(len(across))
        both = zip(self.sizes_of(sizes), blank.rows, strict=True)
        for (each, own, of_output), (beyond, at) in both:
            if (here := each.errors.discrepancy) and (there := beyond.errors.discrepancy):
                across[at, own] = here.kernel(there.places, here.places, *of_output[-2:])
                variance[at] = np.diag(here.kernel(there.places, there.places, *of_output[-2:]))
        # A bound is no value that an error of the model follows from.
        censoring = np.concatenate([each.censoring for each, _ in self.rows])
        exact = np.flatnonzero(censoring == EXACTLY)
        weights = np.linalg.solve(covariance[np.ix_(exact, exact)], across[:, exact].T)
        variance -= np.einsum("br,rb->b", across[:, exact], weights, optimize=False)
        return off[exact] @ weights, np.maximum(variance, 0.0)

    def sizes_of(
        self, sizes: FloatArray | Sequence[float]
    ) -> Iterator[tuple[MeasuredOutput, slice, FloatArray]]:
        """Yield the measured outputs, each with its rows and its numbers, shape (size, ...)."""
        values, first = np.moveaxis(np.asarray(sizes, dtype=np.float64), -1, 0), 0
        for each, own in self.rows:
            last = first + len(each.errors.sizes)
            yield each, own, values[first:last]
            first = last
