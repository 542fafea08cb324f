"""Compilation of loops over many runs by Numba.

Numba's cache notices no change in this module: what it does to a function has to stay, or the
function's own module has to change with it. No operation is fused or reordered, so results have the
same bits on any processor.
Models have a decorator of their own, in `uqpen.models.compiled`: the sources of models are hashed,
and decide whether a run is theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

__all__ = ["compiled"]

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile on the first call; kept on disk where Numba finds a directory it can write to."""
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True}
    try:
        return cast(Function, numba.njit(function, cache=True, **options))
    except RuntimeError:
        return cast(Function, numba.njit(function, **options))
