"""Functions that ought to ascend, such as distribution functions and their bounds.

References
----------
Ubhaya, V. A. (1974). J. Approx. Theory 12, 146-159.
"""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["ascending", "largest_up_to", "least_from"]


def largest_up_to(found: FloatArray) -> FloatArray:
    """Return the largest of all values up to each."""
    return np.maximum.accumulate(found)


def least_from(found: FloatArray) -> FloatArray:
    """Return the least of all values from each on."""
    return np.minimum.accumulate(found[::-1])[::-1]


def ascending(found: FloatArray) -> FloatArray:
    """Return the ascending function that is nearest in the largest distance.

    If the true function ascends, it is no farther from that. A function that is nowhere above
    another one stays so, and bounds contain their estimate.

    >>> ascending(np.array([0.0, 0.5, 0.25, 1.0])).tolist()
    [0.0, 0.375, 0.375, 1.0]
    """
    return (largest_up_to(found) + least_from(found)) / 2
