"""``time_limit`` and ``memory_limit`` of a model: what one run may use."""

from __future__ import annotations

import re

from uqpen.core.errors import toml_text
from uqpen.core.limits import Limits
from uqpen.study.table_reader import TableReader

__all__ = ["read_limits", "read_time_limit"]

_TIME = 'a time such as "10 s" or "5 min"'
_MEMORY = 'a size such as "2 GB" or "512 MiB", at least 1 MB'
_WHERE = "no limit on memory: this system cannot keep one"

_SIZE = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([kMGT]i?|)B\s*\Z")
_PREFIXES = {"": 1} | {
    f"{prefix}{binary}": base**power
    for power, prefix in enumerate("kMGT", 1)
    for binary, base in (("", 1000), ("i", 1024))
}
_LEAST, _MOST = 1e6, 1e15


def read_limits(table: TableReader, *, can_limit_memory: bool) -> Limits:
    """Read the limits of one run; without any where a model's table has none.

    Parameters
    ----------
    table : TableReader
        Of the model.
    can_limit_memory : bool
        True if this system is known to enforce a limit on memory.
    """
    return Limits(read_time_limit(table), _read_memory_limit(table, can_limit=can_limit_memory))


def read_time_limit(table: TableReader) -> float | None:
    """Read the time limit of one run, in seconds."""
    seconds = table.quantity("time_limit", "s")
    if seconds is not None and not 0 < seconds < float("inf"):
        table.add_problem("time_limit", toml_text(table.content["time_limit"]), _TIME)
        return None
    return seconds


def _read_memory_limit(table: TableReader, *, can_limit: bool) -> int | None:
    """Read the memory limit of one run, in bytes."""
    written = table.take("memory_limit")
    if written is None:
        return None
    match = _SIZE.match(written) if isinstance(written, str) else None
    size = float(match[1]) * _PREFIXES[match[2]] if match else 0.0
    if not _LEAST <= size <= _MOST:
        table.add_problem("memory_limit", toml_text(written), _MEMORY)
        return None
    if not can_limit:
        table.add_problem("memory_limit", toml_text(written), _WHERE)
        return None
    return int(size)
