"""Models that lose runs, for the yardstick: one raises, gives NaN, ends its process or hangs."""

from __future__ import annotations

import math
import os
import time


def simulate(x: float, y: float, z: float, length: float, scale: float) -> dict[str, float]:
    """Depths and a load; it raises in a part of the input space and gives NaN in another."""
    if x > 1.8:
        raise ValueError("x is too large")
    depth = scale * math.exp(0.3 * x) * (1 + y * y) + 0.1 * length
    load = math.nan if y > 0.95 else x * y + z
    return {"depth": depth, "depth_lost": depth - z, "load": load}


def coarse(x: float, y: float, z: float, length: float, scale: float) -> dict[str, float]:
    """Two of the outputs of `simulate` by a coarser formula; it raises elsewhere."""
    if x < -1.9:
        raise ValueError("x is too small")
    return {"depth": scale * (1 + 0.3 * x) * (1 + y) + 0.12 * length, "load": x * y + 1.1 * z}


def ending(x: float, y: float) -> dict[str, float]:
    """Ends its process where x is large, and hangs where y is."""
    if x > 2:
        os._exit(7)
    if y > 2:
        time.sleep(3600)
    return {"product": x * y}
