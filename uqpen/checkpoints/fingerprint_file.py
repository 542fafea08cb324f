"""Fingerprint of the checkpointed runs, and a readable diff of two fingerprints."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

__all__ = [
    "Change",
    "encode_fingerprint",
    "fingerprint_changes",
    "list_changes",
    "read_fingerprint",
    "was_record_of",
]

_CHECKSUM = "checksum"

# Excerpt of a text that has changed: its length, and its length before the first difference.
_LONGEST, _BEFORE = 60, 20

_MOST_LISTED = 6

# Keys of hashes.
_HASHED = ("file ", "module ", "environment variable ")


def read_fingerprint(record: Path) -> dict[str, str] | None:
    """Read the fingerprint of the runs beside a record; None for a damaged one."""
    try:
        content: Any = json.loads(record.read_bytes())
        checksum = content.pop(_CHECKSUM)
    except (OSError, ValueError, RecursionError, AttributeError, KeyError, TypeError):
        return None
    return content if checksum == _checksum(content) else None


def encode_fingerprint(fingerprint: Mapping[str, str]) -> bytes:
    """Encode a fingerprint as the content of a record, with its checksum."""
    return json.dumps({_CHECKSUM: _checksum(fingerprint), **fingerprint}, indent=1).encode()


def was_record_of(record: Path, fingerprint: Mapping[str, str]) -> bool:
    """Check that a damaged record had a fingerprint: its checksum, or all else, is left of it."""
    try:
        damaged, whole = record.read_bytes(), encode_fingerprint(fingerprint)
    except OSError:
        return False
    return any(line in damaged for line in whole.split(b"\n", 2)[1:])


def _checksum(fingerprint: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(fingerprint).encode()).hexdigest()


class Change(NamedTuple):
    """Changed entry of a fingerprint: its key, and a text for display."""

    key: str
    text: str

    @property
    def is_limit(self) -> bool:
        """True if the changed value is the time limit of a run."""
        return self.key.startswith("model") and self.key.endswith(".time_limit")

    @property
    def is_reading(self) -> bool:
        """True if the changed value belongs to `[model.read]`."""
        return re.match(r"model(s\.[^.]+)?\.read\b", self.key) is not None


def fingerprint_changes(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[Change]:
    """Yield the differences between two fingerprints."""
    for key in {**before, **now}:
        was, is_now = (str(each.get(key, "not there")) for each in (before, now))
        if was == is_now:
            continue
        is_hash = key.startswith(_HASHED) or key.endswith("sha256")
        if is_hash and key in before and key in now:
            yield Change(key, f"{key} has changed")
        else:
            was, is_now = _excerpts(" ".join(was.split()), " ".join(is_now.split()))
            yield Change(key, f"{key} was {was}, is {is_now}")


def list_changes(changes: Sequence[str]) -> str:
    """Return changes as indented lines; of many the first ones."""
    more = len(changes) - _MOST_LISTED
    lines = [*changes[:_MOST_LISTED], *([f"and {more} more"] if more > 0 else [])]
    return "\n".join(f"  {line}" for line in lines)


def _excerpts(before: str, now: str) -> list[str]:
    """Shorten two texts to fit on a line; cut both shortly before their first difference.

    >>> _excerpts("1" * 100 + "2", "1" * 100 + "3")
    ['…111111111111111111112', '…111111111111111111113']
    """
    pairs = zip(before, now, strict=False)
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    start = max(0, same - _BEFORE) if max(len(before), len(now)) > _LONGEST else 0
    return [
        "…" * (start > 0) + text[start:][:_LONGEST] + "…" * (len(text) - start > _LONGEST)
        for text in (before, now)
    ]
