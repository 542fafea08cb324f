"""Compilation of functions of models by Numba.

Numba's cache notices no change in this module: what it does to a function has to stay, or the
function's own module has to change with it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

__all__ = ["entry_point", "inlined", "use_widest_vectors"]

Function = TypeVar("Function", bound=Callable[..., Any])


def entry_point(function: Callable[..., None], signature: str, *, cache: bool) -> Any:
    """Compile a function for C; with a cache, kept on disk where Numba finds a place for it."""
    if cache:
        with contextlib.suppress(RuntimeError):
            return numba.cfunc(signature, error_model="numpy", cache=True)(function)
    return numba.cfunc(signature, error_model="numpy")(function)


def inlined(function: Function) -> Function:
    """Compile into the callers; the default error model would keep them from vectorising."""
    return cast(Function, numba.njit(function, error_model="numpy", forceinline=True))


# Of 512 bits LLVM uses 256 by itself, as wide vectors lower the clock of the first processors that
# have them. Loops of nothing but arithmetic gain more than that. The bits of results are the same.
_WIDEST = '"prefer-vector-width"="512"'


def _widest_vectors(_: Any) -> tuple[Signature, Any]:
    """Vectorise the loops of the calling function by the full width of the processor's vectors.

    It does nothing on processors without vectors of 512 bits.
    """

    def add_attribute(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # The attributes' own `add` refuses those of a target, which only some processors have.
        set.add(builder.function.attributes, _WIDEST)
        return context.get_dummy_value()

    return numba.types.void(), add_attribute


# Numba passes the first argument itself.
use_widest_vectors = cast(Callable[[], None], intrinsic(_widest_vectors))
