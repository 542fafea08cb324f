"""Limit on the memory of this process during a run."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

# Other systems have no such limit, or do not enforce it.
CAN_LIMIT = sys.platform == "linux"


@contextlib.contextmanager
def limit_memory(memory: int | None) -> Iterator[None]:
    """Limit the additional memory of this process, in bytes, within this context.

    A request for more raises a MemoryError; C code gets a null pointer.
    """
    if memory is None or not CAN_LIMIT:
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_bytes().split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + memory
    if before[1] != resource.RLIM_INFINITY:
        most = min(most, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
