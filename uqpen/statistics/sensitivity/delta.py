"""Borgonovo's delta: effect of a known input on the whole distribution of an output."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.streams import Stream
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.input_columns import Ordering
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.input_measures import (
    input_array,
    reason_without_measure,
)

_FEWEST_RUNS = 48
# Normal scores beyond lie in the outermost cells.
_FARTHEST_SCORE = 4.0
# Cells of the normal scores.
_CELLS = 80
_RESAMPLES = 30
_MOST_CLASSES = 48


def delta(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Moment-independent measure delta: 0 for no influence, 1 where the input decides all.

    Yields
    ------
    name : str
        ``delta``.
    estimate : DataArray
        Along ``input`` and ``bound``, without bounds.

    References
    ----------
    Borgonovo, E. (2007). Reliab. Eng. Syst. Saf. 92, 771-784.
    Plischke, E., Borgonovo, E. & Smith, C. L. (2013). Eur. J. Oper. Res. 226, 536-550.
    """
    if quantity.output.categories or not sample.inputs:
        return
    cells = _score_cells(_empirical_cdf(sample.ordering))
    estimates = [_estimate(sample, cells, column) for column in range(len(sample.inputs))]
    long_name = f"delta of {quantity.output.title}: how far knowing an input moves its distribution"
    if sample.dependence:
        long_name = f"{long_name}, {texts.INCLUDES_CORRELATION}"
    yield "delta", input_array(estimates, sample.inputs, long_name)


def _estimate(sample: Sample, cells: IntArray, column: int) -> Estimate:
    if reason := reason_without_measure(sample, column, _FEWEST_RUNS):
        return Estimate.without_bounds(math.nan, reason)
    is_coded = sample.columns.is_coded(column)
    first_cells = sample.run_inputs.once(
        ("cells of classes", column),
        lambda: _first_cells(sample.run_inputs.ordering(column), is_coded=is_coded),
    )
    counts = _counts(first_cells, cells, is_coded=is_coded)
    # Noise enlarges the distances. Resampling adds the same amount of noise once more.
    resampled = _distances(_resampled(counts)).mean()
    value = float(np.clip(2 * _distances(counts) - resampled, 0.0, 1.0))
    reason = sample.reason_without_intervals or texts.NO_INTERVAL_OF_DELTA
    return Estimate.without_bounds(value, reason)


def _score_cells(shares: FloatArray) -> IntArray:
    """Return the cell of a value's normal score, from the share of the runs below it.

    Delta does not depend on the scale that the output is measured on; on that of normal scores a
    heavy tail is as well resolved as the bulk.
    """
    scores = special.ndtri(shares)
    cells = np.floor((scores / _FARTHEST_SCORE + 1) / 2 * _CELLS).astype(np.int64)
    return np.clip(cells, 0, _CELLS - 1)


def _first_cells(ordering: Ordering, *, is_coded: bool) -> npt.NDArray[np.int16]:
    """Return where the cells of each run's class begin: a range of ranks, or one coded text."""
    if is_coded:
        return (ordering.level * _CELLS).astype(np.int16)
    classes = _class_count(len(ordering.order))
    which = np.floor(_empirical_cdf(ordering) * classes)
    return (which * _CELLS).astype(np.int16)


def _counts(first_cells: npt.NDArray[np.int16], cells: IntArray, *, is_coded: bool) -> FloatArray:
    """Count the runs in each cell, a row for each class of the input."""
    classes = int(first_cells.max()) // _CELLS + 1
    # Equal values are in one class, so that some may be empty.
    counts = np.bincount(first_cells + cells, minlength=classes * _CELLS)
    table = counts.reshape(classes, _CELLS).astype(np.float64)
    table = table[table.sum(axis=1) > 0]
    # Classes of texts are resampled in an order that no renaming changes.
    return table[np.lexsort(table.T)] if is_coded else table


def _class_count(runs: int) -> int:
    """Return the number of classes of an input (Plischke et al.)."""
    exponent = 2 / (7 + math.tanh((1500 - runs) / 500))
    return min(math.ceil(runs**exponent), _MOST_CLASSES)


def _empirical_cdf(ordering: Ordering) -> FloatArray:
    """Share of the runs below each value, where a run itself counts half."""
    shares: FloatArray = (ordering.mean_ranks - 0.5) / max(len(ordering.order), 1)
    return shares


def _resampled(counts: FloatArray) -> FloatArray:
    """Counts of runs drawn again with replacement, as many in each class, shape (draw, ...)."""
    generator = Stream(0, "analyses", "delta").generator()
    sizes = counts.sum(axis=1)
    draws = (_RESAMPLES, len(sizes))
    drawn = generator.multinomial(sizes.astype(np.int64), counts / sizes[:, None], draws)
    return drawn.astype(np.float64)


def _distances(counts: FloatArray) -> FloatArray:
    """Mean over the classes of half the area between their density and that of all runs.

    Both are smoothed by one Gaussian kernel, of Scott's bandwidth for the class: two kernels would
    set apart what is equal.

    Parameters
    ----------
    counts : ndarray, shape (..., class, cell)

    Returns
    -------
    ndarray, shape (...)
    """
    sizes = counts.sum(axis=-1)
    shares = counts / sizes[..., None]
    width = 2 * _FARTHEST_SCORE / _CELLS
    centres = (np.arange(_CELLS) + 0.5) * width - _FARTHEST_SCORE
    mean = (shares * centres).sum(axis=-1)
    spread = np.sqrt(np.maximum((shares * centres**2).sum(axis=-1) - mean**2, 0.0))
    bandwidth = spread * sizes**-0.2
    # Smoothing is damping of frequencies. The function is continued evenly beyond both ends, so
    # that its integral stays the same.
    whole = counts.sum(axis=-2, keepdims=True) / sizes.sum(axis=-1)[..., None, None]
    difference = shares - whole
    mirrored = np.concatenate([difference, difference[..., ::-1]], axis=-1)
    frequency = np.pi * np.arange(_CELLS + 1) / _CELLS / width
    damping = np.exp(-((bandwidth[..., None] * frequency) ** 2) / 2)
    smoothed = np.fft.irfft(np.fft.rfft(mirrored, axis=-1) * damping, 2 * _CELLS, axis=-1)
    distances = np.abs(smoothed[..., :_CELLS]).sum(axis=-1) / 2
    return np.asarray((sizes * distances).sum(axis=-1) / sizes.sum(axis=-1))
