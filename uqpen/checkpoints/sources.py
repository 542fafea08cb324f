"""Places of finished runs, and what is in them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from uqpen.checkpoints.identity import fingerprint_changes, read_fingerprint
from uqpen.checkpoints.parts import MADE_OF, FinishedRuns, part_files, part_number, select_results
from uqpen.core.arrays import IntArray
from uqpen.core.status import Status
from uqpen.execution.batch import join_results
from uqpen.execution.batching import BATCH_SIZE

__all__ = ["SET_ASIDE", "RunSource", "set_aside_design", "set_aside_sources"]

# Folder, beside those of designs, of finished runs that belong to none: they are found by their
# inputs alone. Settings of their design have changed since, or they were made to try a model.
SET_ASIDE = "set_aside"

_KEPT = "those kept before"


@dataclass(frozen=True)
class RunSource:
    """Finished runs of a model in one round of a design.

    Parameters
    ----------
    place : str
        Where they are kept, for display.
    runs : FinishedRuns
        The runs, with their numbers in the round, ascending and each once.
    is_complete : bool
        True if they are all runs of the round.
    made_with : tuple of str
        What they were made with, where that is not as it is here, in words.
    folder : Path, optional
        Their folder, if they are in no archive.
    changed_design : str
        Name of their design, if the study has it with other settings.
    design : str
        Name of their design; empty if they have none.
    """

    place: str
    runs: FinishedRuns
    is_complete: bool
    made_with: tuple[str, ...] = ()
    folder: Path | None = None
    changed_design: str = ""
    design: str = ""

    def without_statuses(self, statuses: Collection[Status]) -> RunSource | None:
        """Return it without the runs of some statuses; None if no other is left."""
        runs = self.runs.without_statuses(statuses)
        if runs is self.runs or runs is None:
            return None if runs is None else self
        return replace(self, runs=runs, is_complete=False)

    def whole_batches(self) -> Iterator[IntArray]:
        """Yield the positions of the runs of each batch that is whole."""
        numbers = self.runs.runs
        starts = [0, *np.flatnonzero(np.diff(numbers // BATCH_SIZE)) + 1, len(numbers)]
        for begin, end in pairwise(starts):
            if end - begin == BATCH_SIZE or (self.is_complete and end == len(numbers)):
                yield np.arange(begin, end)


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
    folders = (root / SET_ASIDE).glob("[0-9]*")
    for folder in sorted(folder for folder in folders if folder.is_dir()):
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


def set_aside_design(folder: Path) -> str:
    """Return the design that runs were made for; empty for runs that only tried a model."""
    fingerprint = read_fingerprint(folder / MADE_OF) or {}
    names = (key.split(".")[1] for key in fingerprint if key.startswith("designs."))
    return next(names, "")


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
