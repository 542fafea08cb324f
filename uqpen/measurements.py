"""Measurements of a model's outputs: experiments, their errors, and how well results fit them."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import MEASURED_CONDITION, MEASURED_ROW
from uqpen.core.variables import Output

if TYPE_CHECKING:
    import xarray as xr

# Errors of measurement.


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


# Ends of sizes that the likelihood is integrated over, by the scale of a prior, and by the scatter
# of repeats. A step of the logarithm is this part of the deviation that as many rows leave.
_SIZES, _SIZES_BY_REPEATS, _SIZE_STEP = (1e-6, 1e3), (1e-3, 1e6), 0.25

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
        return MeasuredOutput(
            self.output,
            self.experiment[kept],
            {name: values[kept] for name, values in self.places.items()},
            self.values[kept],
            self.censoring[kept],
            self.lines[kept],
            self.errors.at(kept),
        )

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

    def size_densities(
        self, predicted: FloatArray, sizes: FloatArray, added: FloatArray | None = None
    ) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Yield sizes of its errors for some draws, and how likely they are with results.

        Parameters
        ----------
        predicted : ndarray, shape (draw, row)
        sizes : ndarray, shape (size, draw)
            Values of the numbers that are not known; one that is NaN is what the sizes are of.
        added : ndarray, shape (draw, row, row), optional
            Covariance that each draw has beside that of the errors.

        Yields
        ------
        part : slice
            Some draws.
        sizes : ndarray, shape (size,)
            Evenly spread by their logarithms.
        log_density : ndarray, shape (draw, size)
            Logarithm of the part of each size in the likelihood, over the likelihood where it is
            the scale of its prior, or that of repeats.
        """
        errors, rows = self.errors, len(self.values)
        step = _SIZE_STEP / math.sqrt(2 * rows)
        lowest, highest = np.log(_SIZES if errors.size else _SIZES_BY_REPEATS).tolist()
        logarithms = np.arange(lowest, highest, step)
        squares = np.exp(2 * logarithms)
        if errors.size is not None:
            scale = errors.size.scale
            prior = logarithms - squares / 2 + math.log(step * math.sqrt(2 / math.pi))
        else:
            # The prior of the logarithm is flat, as the rows have all that repeats say of the size.
            # The density of the repeats themselves is that at their standard deviation.
            scale, half = float(errors.std[0]), errors.freedom / 2
            constant = half * math.log(half) - math.lgamma(half) - half + math.log(2 * step)
            prior = np.full(len(logarithms), constant)
            errors = replace(errors, std=np.zeros(rows))
        own, known = scale**2 * self.correlation, np.nan_to_num(sizes)
        is_common = added is None and errors.discrepancy is None and not errors.depends_on_model
        at_once = max(1, _MOST_ENTRIES // (rows * max(rows, len(squares))))
        turned, parts = np.empty(0), np.empty(0)
        for first in range(0, len(predicted), at_once):
            part = slice(first, first + at_once)
            if not (is_common and first):
                of = slice(0, 1) if is_common else part
                whole = errors.covariance(predicted[of], known[:, of], self.correlation) + own
                if added is not None:
                    whole = whole + added[of]
                # In the axes of the part of this size in the whole, both are diagonal.
                inverse = np.linalg.inv(np.linalg.cholesky(whole))
                parts, axes = np.linalg.eigh(inverse @ own @ inverse.swapaxes(-2, -1))
                turned, parts = axes.swapaxes(-2, -1) @ inverse, parts[..., np.newaxis]
            off = predicted[part] - self.values
            every = np.broadcast_to(turned, (len(off), rows, rows))
            variance = 1 - parts + parts * squares
            excess = np.broadcast_to(1 / variance - 1, (len(off), rows, len(squares)))
            along = np.einsum("drs,ds->dr", every, off, optimize=False) ** 2
            sums = np.einsum("dr,drs->ds", along, excess, optimize=False)
            density = prior - 0.5 * (np.log(variance).sum(axis=1) + sums)
            yield part, scale * np.exp(logarithms), density

    def size_quantiles(
        self, predicted: FloatArray, sizes: FloatArray, shares: FloatArray
    ) -> FloatArray:
        """Return sizes of its errors below which they are with some probabilities, shape (draw,).

        Parameters
        ----------
        predicted, sizes : ndarray
            As in `size_densities`.
        shares : ndarray, shape (draw,)
            The probabilities, given the results of each draw.
        """
        found = np.empty(len(predicted))
        for part, nodes, densities in self.size_densities(predicted, sizes):
            density = np.exp(densities - densities.max(axis=1, keepdims=True))
            steps = (density[:, 1:] + density[:, :-1]) / 2
            below = np.cumsum(steps, axis=1)
            wanted = shares[part, np.newaxis] * below[:, -1:]
            at = np.argmax(below >= wanted, axis=1)[:, np.newaxis]
            over = np.take_along_axis(below, at, axis=1) - wanted
            inside = 1 - over / np.take_along_axis(steps, at, axis=1)
            found[part] = (nodes[at] * (nodes[1] / nodes[0]) ** inside)[:, 0]
        return found

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
class MeasuredOutputs:
    """A section ``[measured.<name>]``: experiments, and what was measured in each.

    Rows of equal conditions are one experiment. Its values are in SI units.
    """

    name: str
    unknown: tuple[str, ...]  # inputs that have one value, which the measurements teach
    varies: tuple[str, ...]  # inputs that have another value in each experiment
    fixed: tuple[str, ...]  # random inputs that are held at their medians
    conditions: Mapping[str, FloatArray]  # (experiment,): inputs that are known for each
    condition_std: Mapping[str, FloatArray]  # (experiment,): of those that have an error
    outputs: tuple[MeasuredOutput, ...]
    experiments: int
    source: str = ""  # where they were published
    file: FileSnapshot | None = None
    # Experiments of the rows in which nothing was measured, or that are held out: their values are
    # NaN, and their errors have the numbers that are not known, nothing else.
    blank: MeasuredOutputs | None = None
    # The rows that are held out, in the experiments of those; and all rows. None for none held out.
    left_out: MeasuredOutputs | None = None
    whole: MeasuredOutputs | None = None

    def without_discrepancy(self) -> MeasuredOutputs:
        """Return the same experiments, in which the model has no error of its own."""
        outputs = (
            replace(each, errors=replace(each.errors, discrepancy=None)) for each in self.outputs
        )
        blank = self.blank and self.blank.without_discrepancy()
        return replace(self, outputs=tuple(outputs), blank=blank)

    @property
    def row_hashes(self) -> list[str]:
        """Hashes of its rows by value, so that the same data are known in another file or order."""
        found = []
        for each in self.outputs:
            for row, value in enumerate(each.values):
                at = each.experiment[row]
                numbers = {name: values[at] for name, values in self.conditions.items()}
                numbers |= {name: values[row] for name, values in each.places.items()}
                parts = [f"{name}={numbers[name]:.5e}" for name in sorted(numbers)]
                text = ";".join([each.output.name, *parts, f"{each.censoring[row]}{value:.5e}"])
                found.append(hashlib.sha256(text.encode()).hexdigest()[:16])
        return found


# How far off a model may be at them.


@dataclass(frozen=True)
class ValidationSettings:
    """A section ``[validation.<name>]``: what is accepted, and what is known beside the runs."""

    accept: Mapping[str, float] = field(default_factory=dict)  # by output, in SI units
    numerical_std: Mapping[str, float] = field(default_factory=dict)  # by output, in SI units
    fitted: MeasuredOutputs | None = None  # the rows that inputs were fitted to, if any
    fitted_inputs: int = 0  # number of these inputs


# Measurements of one or several sections, one after the other.

# Largest number of entries of covariances that are in memory at once.
_MOST_ENTRIES = 2**22


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments of one or several sections, with the covariance of their errors.

    Experiments are numbered through all sections, and so are rows: by section, by output, in the
    order of the file.
    """

    sections: tuple[MeasuredOutputs, ...]

    @property
    def name(self) -> str:
        """Names of the sections."""
        return ", ".join(each.name for each in self.sections)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Inputs that they teach."""
        return tuple(dict.fromkeys(name for each in self.sections for name in each.unknown))

    @property
    def moved(self) -> tuple[str, ...]:
        """Inputs with a value of their own in each experiment that is not known exactly."""
        names = ((*each.varies, *each.condition_std) for each in self.sections)
        return tuple(dict.fromkeys(name for of_section in names for name in of_section))

    @property
    def count(self) -> int:
        """Number of experiments."""
        return sum(each.experiments for each in self.sections)

    @cached_property
    def outputs(self) -> tuple[tuple[int, MeasuredOutput], ...]:
        """The measured outputs, each with the number of the first experiment of its section."""
        found, first = [], 0
        for section in self.sections:
            found += [(first, each) for each in section.outputs]
            first += section.experiments
        return tuple(found)

    @cached_property
    def values(self) -> FloatArray:
        """Measured values, shape (row,)."""
        return np.concatenate([each.values for _, each in self.outputs])

    @cached_property
    def censoring(self) -> IntArray:
        """Censoring of each row: `AT_LEAST`, `EXACTLY` or `AT_MOST`; shape (row,)."""
        return np.concatenate([each.censoring for _, each in self.outputs])

    @cached_property
    def experiment(self) -> IntArray:
        """Number of the experiment of each row, shape (row,)."""
        return np.concatenate([first + each.experiment for first, each in self.outputs])

    @property
    def sizes(self) -> tuple[UnknownSize, ...]:
        """Numbers of the errors that are not known, in the order of the outputs."""
        return tuple(size for _, each in self.outputs for size in each.errors.sizes)

    @cached_property
    def integrated(self) -> dict[int, tuple[MeasuredOutput, slice]]:
        """Sizes that the likelihood is integrated over, by number: an output each, and its rows.

        They are those of all errors of an output beside known parts.
        """
        found, number = {}, 0
        for each, own in self.rows:
            errors, is_exact = each.errors, (each.censoring == EXACTLY).all()
            if errors.size is not None and errors.discrepancy is None and is_exact:
                found[number] = each, own
            number += len(errors.sizes)
        return found if self.unknown else {}

    def integrated_sizes(
        self, predicted: FloatArray, sizes: FloatArray, shares: FloatArray
    ) -> FloatArray:
        """Return sizes, where they are NaN those below which they are with some probabilities.

        Parameters
        ----------
        predicted : ndarray, shape (draw, row)
            NaN where a run failed.
        sizes, shares : ndarray, shape (draw, size)
        """
        found, completed = sizes.copy(), np.isfinite(predicted).all(axis=1)
        for number, (each, own) in self.integrated.items():
            drawn = np.flatnonzero(completed & np.isnan(sizes[:, number]))
            none = sizes[drawn, number][np.newaxis]
            of_draws = predicted[drawn][:, own], none, shares[drawn, number]
            found[drawn, number] = each.size_quantiles(*of_draws)
        return found

    def sizes_by_repeats(
        self, predicted: FloatArray, sizes: FloatArray, rng: np.random.Generator
    ) -> Iterator[tuple[MeasuredOutput, slice, FloatArray]]:
        """Yield outputs whose size of errors follows from repeats, their rows, and draws of it.

        Parameters
        ----------
        predicted : ndarray, shape (draw, row)
            Finite.
        sizes : ndarray, shape (draw, size)
        rng : Generator
            Source of a size for each draw, given its results.
        """
        for each, own, of_output in self._sizes_of(sizes):
            if each.is_by_repeats:
                shares = rng.random(len(predicted))
                yield each, own, each.size_quantiles(predicted[:, own], of_output, shares)

    @property
    def has_discrepancy(self) -> bool:
        """True if the model may have an error of its own."""
        return any(each.errors.discrepancy is not None for _, each in self.outputs)

    @property
    def discrepancy_text(self) -> str:
        """Outputs whose model may have an error of its own, each with the condition along which."""
        found = ((each.output.name, each.errors.discrepancy) for _, each in self.outputs)
        return ", ".join(f"{name} along {of.along}" for name, of in found if of is not None)

    def without_discrepancy(self) -> Experiments:
        """Return the same experiments, in which the model has no error of its own."""
        if not self.has_discrepancy:
            return self
        return Experiments(tuple(each.without_discrepancy() for each in self.sections))

    @cached_property
    def blank(self) -> Experiments:
        """Experiments of the rows in which nothing was measured, or that are held out."""
        return Experiments(tuple(each.blank for each in self.sections if each.blank is not None))

    @cached_property
    def left_out(self) -> Experiments:
        """Measured rows that no fit learns from, in the experiments of `blank`."""
        found = (each.left_out for each in self.sections)
        return Experiments(tuple(each for each in found if each is not None))

    def measured_rows(self, **statistics: FloatArray) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield all measured values, what is known of them, and statistics of each by name.

        The names are those of the catalogue, each of shape (row,).
        """
        import xarray as xr

        yield from self.described_rows(slice(None))
        names = [each.output.name for each, own in self.rows for _ in self.values[own]]
        along = {MEASURED_ROW: np.arange(1, len(names) + 1)}
        yield "measured_output", xr.DataArray(np.array(names, dtype=object), along, (MEASURED_ROW,))
        for name, values in {"measured": self.values, **statistics}.items():
            yield name, xr.DataArray(values, along, (MEASURED_ROW,))

    def described_rows(self, own: slice) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield what is known of some rows, by the names of the catalogue: numbers and conditions.

        Parameters
        ----------
        own : slice
            The rows.
        """
        import xarray as xr

        rows = len(self.values)
        conditions: dict[str, FloatArray] = {}
        lines = np.concatenate([each.lines for _, each in self.outputs])
        first = start = 0
        for section in self.sections:
            inside = slice(first, first + sum(len(each.values) for each in section.outputs))
            for name, values in section.conditions.items():
                column = conditions.setdefault(name, np.full(rows, np.nan))
                column[inside] = values[self.experiment[inside] - start]
            first, start = inside.stop, start + section.experiments
        for each, of_output in self.rows:
            for name, values in each.places.items():
                conditions.setdefault(name, np.full(rows, np.nan))[of_output] = values
        along = {MEASURED_ROW: np.arange(1, len(lines[own]) + 1)}
        for name, numbers in (
            ("experiment_number", self.experiment + 1),
            ("file_row", lines),
            ("bound_side", self.censoring),
            ("row_hash", np.array(self.row_hashes, dtype=object)),
        ):
            yield name, xr.DataArray(numbers[own], along, (MEASURED_ROW,))
        if conditions:
            whole = np.stack([*conditions.values()], axis=-1)[own]
            both = along | {MEASURED_CONDITION: [*conditions]}
            yield "condition", xr.DataArray(whole, both, (MEASURED_ROW, MEASURED_CONDITION))

    @property
    def row_hashes(self) -> list[str]:
        """Hashes of all rows by value; see `MeasuredOutputs.row_hashes`."""
        return [each for section in self.sections for each in section.row_hashes]

    @property
    def rows(self) -> Iterator[tuple[MeasuredOutput, slice]]:
        """The measured outputs, each with its rows."""
        at = 0
        for _, each in self.outputs:
            yield each, slice(at, at + len(each.values))
            at += len(each.values)

    @property
    def freedom(self) -> float:
        """Fewest degrees of freedom of errors whose size follows from repeats; else infinite."""
        return min(each.errors.freedom for _, each in self.outputs)

    @property
    def has_one_unknown_size(self) -> bool:
        """True if the size of all errors is one unknown number, and they have no other part."""
        (_, first), *others = self.outputs
        errors = first.errors
        alone = errors.shared_std is None and not errors.std.any() and not errors.share.any()
        alone = alone and errors.discrepancy is None
        return errors.size is not None and alone and not (others or self.moved)

    @property
    def has_fixed_errors(self) -> bool:
        """True if no result of the model, and no unknown size, changes their covariance."""
        depends = any(each.errors.depends_on_model for _, each in self.outputs)
        return not (depends or self.moved) and (not self.sizes or self.has_one_unknown_size)

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        """Snapshots of their files."""
        return tuple(each.file for each in self.sections if each.file is not None)

    def inputs(self, draws: Arrays, others: Mapping[str, float]) -> dict[str, FloatArray]:
        """Return the inputs of runs: one of each experiment for each draw.

        Parameters
        ----------
        draws : mapping of str to ndarray, shape (draw,) or (draw, experiment)
            Values of unknown inputs, and of others that are not at their medians.
        others : mapping of str to float
            Values of all random inputs that are neither drawn nor conditions.

        Returns
        -------
        mapping of str to ndarray, shape (draw * experiment,)
            All experiments of the first draw come first.
        """
        size = len(next(iter(draws.values())))
        names = dict.fromkeys([*others, *draws])
        names |= dict.fromkeys(name for each in self.sections for name in each.conditions)
        found = {}
        for name in names:
            drawn = draws.get(name)
            parts = []
            first = 0
            for section in self.sections:
                own = slice(first, first + section.experiments)
                shape = (size, section.experiments)
                first += section.experiments
                if drawn is not None:
                    part = drawn[:, own] if drawn.ndim == 2 else drawn[:, np.newaxis]
                elif name in section.conditions:
                    part = section.conditions[name]
                else:
                    part = np.array(others[name])
                parts.append(np.broadcast_to(part, shape))
            found[name] = np.concatenate(parts, axis=1).ravel()
        return found

    def moved_inputs(
        self, name: str, others: Mapping[str, float], std: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the middle and the standard deviation of an input in each experiment.

        Parameters
        ----------
        name : str
            One of `moved`.
        others : mapping of str to float
            As in `inputs`.
        std : float
            Standard deviation of an input that varies.
        """
        middle, spread = [], []
        for section in self.sections:
            known = section.conditions.get(name)
            at = (
                np.full(section.experiments, others.get(name, math.nan)) if known is None else known
            )
            middle.append(at)
            varies = std if name in section.varies else 0.0
            spread.append(section.condition_std.get(name, np.full(section.experiments, varies)))
        return np.concatenate(middle), np.concatenate(spread)

    def drawn(self, runs: xr.Dataset, name: str) -> FloatArray:
        """Return the values of an unknown input in the runs of `inputs`, shape (draw,)."""
        first = 0
        for section in self.sections:
            if name in section.unknown:
                break
            first += section.experiments
        found: FloatArray = runs[name].values[first :: self.count]
        return found

    def predicted(self, runs: xr.Dataset) -> FloatArray:
        """Return the results of runs at the rows, shape (draw, row).

        Parameters
        ----------
        runs : Dataset
            In the order of `inputs`.
        """
        parts = []
        for first, each in self.outputs:
            values = runs[each.output.name].values
            at = values.reshape(-1, self.count, *each.output.shape)
            parts.append(each.predicted(at[:, first:]))
        return np.concatenate(parts, axis=1)

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
        rows = len(self.values)
        found = np.zeros((*predicted.shape[:-1], rows, rows))
        for each, own, of_output in self._sizes_of(sizes):
            part = each.errors.covariance(predicted[..., own], of_output, each.correlation)
            found[..., own, own] = part
        if slopes is not None and len(slopes):
            same = np.equal.outer(self.experiment, self.experiment)
            found += (slopes.T @ slopes) * same
        return found

    def model_covariance(self, sizes: FloatArray) -> FloatArray:
        """Return the covariance of the model's own errors, shape (..., row, row)."""
        rows = len(self.values)
        found = np.zeros((*np.shape(sizes)[:-1], rows, rows))
        for each, own, of_output in self._sizes_of(sizes):
            found[..., own, own] = each.errors.model_covariance(of_output)
        return found

    def discrepancies(
        self, off: FloatArray, covariance: FloatArray, sizes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of the model's own errors at the blank rows, each (row,).

        Parameters
        ----------
        off : ndarray, shape (row,)
            Measured values minus results of a draw.
        covariance : ndarray, shape (row, row)
            Of these.
        sizes : ndarray, shape (size,)
            Values of `sizes`.
        """
        across = np.zeros((len(self.blank.values), len(off)))
        variance = np.zeros(len(across))
        both = zip(self._sizes_of(sizes), self.blank.rows, strict=True)
        for (each, own, of_output), (beyond, at) in both:
            if (here := each.errors.discrepancy) and (there := beyond.errors.discrepancy):
                across[at, own] = here.kernel(there.places, here.places, *of_output[-2:])
                variance[at] = np.diag(here.kernel(there.places, there.places, *of_output[-2:]))
        # A bound is no value that an error of the model follows from.
        exact = np.flatnonzero(self.censoring == EXACTLY)
        weights = np.linalg.solve(covariance[np.ix_(exact, exact)], across[:, exact].T)
        variance -= np.einsum("br,rb->b", across[:, exact], weights, optimize=False)
        return off[exact] @ weights, np.maximum(variance, 0.0)

    def _sizes_of(
        self, sizes: FloatArray | Sequence[float]
    ) -> Iterator[tuple[MeasuredOutput, slice, FloatArray]]:
        """Yield the measured outputs, each with its rows and its numbers, shape (size, ...)."""
        values, first = np.moveaxis(np.asarray(sizes, dtype=np.float64), -1, 0), 0
        for each, own in self.rows:
            last = first + len(each.errors.sizes)
            yield each, own, values[first:last]
            first = last

    def likelihood(self, covariance: FloatArray) -> Likelihood:
        """Return the likelihood of results where the covariance of the errors is known."""
        return Likelihood(self, covariance)

    def log_likelihood(
        self,
        predicted: FloatArray,
        sizes: FloatArray | None = None,
        added: FloatArray | None = None,
    ) -> FloatArray:
        """Return the logarithm of the likelihood of results, shape (draw,).

        It is integrated over the size of errors that follows from repeats, so that it is Student's
        t, where none of their output's values is a bound.

        Parameters
        ----------
        predicted : ndarray, shape (draw, row)
            NaN where a run failed.
        sizes : ndarray, shape (draw, size), optional
            Values of `sizes`. One that is `integrated` may be NaN in all draws: then the
            likelihood is its mean over the prior of this one.
        added : ndarray, shape (draw, row, row), optional
            Covariance that each draw has beside that of the errors.
        """
        drawn = np.zeros((len(predicted), 0)) if sizes is None else sizes
        scales = np.array([each.scale for each in self.sizes])[: drawn.shape[1]]
        found = self._normal_likelihood(predicted, np.where(np.isnan(drawn), scales, drawn), added)
        kept = np.flatnonzero(np.isfinite(found))
        for each, own, of_output in self._sizes_of(drawn[kept]):
            if each.is_by_repeats or np.isnan(of_output).any():
                more = None if added is None else added[kept][:, own, own]
                densities = each.size_densities(predicted[kept][:, own], of_output, more)
                for part, _, density in densities:
                    found[kept[part]] += scipy.special.logsumexp(density, axis=1)
        return found

    def _normal_likelihood(
        self, predicted: FloatArray, drawn: FloatArray, added: FloatArray | None
    ) -> FloatArray:
        """Return the same where all sizes are known."""
        found = np.full(len(predicted), np.nan)
        completed = np.flatnonzero(np.isfinite(predicted).all(axis=1))
        depends = any(each.errors.depends_on_model for _, each in self.outputs) or drawn.size
        more = np.zeros((len(predicted), 1, 1)) if added is None else added
        if not depends and added is None and len(completed):
            covariance = self.covariance(predicted[completed[0]])
            found[completed] = self.likelihood(covariance).log_density(predicted[completed])
            return found
        if (self.censoring == EXACTLY).all():
            at_once = max(1, _MOST_ENTRIES // len(self.values) ** 2)
            for part in np.split(completed, range(at_once, len(completed), at_once)):
                covariance = self.covariance(predicted[part], drawn[part]) + more[part]
                # A share of a result that is 0 allows no other measured value.
                known = (np.diagonal(covariance, axis1=-2, axis2=-1) > 0).all(axis=-1)
                part, lower = part[known], np.linalg.cholesky(covariance[known])
                off = (predicted[part] - self.values)[..., np.newaxis]
                squares = (np.linalg.solve(lower, off) ** 2).sum(axis=(-2, -1))
                logarithms = np.log(np.diagonal(lower, axis1=-2, axis2=-1)).sum(axis=-1)
                found[part] = -0.5 * (squares + len(self.values) * math.log(2 * math.pi))
                found[part] -= logarithms
            return found
        for draw in completed.tolist():
            covariance = self.covariance(predicted[draw], drawn[draw]) + more[draw]
            at = slice(draw, draw + 1)
            found[at] = self.likelihood(covariance).log_density(predicted[at])
        return found


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Likelihood of a model's results, where the covariance of the errors is known.

    Rows that are bounds count by the probability of an error that large, given the errors of the
    values; two bounds are taken as independent of each other.
    """

    measured: Experiments
    covariance: FloatArray  # (row, row)

    @cached_property
    def _is_value(self) -> IntArray:
        return np.flatnonzero(self.measured.censoring == EXACTLY)

    @cached_property
    def _factor(self) -> tuple[FloatArray, float]:
        """Inverse of the Cholesky factor of the values' covariance, and its log determinant."""
        at = self._is_value
        lower = np.linalg.cholesky(self.covariance[np.ix_(at, at)])
        inverse = scipy.linalg.solve_triangular(lower, np.eye(len(at)), lower=True)
        return inverse, 2 * float(np.log(np.diag(lower)).sum())

    def residuals(self, predicted: FloatArray) -> FloatArray:
        """Return residuals whose squares sum to -2 log likelihood, but for a constant.

        Parameters
        ----------
        predicted : ndarray, shape (draw, row)

        Returns
        -------
        ndarray, shape (draw, row)
            Of the values in their order, independent and with the variance 1; then of the bounds.
        """
        at, measured = self._is_value, self.measured
        inverse, _ = self._factor
        off = predicted[:, at] - measured.values[at]
        # Not by BLAS: no result depends on how many draws stand beside it.
        whitened = np.einsum("ij,dj->di", inverse, off, optimize=False)
        bounds = np.flatnonzero(measured.censoring != EXACTLY)
        if not len(bounds):
            return whitened
        joint = inverse @ self.covariance[np.ix_(at, bounds)]  # (value, bound)
        mean = -np.einsum("vb,dv->db", joint, whitened, optimize=False)
        std = np.sqrt(np.diag(self.covariance)[bounds] - (joint**2).sum(axis=0))
        sides = measured.censoring[bounds]
        distance = sides * (predicted[:, bounds] + mean - measured.values[bounds]) / std
        with np.errstate(invalid="ignore"):
            beyond = np.sqrt(-2 * scipy.special.log_ndtr(distance))
        return np.concatenate([whitened, beyond], axis=1)

    def log_density(self, predicted: FloatArray) -> FloatArray:
        """Return the logarithm of the likelihood, shape (draw,)."""
        _, determinant = self._factor
        constant = determinant + len(self._is_value) * math.log(2 * math.pi)
        found: FloatArray = -0.5 * ((self.residuals(predicted) ** 2).sum(axis=1) + constant)
        return found
