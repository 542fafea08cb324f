"""Limits of resources: of one run, and of the runs that are in memory together."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import setting, validate

# Runs of a design that goes by blocks. A model of a microsecond needs twelve days for them.
MOST_RUNS = 10**12

# Replicates of a design, each drawn by a generator of its own: a Sobol' sequence of twenty inputs
# takes a minute for them. An interval over a hundred is 2 % wider than one over any larger number.
MOST_REPLICATES = 10_000

# A design of more runs than this goes by blocks: its runs are appended to a file, and analysed from
# there. Below it the exact analyses of a whole sample are faster, and a run with ten numbers takes
# 100 MB in all. It is the number of runs alone that decides, never the memory of a machine, so that
# a study has the same statistics everywhere.
RUNS_IN_MEMORY = 2**20

_LEAST, _MOST = 1e6, 1e15  # bytes

# Systems wait for an event for at most 2^31 milliseconds, which are 24.8 days.
_LONGEST = 24 * 86400.0  # seconds

_SIZE = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([kMGT]i?|)B\s*\Z")
_PREFIXES = {"": 1} | {
    f"{prefix}{binary}": base**power
    for power, prefix in enumerate("kMGT", 1)
    for binary, base in (("", 1000), ("i", 1024))
}


def time_limit() -> Any:
    """Declare the setting ``time_limit``, in seconds."""
    return setting(
        "quantity with a unit of its own",
        'a time such as "10 s" or "5 min"',
        lambda value: (
            not isinstance(value, bool) and isinstance(value, int | float) and 0 < value <= _LONGEST
        ),
        read=_read_time,
        default=None,
        key="time_limit",
    )


def _read_time(written: Any, context: object) -> float:
    """Convert a time to seconds; refuse one that no system can wait for."""
    seconds = parse_quantity(written, "s").value
    if seconds > _LONGEST:
        expected = "a time of at most 24 days; without a limit, a run takes the time that it needs"
        raise QuantityError(toml_text(written), expected)
    return seconds


def _read_size(written: object, context: object) -> int:
    """Convert a size such as ``"2 GB"`` to bytes; return 0, which is refused, for another text."""
    match = _SIZE.match(written) if isinstance(written, str) else None
    size = float(match[1]) * _PREFIXES[match[2]] if match else 0.0
    return int(min(size, 2 * _MOST))  # many digits make it infinite


@dataclass(frozen=True)
class Limits:
    """Resource limits of one run."""

    seconds: float | None = time_limit()  # time after which it is ended
    bytes: int | None = setting(
        "size",
        'a size such as "2 GB" or "512 MiB", at least 1 MB',
        lambda size: _LEAST <= size <= _MOST,
        read=_read_size,
        default=None,
        key="memory_limit",
    )  # memory (address space, as that is what the system can limit)

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
