"""Budget of runs that clients of a server may ask for, counted in a file."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any, BinaryIO

from uqpen.core.errors import ModelError
from uqpen.server.served_model import RefusedError

if sys.platform != "win32":
    import fcntl

__all__ = ["RunBudget"]


class RunBudget:
    """The runs of each model that clients may still ask for.

    The file has a line of JSON for what is served, and one for each run that was granted, with its
    model and its input vector. A line is on the disk before its run is made. So a count survives a
    server that is killed, and no answer is given that is not counted.

    Parameters
    ----------
    path : Path
        The file. If it exists, its count goes on.
    runs : int
        Runs of each model that are granted in all.
    identities : mapping of str to mapping
        By name, all that decides the result of a run of a model. The file has a hash of it, and
        one of other models is refused.

    Raises
    ------
    ModelError
        If the file counts the runs of other models, is no such file, or belongs to a server that
        is running.
    OSError
        If it cannot be read or written.
    """

    def __init__(self, path: Path, runs: int, identities: Mapping[str, Mapping[str, Any]]) -> None:
        models = {name: _hash(identity) for name, identity in identities.items()}
        self.path = path
        self.runs = runs
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a+b")
        try:
            self._lock()
            self._granted = dict.fromkeys(models, 0)
            self._read({"models": dict(models)})
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> RunBudget:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def left(self, model: str) -> int:
        """Return the number of runs of a model that are left."""
        return max(self.runs - self._granted[model], 0)

    def grant(self, model: str, vector: Sequence[float]) -> None:
        """Count a run of a model; refuse it where none is left.

        The caller sees to it that no other thread is here at the same time.

        Raises
        ------
        RefusedError
            If the budget is spent, or a run cannot be counted.
        """
        if not self.left(model):
            message = f"all {self.runs} runs of {model} have been made"
            raise RefusedError("BudgetSpent", message, HTTPStatus.FORBIDDEN)
        # Counted first: if the line is lost half-way, the run is made for nobody.
        self._granted[model] += 1
        try:
            self._append({"model": model, "input": list(vector)})
        except OSError:
            code = HTTPStatus.INTERNAL_SERVER_ERROR
            raise RefusedError("NotCounted", "the run cannot be counted", code) from None

    def _append(self, entry: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(entry).encode() + b"\n")
        _sync(self._file)

    def _lock(self) -> None:
        """Keep the file from any other server until it is closed."""
        if sys.platform != "win32":
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                message = f"{self.path}: another server counts its runs in this file"
                raise ModelError(message) from None

    def _read(self, head: Mapping[str, Any]) -> None:
        """Take the count of a file, or begin one."""
        self._file.seek(0)
        lines = self._file.read().splitlines(keepends=True)
        if lines and not lines[-1].endswith(b"\n"):
            # A server was killed at this line, before the run that it grants.
            self._file.truncate(sum(map(len, lines[:-1])))
            del lines[-1]
        if not lines:
            self._append(head)
            return
        entries = [_parse_entry(line) for line in lines]
        if None in entries or "models" not in (entries[0] or {}):
            raise ModelError(f"{self.path}: is no count of runs of a server")
        if entries[0] != head:
            raise ModelError(f"{self.path}: counts the runs of other models, or of another version")
        for entry in entries[1:]:
            self._granted[str((entry or {}).get("model"))] += 1


def _parse_entry(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None


def _sync(file: BinaryIO) -> None:
    file.flush()
    os.fsync(file.fileno())


def _hash(identity: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
