"""Grids over the inputs: every combination of some values of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from uqpen.core.errors import Problem

Number = TypeVar("Number", np.float64, np.int64)

# Most nodes of a grid, which doubles or trebles with every input: a mistake goes far beyond.
_MOST_NODES = 10_000_000


def tensor_grid(columns: Sequence[npt.NDArray[Number]]) -> list[npt.NDArray[Number]]:
    """Return every combination of the entries of some columns; the last column varies fastest."""
    before, after = 1, math.prod(map(len, columns))
    grid = []
    for column in columns:  # not by `meshgrid`, which takes no more than 32 columns
        after //= len(column)
        grid.append(np.tile(np.repeat(column, after), before))
        before *= len(column)
    return grid


def too_many_nodes(setting: str, value: int, nodes: int, inputs: int) -> Iterator[Problem]:
    """Yield a problem with a setting and its value if its grid over the inputs is too large."""
    if nodes > _MOST_NODES:
        found = f"{value}, which over {inputs} random inputs takes {nodes:.3g} runs"
        expected = f"a grid of at most {_MOST_NODES:_} runs: fewer nodes, or fewer random inputs"
        yield Problem((setting,), found, expected)
