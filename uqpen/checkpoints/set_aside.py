"""Finished runs beside an archive that belong to no design: found by their inputs alone.

They are of a design whose settings have changed since, or single runs that were made to try a
model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import count, groupby
from pathlib import Path

import numpy as np

from uqpen.checkpoints.earlier_runs import RunSource
from uqpen.checkpoints.identity import (
    encode_fingerprint,
    fingerprint_changes,
    read_fingerprint,
)
from uqpen.checkpoints.parts import (
    MADE_OF,
    FinishedRuns,
    part_files,
    part_number,
    part_path,
    select_results,
    write_file,
    write_runs,
)
from uqpen.core.status import Status
from uqpen.execution.batch import join_results

__all__ = [
    "SET_ASIDE",
    "add_set_aside",
    "set_aside",
    "set_aside_design",
    "set_aside_folders",
    "set_aside_sources",
]

# Folder beside those of designs.
SET_ASIDE = "set_aside"

_KEPT = "those kept before"


def set_aside_folders(root: Path) -> list[Path]:
    """List the folders of runs that were set aside, of a model or of all."""
    return sorted(folder for folder in (root / SET_ASIDE).glob("[0-9]*") if folder.is_dir())


def set_aside(folder: Path, root: Path) -> None:
    """Move the runs of a design to a folder of their own; a kill in between loses none.

    Raises
    ------
    OSError
        If that cannot be done.
    """
    target = _new_folder(root)
    record = folder / MADE_OF
    write_file(target / MADE_OF, record.read_bytes())
    for file in part_files(folder):
        file.rename(target / file.name)
    record.unlink()


def set_aside_design(folder: Path) -> str:
    """Return the design that runs were made for; empty for runs that only tried a model."""
    fingerprint = read_fingerprint(folder / MADE_OF) or {}
    names = (key.split(".")[1] for key in fingerprint if key.startswith("designs."))
    return next(names, "")


def add_set_aside(root: Path, fingerprint: Mapping[str, str], runs: FinishedRuns) -> None:
    """Keep finished runs that no design has made, with the fingerprint of their model.

    Raises
    ------
    OSError
        If that cannot be done.
    """
    target = _new_folder(root)
    write_file(target / MADE_OF, encode_fingerprint(fingerprint))
    write_runs(part_path(target, 0, 0), runs)


def set_aside_sources(
    root: Path,
    fingerprint: Mapping[str, str],
    read: Callable[[Path], FinishedRuns | None],
) -> Iterator[RunSource]:
    """Yield the runs that were set aside and were made with a model.

    Parameters
    ----------
    root : Path
        The folder of the model's runs.
    fingerprint : mapping of str to str
        That of the model; see `model_fingerprint`.
    read : callable
        Reads a part; it returns None for a damaged one.
    """
    for folder in set_aside_folders(root):
        before = read_fingerprint(folder / MADE_OF)
        if before is None:
            continue
        own = {key: before[key] for key in before if key in fingerprint or _is_of_model(key)}
        changes = list(fingerprint_changes(own, fingerprint))
        if not all(change.is_limit for change in changes):
            continue
        design = set_aside_design(folder)
        for runs in _rounds(folder, read):
            source = RunSource(
                _KEPT,
                runs,
                is_complete=False,
                folder=folder,
                changed_design=design,
                design=design,
            )
            found = source.without_statuses([Status.TIMED_OUT] if changes else [])
            if found is not None:
                yield found


def _is_of_model(key: str) -> bool:
    return key.startswith(("model", "constraints."))


def _rounds(folder: Path, read: Callable[[Path], FinishedRuns | None]) -> Iterator[FinishedRuns]:
    """Yield the runs of each round in a folder, each number once."""
    for _, files in groupby(part_files(folder), lambda file: file.stem.partition("_")[0]):
        parts = [*filter(None, map(read, sorted(files, key=part_number, reverse=True)))]
        if parts:
            yield _joined(parts)


def _joined(parts: list[FinishedRuns]) -> FinishedRuns:
    """Join parts in ascending order of the runs; of a run that several have, take the first."""
    runs, at = np.unique(np.concatenate([part.runs for part in parts]), return_index=True)
    inputs = {
        name: np.concatenate([part.inputs[name] for part in parts])[at] for name in parts[0].inputs
    }
    results = join_results([part.results for part in parts])
    return FinishedRuns(runs, inputs, select_results(results, at))


def _new_folder(root: Path) -> Path:
    """Make a folder with a number that no other has."""
    for number in count(1):
        folder = root / SET_ASIDE / f"{number:06d}"
        if not folder.exists():
            folder.mkdir(parents=True)
            return folder
    raise AssertionError
