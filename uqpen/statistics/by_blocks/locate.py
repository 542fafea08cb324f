"""Place of each value among ascending splitters, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray
from uqpen.models.compiled import compiled

__all__ = ["Cells", "Places", "locate"]

Cells = npt.NDArray[np.int32]
# Half the memory of integers of four bytes, so that more of a table stays near the processor.
Places = npt.NDArray[np.uint16]

_FLOATS = "Array(float64, 1, 'C', True)"


@compiled(f"void({_FLOATS}, {_FLOATS}, float64, float64, Array(uint16, 1, 'C', True), int32[::1])")
def locate(
    values: FloatArray,
    splitters: FloatArray,
    origin: float,
    scale: float,
    first: Places,
    found: Cells,
) -> None:
    """Write the cell of each value; see `Splitters.locate`.

    Equal steps from `origin` are the entries of `first`, which holds the splitters before each.
    So a search takes few steps, and none that depends on rounding: the same steps placed the
    splitters. Two NaN follow the splitters: no value is above them or at them.
    """
    last = first.size - 2
    # A loop of its own, as the compiler then takes several values at once.
    for k in range(values.size):
        step = (values[k] - origin) * scale
        found[k] = int(step) if 0.0 <= step < last else (last if step > 0.0 else 0)
    for k in range(values.size):
        value, entry = values[k], found[k]
        low, high = np.int64(first[entry]), np.int64(first[entry + 1])
        while high - low > 2:
            middle = (low + high) >> 1
            if splitters[middle] < value:
                low = middle + 1
            else:
                high = middle
        # Comparisons that are added, in place of branches, which the processor would guess wrong.
        low += splitters[low] < value
        low += splitters[low] < value
        found[k] = 2 * low + (splitters[low] == value)
