"""Runs of a sample in which an event is known, and whether it occurs in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.sample import Sample

__all__ = ["event_sample"]


def event_sample(
    event: JointEvent, samples: Mapping[str, Sample], level: float
) -> tuple[Sample, BoolArray]:
    """Return the runs that decide on an event, and in which of them it occurs.

    Some runs may lack a derived output; those that have all outputs of the event are used. Of a
    conditional event, those are used that meet the condition. A missing run may meet it or not.

    Parameters
    ----------
    event : JointEvent
    samples : mapping of str to Sample
        Of its outputs at least, over the same design.
    level : float
        Confidence level of intervals of the sample.

    Returns
    -------
    sample : Sample
        Its values are 1 where the event occurs, else 0.
    occurs : ndarray of bool, shape (run,)
    """
    used = reduce(np.intersect1d, (samples[name].used for name in sorted(event.outputs)))
    columns = {name: _at(samples[name], used) for name in event.outputs}
    occurs, counts = event.occurs(columns), event.counts(columns)
    if counts is not None:
        used, occurs = used[counts], occurs[counts]
    values = occurs.astype(np.float64)
    return replace(samples[event.limits[0].output], used=used, values=values, level=level), occurs


def _at(sample: Sample, used: IntArray) -> FloatArray:
    """Return the values of a sample in some of its runs."""
    return sample.values[np.isin(sample.used, used, assume_unique=True)]
