"""Resource limits of one run."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from uqpen.core.settings import quantity, setting, validate

__all__ = ["Limits", "time_limit"]

_LEAST, _MOST = 1e6, 1e15  # bytes

_SIZE = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([kMGT]i?|)B\s*\Z")
_PREFIXES = {"": 1} | {
    f"{prefix}{binary}": base**power
    for power, prefix in enumerate("kMGT", 1)
    for binary, base in (("", 1000), ("i", 1024))
}


def time_limit() -> Any:
    """Declare the setting ``time_limit``, in seconds."""
    expected = 'a time such as "10 s" or "5 min"'
    return quantity(unit="s", above=0, default=None, expected=expected, key="time_limit")


def _read_size(written: object, context: object) -> int:
    """Convert a size such as ``"2 GB"`` to bytes; what is none becomes 0, which is refused."""
    match = _SIZE.match(written) if isinstance(written, str) else None
    return int(float(match[1]) * _PREFIXES[match[2]]) if match else 0


@dataclass(frozen=True)
class Limits:
    """Resource limits of one run.

    Parameters
    ----------
    seconds : float, optional
        Time after which it is ended.
    bytes : int, optional
        Memory (address space, as that is what the system can limit).
    """

    seconds: float | None = time_limit()
    bytes: int | None = setting(
        "size",
        'a size such as "2 GB" or "512 MiB", at least 1 MB',
        lambda size: _LEAST <= size <= _MOST,
        read=_read_size,
        default=None,
        key="memory_limit",
    )

    def __post_init__(self) -> None:
        validate(self)

    def __bool__(self) -> bool:
        return self.seconds is not None or self.bytes is not None

    @property
    def timeout_reason(self) -> str:
        """Reason of a run that failed because its time was over.

        >>> Limits(seconds=90).timeout_reason
        'took longer than 90 s'
        """
        return f"took longer than {self.seconds:g} s"
