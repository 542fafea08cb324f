"""Place of each value among ascending splitters, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray
from uqpen.core.compiled import compiled

__all__ = ["Cells", "locate"]

Cells = npt.NDArray[np.int32]


@compiled
def locate(
    values: FloatArray,
    splitters: FloatArray,
    origin: float,
    scale: float,
    first: Cells,
    found: Cells,
) -> None:
    """Write the cell of each value; see `Splitters.locate`.

    Equal steps from `origin` are the entries of `first`, which holds the splitters before each.
    So a search takes few steps, and none that depends on rounding: the same steps placed the
    splitters.
    """
    last = first.size - 2
    for k in range(values.size):
        value = values[k]
        step = (value - origin) * scale
        entry = int(step) if 0.0 <= step < last else (last if step > 0.0 else 0)
        low, high = first[entry], first[entry + 1]
        while low < high:
            middle = (low + high) >> 1
            if splitters[middle] < value:
                low = middle + 1
            else:
                high = middle
        at_splitter = low < splitters.size and splitters[low] == value
        found[k] = 2 * low + (1 if at_splitter else 0)
