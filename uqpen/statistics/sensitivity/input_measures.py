"""Coordinates of sensitivity measures along the inputs, and reasons for missing measures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.labels import INPUT
from uqpen.statistics import texts
from uqpen.statistics.sample import Sample

__all__ = [
    "input_coordinate",
    "input_names_coordinate",
    "mean_ranks",
    "reason_without_measure",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def input_coordinate(sample: Sample) -> dict[str, Any]:
    """Return the coordinate along ``input`` of statistics of a sample's inputs."""
    return input_names_coordinate(sample.inputs)


def input_names_coordinate(names: Sequence[str]) -> dict[str, Any]:
    """Return the coordinate along ``input``: the names of inputs."""
    return {INPUT: (INPUT, np.array(names, dtype=object), {"long_name": "input"})}


def reason_without_measure(sample: Sample, column: int, fewest: int) -> str:
    """Reason why a sensitivity measure of an input cannot be estimated; empty if it can.

    Parameters
    ----------
    sample : Sample
        Of the output.
    column : int
        The input, by its number in `Sample.inputs`.
    fewest : int
        The runs that the measure needs.
    """
    if sample.size < fewest:
        return sample.too_few_runs
    if sample.is_constant:
        return texts.CONSTANT_OUTPUT
    if not np.ptp(sample.points[sample.used, column]) > 0:
        return texts.CONSTANT_INPUT
    return ""


def mean_ranks(level: IntArray) -> FloatArray:
    """Ranks from 1; equal values share the mean of theirs.

    Parameters
    ----------
    level : ndarray of int, shape (run,)
        Number of each run's value among the ascending distinct values.
    """
    count = np.bincount(level)
    ranks: FloatArray = (np.cumsum(count) - (count - 1) / 2)[level]
    return ranks
