"""Likelihood of a model's results at measured values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.measurements.errors import EXACTLY, MeasuredOutput, RowErrors

# Largest number of entries of covariances that are in memory at once.
_MOST_ENTRIES = 2**22


@dataclass(frozen=True, eq=False)
class NormalLikelihood:
    """Likelihood of a model's results by normal errors whose covariance is known.

    Rows that are bounds count by the probability of an error that large, given the errors of the
    values; two bounds are taken as independent of each other.
    """

    values: FloatArray  # (row,): what was measured
    censoring: IntArray  # (row,): `AT_LEAST`, `EXACTLY` or `AT_MOST`
    covariance: FloatArray  # (row, row): of these

    @cached_property
    def _is_value(self) -> IntArray:
        return np.flatnonzero(self.censoring == EXACTLY)

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
        at = self._is_value
        inverse, _ = self._factor
        off = predicted[:, at] - self.values[at]
        # Not by BLAS: no result depends on how many draws stand beside it.
        whitened = np.einsum("ij,dj->di", inverse, off, optimize=False)
        bounds = np.flatnonzero(self.censoring != EXACTLY)
        if not len(bounds):
            return whitened
        joint = inverse @ self.covariance[np.ix_(at, bounds)]  # (value, bound)
        mean = -np.einsum("vb,dv->db", joint, whitened, optimize=False)
        std = np.sqrt(np.diag(self.covariance)[bounds] - (joint**2).sum(axis=0))
        sides = self.censoring[bounds]
        distance = sides * (predicted[:, bounds] + mean - self.values[bounds]) / std
        with np.errstate(invalid="ignore"):
            beyond = np.sqrt(-2 * scipy.special.log_ndtr(distance))
        return np.concatenate([whitened, beyond], axis=1)

    def log_density(self, predicted: FloatArray) -> FloatArray:
        """Return the logarithm of the likelihood, shape (draw,)."""
        _, determinant = self._factor
        constant = determinant + len(self._is_value) * math.log(2 * math.pi)
        found: FloatArray = -0.5 * ((self.residuals(predicted) ** 2).sum(axis=1) + constant)
        return found


# Ends of sizes that the likelihood is integrated over, by the scale of a prior, and by the scatter
# of repeats. A step of the logarithm is this part of the deviation that as many rows leave.
_SIZES, _SIZES_BY_REPEATS, _SIZE_STEP = (1e-6, 1e3), (1e-3, 1e6), 0.25


def _size_densities(
    measured: MeasuredOutput,
    predicted: FloatArray,
    sizes: FloatArray,
    added: FloatArray | None = None,
) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
    """Yield some draws, sizes of the errors of an output, and how likely these are with results.

    That is the logarithm of the part of each size in the likelihood, over the likelihood where it
    is the scale of its prior, or that of repeats; shape (draw, size). The sizes are evenly spread
    by their logarithms. `sizes` are numbers of shape (number, draw): one that is NaN is the one to
    integrate over, the others are known. `added` is a covariance beside that of the errors.
    """
    errors, rows = measured.errors, len(measured.values)
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
    own, known = scale**2 * measured.correlation, np.nan_to_num(sizes)
    is_common = added is None and errors.discrepancy is None and not errors.depends_on_model
    at_once = max(1, _MOST_ENTRIES // (rows * max(rows, len(squares))))
    turned, parts = np.empty(0), np.empty(0)
    for first in range(0, len(predicted), at_once):
        part = slice(first, first + at_once)
        if not (is_common and first):
            of = slice(0, 1) if is_common else part
            whole = errors.covariance(predicted[of], known[:, of], measured.correlation) + own
            if added is not None:
                whole = whole + added[of]
            # In the axes of the part of this size in the whole, both are diagonal.
            inverse = np.linalg.inv(np.linalg.cholesky(whole))
            parts, axes = np.linalg.eigh(inverse @ own @ inverse.swapaxes(-2, -1))
            turned, parts = axes.swapaxes(-2, -1) @ inverse, parts[..., np.newaxis]
        off = predicted[part] - measured.values
        every = np.broadcast_to(turned, (len(off), rows, rows))
        variance = 1 - parts + parts * squares
        excess = np.broadcast_to(1 / variance - 1, (len(off), rows, len(squares)))
        along = np.einsum("drs,ds->dr", every, off, optimize=False) ** 2
        sums = np.einsum("dr,drs->ds", along, excess, optimize=False)
        density = prior - 0.5 * (np.log(variance).sum(axis=1) + sums)
        yield part, scale * np.exp(logarithms), density


def _size_quantiles(
    measured: MeasuredOutput, predicted: FloatArray, sizes: FloatArray, shares: FloatArray
) -> FloatArray:
    """Return the size of the errors of an output below which each draw has a share of them."""
    found = np.empty(len(predicted))
    for part, nodes, densities in _size_densities(measured, predicted, sizes):
        density = np.exp(densities - densities.max(axis=1, keepdims=True))
        steps = (density[:, 1:] + density[:, :-1]) / 2
        below = np.cumsum(steps, axis=1)
        wanted = shares[part, np.newaxis] * below[:, -1:]
        at = np.argmax(below >= wanted, axis=1)[:, np.newaxis]
        over = np.take_along_axis(below, at, axis=1) - wanted
        inside = 1 - over / np.take_along_axis(steps, at, axis=1)
        found[part] = (nodes[at] * (nodes[1] / nodes[0]) ** inside)[:, 0]
    return found


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Likelihood of a model's results, integrated over sizes of errors that are not given."""

    values: FloatArray  # (row,): what was measured
    censoring: IntArray  # (row,): `AT_LEAST`, `EXACTLY` or `AT_MOST`
    errors: RowErrors

    def at(self, covariance: FloatArray) -> NormalLikelihood:
        """Return the likelihood where the covariance of the errors is known."""
        return NormalLikelihood(self.values, self.censoring, covariance)

    @cached_property
    def integrated(self) -> dict[int, tuple[MeasuredOutput, slice]]:
        """Sizes that the likelihood is integrated over, by number: an output each, and its rows.

        They are those of all errors of an output beside known parts.
        """
        found, number = {}, 0
        for each, own in self.errors.rows:
            errors, is_exact = each.errors, (each.censoring == EXACTLY).all()
            if errors.size is not None and errors.discrepancy is None and is_exact:
                found[number] = each, own
            number += len(errors.sizes)
        return found

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
            found[drawn, number] = _size_quantiles(each, *of_draws)
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
        for each, own, of_output in self.errors.sizes_of(sizes):
            if each.is_by_repeats:
                shares = rng.random(len(predicted))
                yield each, own, _size_quantiles(each, predicted[:, own], of_output, shares)

    def log_density(
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
            Values of `errors.sizes`. One that is `integrated` may be NaN in all draws: then the
            likelihood is its mean over the prior of this one.
        added : ndarray, shape (draw, row, row), optional
            Covariance that each draw has beside that of the errors.
        """
        drawn = np.zeros((len(predicted), 0)) if sizes is None else sizes
        scales = np.array(self.errors.scales)[: drawn.shape[1]]
        found = self._normal_log_density(predicted, np.where(np.isnan(drawn), scales, drawn), added)
        kept = np.flatnonzero(np.isfinite(found))
        for each, own, of_output in self.errors.sizes_of(drawn[kept]):
            if each.is_by_repeats or np.isnan(of_output).any():
                more = None if added is None else added[kept][:, own, own]
                densities = _size_densities(each, predicted[kept][:, own], of_output, more)
                for part, _, density in densities:
                    found[kept[part]] += scipy.special.logsumexp(density, axis=1)
        return found

    def _normal_log_density(
        self, predicted: FloatArray, drawn: FloatArray, added: FloatArray | None
    ) -> FloatArray:
        """Return the same where all sizes are known."""
        found = np.full(len(predicted), np.nan)
        completed = np.flatnonzero(np.isfinite(predicted).all(axis=1))
        depends = any(each.errors.depends_on_model for each, _ in self.errors.rows) or drawn.size
        more = np.zeros((len(predicted), 1, 1)) if added is None else added
        if not depends and added is None and len(completed):
            covariance = self.errors.covariance(predicted[completed[0]])
            found[completed] = self.at(covariance).log_density(predicted[completed])
            return found
        if (self.censoring == EXACTLY).all():
            at_once = max(1, _MOST_ENTRIES // len(self.values) ** 2)
            for part in np.split(completed, range(at_once, len(completed), at_once)):
                covariance = self.errors.covariance(predicted[part], drawn[part]) + more[part]
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
            covariance = self.errors.covariance(predicted[draw], drawn[draw]) + more[draw]
            found[draw] = self.at(covariance).log_density(predicted[[draw]])[0]
        return found
