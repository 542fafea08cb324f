"""Compilation by Numba, which keeps the machine code on disk.

Numba's cache notices no change in this module: what it does to a function has to stay, or the
function's own module has to change with it.
"""

from __future__ import annotations

from collections.abc import Callable
from pickle import UnpicklingError
from typing import Any, TypeVar, cast

import numba
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(signature: str) -> Callable[[Function], Function]:
    """Compile for arguments of stated types, or load what an earlier process compiled.

    Processes may do so at the same time. Of one signature they keep the same code under one name;
    of several, Numba could give the name of one to the code of another.
    """
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True}

    def decorate(function: Function) -> Function:
        try:
            return cast(Function, numba.njit(signature, cache=True, **options)(function))
        except (RuntimeError, OSError, EOFError, UnpicklingError):
            # No folder to write to, a full disk, or a file that a power cut left in pieces.
            return cast(Function, numba.njit(signature, **options)(function))

    return decorate


def inlined(function: Function) -> Function:
    """Compile into the callers; the default error model would keep them from vectorising."""
    return cast(Function, numba.njit(function, error_model="numpy", forceinline=True))


def _with_attribute(attribute: str) -> Callable[[], None]:
    """Return a function that gives its caller an attribute of LLVM, and does nothing else."""

    def declare(_: Any) -> tuple[Signature, Any]:
        def add_attribute(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            # The attributes' own `add` refuses those of a target, which only some processors have.
            set.add(builder.function.attributes, attribute)
            return context.get_dummy_value()

        return numba.types.void(), add_attribute

    # Numba passes the first argument itself.
    return cast(Callable[[], None], intrinsic(declare))


# Vectorise the loops of the calling function by the full width of the processor's vectors. Of 512
# bits LLVM uses 256 by itself, as wide vectors lower the clock of the first processors that have
# them. Loops of nothing but arithmetic gain more than that. The bits of results are the same, and
# nothing changes on processors without such vectors.
use_widest_vectors = _with_attribute('"prefer-vector-width"="512"')

# Align the stack of the calling function to its vectors. LLVM aligns it to 16 bytes where it needs
# vectors there only after it has chosen registers; each of them may then lie in two cache lines.
# It has no effect in a function that is compiled into its caller.
align_stack = _with_attribute('"stackrealign"')
