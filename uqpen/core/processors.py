"""Threads: of compiled code as many as this process has processors, of linear algebra one."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from uqpen.core.errors import Problem, SettingsError

Part = TypeVar("Part")

# The environment variable that limits the threads.
MOST_THREADS = "UQPEN_THREADS"

# Quota and period of a container's processor time on Linux, in microseconds.
_QUOTA = Path("/sys/fs/cgroup/cpu.max")

_is_one_of_many = False


def use_one_thread() -> None:
    """Use one thread from now on: this process is a worker, and others use the processors."""
    global _is_one_of_many
    _is_one_of_many = True


def thread_count() -> int:
    """Return how many threads compiled code may use in this process; no result depends on it.

    SettingsError if the environment variable ``UQPEN_THREADS`` is no number, or less than 1.
    """
    given = os.environ.get(MOST_THREADS, "").strip()
    if given and not (given.isdecimal() and int(given) > 0):
        problem = Problem((MOST_THREADS,), given, "a number of threads, 1 or more")
        raise SettingsError([problem])
    if _is_one_of_many:
        return 1
    return min(processors(), int(given)) if given else processors()


def processors() -> int:
    """Return the number of processors that this process may use, by affinity and quota."""
    if hasattr(os, "sched_getaffinity"):
        found = len(os.sched_getaffinity(0))
    else:
        found = os.cpu_count() or 1
    with contextlib.suppress(OSError, ValueError):  # other systems; no quota, which is "max"
        quota, period = map(int, _QUOTA.read_text().split())
        found = min(found, -(-quota // period))
    return max(1, found)


def map_parts(function: Callable[[slice], Part], size: int, worth_a_thread: int) -> list[Part]:
    """Call a function for consecutive slices of a range, in a thread each; return its results.

    It releases Python's lock while it computes. No part is smaller than what is worth a thread.
    """
    parts = max(1, min(thread_count(), size // worth_a_thread))
    if parts == 1:
        return [function(slice(0, size))]
    from concurrent.futures import ThreadPoolExecutor

    ends = [size * part // parts for part in range(parts + 1)]
    slices = [slice(*ends[part : part + 2]) for part in range(parts)]
    with ThreadPoolExecutor(parts - 1) as pool:
        others = [pool.submit(function, each) for each in slices[1:]]
        return [function(slices[0]), *(other.result() for other in others)]


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
