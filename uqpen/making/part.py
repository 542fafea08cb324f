"""Finished runs in a file of their own, which holds all of them or is known to be damaged."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.executors.work import Piece, joined
from uqpen.labels import REASON, RUN, STATUS, Status
from uqpen.model import Results

__all__ = ["TEMPORARY", "DamagedPartError", "Part", "put_file", "read_part", "write_part"]

Columns = Mapping[str, npt.NDArray[np.float64]]

# How names end of files that are not yet whole.
TEMPORARY = ".tmp"

_INPUT, _OUTPUT, _LOST, _FILES, _DIGEST = "input_", "output_", "lost", "files", "sha256"


class DamagedPartError(Exception):
    """A file that is no part, or no longer whole."""


@dataclass(frozen=True)
class Part:
    """Finished runs, their numbers ascending.

    Parameters
    ----------
    runs : ndarray of int, shape (run,)
        Their numbers.
    inputs : mapping of str to ndarray, shape (run,)
        Where they were made, in SI units.
    results : Results
        What came of them.
    """

    runs: npt.NDArray[np.int64]
    inputs: Columns
    results: Results

    @classmethod
    def of(cls, columns: Columns, pieces: Sequence[Piece]) -> Part:
        """The runs of some pieces, at least one, out of those at all points."""
        pieces = sorted(pieces, key=lambda piece: piece.start)
        runs = np.concatenate([np.arange(each.start, each.start + len(each)) for each in pieces])
        inputs = {name: column[runs] for name, column in columns.items()}
        return cls(runs, inputs, joined([piece.results for piece in pieces]))

    def are_of(self, columns: Columns) -> bool:
        """Whether its runs were made at these points, to the bit."""
        if self.inputs.keys() != columns.keys():
            return False
        total = len(next(iter(columns.values())))
        return int(self.runs[-1]) < total and all(
            np.array_equal(values.view(np.int64), columns[name][self.runs].view(np.int64))
            for name, values in self.inputs.items()
        )

    def without(self, statuses: Collection[Status]) -> Part | None:
        """Its runs but for those that ended so; None where no other is left."""
        at = np.flatnonzero(~np.isin(self.results.status, list(statuses)))
        inputs = {name: values[at] for name, values in self.inputs.items()}
        return Part(self.runs[at], inputs, _some(self.results, at)) if at.size else None

    def pieces(self) -> Iterator[Piece]:
        """Its runs as pieces: a piece has no gaps."""
        gaps = np.flatnonzero(np.diff(self.runs) > 1) + 1
        for at in np.split(np.arange(len(self.runs)), gaps):
            yield Piece(int(self.runs[at[0]]), _some(self.results, at))


def _some(results: Results, at: npt.NDArray[np.int64]) -> Results:
    """The results of some runs, by their positions."""
    position = {run: new for new, run in enumerate(at.tolist())}
    return Results(
        {name: values[at] for name, values in results.outputs.items()},
        results.status[at],
        {position[run]: text for run, text in results.reasons.items() if run in position},
        results.files,
    )


def write_part(path: Path, part: Part) -> None:
    """Put a part where it belongs: as a whole, on the disk, or not at all.

    Raises
    ------
    OSError
        If that cannot be done.
    """
    results = part.results
    lost = sorted(results.reasons)
    arrays: dict[str, npt.NDArray[Any]] = {
        RUN: part.runs,
        STATUS: results.status,
        **{_INPUT + name: values for name, values in part.inputs.items()},
        **{_OUTPUT + name: values for name, values in results.outputs.items()},
        _LOST: np.array(lost, dtype=np.int64),
        REASON: np.array([results.reasons[run] for run in lost], dtype=np.str_),
        _FILES: np.array(sorted(results.files), dtype=np.str_),
    }
    arrays[_DIGEST] = np.array(_digest(arrays))
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **arrays)
    put_file(path, content.getvalue())


def put_file(path: Path, content: bytes) -> None:
    """Write a file so that it is there as a whole, or as it was before.

    Raises
    ------
    OSError
        If that cannot be done; nothing is left behind.
    """
    temporary = path.with_name(path.name + TEMPORARY)
    try:
        with temporary.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def read_part(path: Path) -> Part:
    """The runs of a part.

    Raises
    ------
    DamagedPartError
        If they are not as they were written.
    """
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        written = str(arrays.pop(_DIGEST))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, NotImplementedError):
        raise DamagedPartError(path.name) from None
    if written != _digest(arrays):
        raise DamagedPartError(path.name)
    results = Results(
        _named(arrays, _OUTPUT),
        arrays[STATUS],
        dict(zip(arrays[_LOST].tolist(), arrays[REASON].tolist(), strict=True)),
        frozenset(arrays[_FILES].tolist()),
    )
    return Part(arrays[RUN], _named(arrays, _INPUT), results)


def _named(arrays: Mapping[str, npt.NDArray[Any]], prefix: str) -> dict[str, npt.NDArray[Any]]:
    return {
        name.removeprefix(prefix): values
        for name, values in arrays.items()
        if name.startswith(prefix)
    }


def _digest(arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """A hash of all that a part holds."""
    digest = hashlib.sha256()
    for name, values in sorted(arrays.items()):
        digest.update(f"{name} {values.dtype.str} {values.shape} ".encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
