"""Threads of the linear algebra."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import Any

__all__ = ["one_blas_thread"]

# The libraries found, and whether SciPy's linear algebra was loaded: it brings one of its own.
_controllers: dict[bool, Any] = {}


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread within this context.

    A sum's last bits depend on how many threads share it. On a busy machine threads also wait for
    each other far longer than they work.
    """
    # It takes milliseconds to find the libraries, and microseconds to limit them.
    has_scipy = "scipy.linalg" in sys.modules
    if has_scipy not in _controllers:
        from threadpoolctl import ThreadpoolController

        _controllers[has_scipy] = ThreadpoolController()
    with _controllers[has_scipy].limit(limits=1, user_api="blas"):
        yield
