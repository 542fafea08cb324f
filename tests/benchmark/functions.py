"""Cheap functions of numbers between 0 and 1, on which it is known who wins."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def additive(a: Array, b: Array, c: Array) -> dict[str, Array]:
    return {"y": np.exp(a) + 2 * b + np.sqrt(1 + c)}


def step(a: Array, b: Array, c: Array) -> dict[str, Array]:
    return {"y": ((a > 1 / 3) & (b > 0.4)).astype(float) + c / 10}


def polynomial(a: Array, b: Array, c: Array) -> dict[str, Array]:
    return {"y": 1 + a * b + c**2}
