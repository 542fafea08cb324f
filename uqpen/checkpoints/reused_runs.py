"""Runs that a study takes from earlier ones, in place of making them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.checkpoints.chosen_runs import BY_MACHINE
from uqpen.checkpoints.earlier_runs import EarlierRuns
from uqpen.checkpoints.sources import RunSource
from uqpen.core.arrays import Arrays, IntArray
from uqpen.core.blocks import LoadedDataset
from uqpen.core.labels import NOT_MADE_AGAIN, RUN
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.rounds import first_round
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.study import ValidatedStudy

__all__ = ["ReusedRuns", "first_points"]

_LOST_BY_MACHINE = "runs that timed out or crashed in an earlier study"


class ReusedRuns:
    """Earlier runs of the models of a study, and a record of those that it takes.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    sources : mapping of str to sequence of RunSource
        The sources of runs by the name of a model, the preferred ones first.
    progress : Progress
        Receives the numbers of runs that are taken.
    """

    def __init__(
        self,
        study: ValidatedStudy,
        sources: Mapping[str, Sequence[RunSource]],
        progress: Progress,
    ) -> None:
        self.sources = sources
        self._study = study
        self._progress = progress
        self._earlier = {
            name: EarlierRuns.by_inputs(study.models[name].model, found)
            for name, found in sources.items()
        }
        self._made_with: set[str] = set()
        self._not_made_again: set[tuple[str, str]] = set()

    def checkpoint(self, own: Checkpoint, design: str, model: str) -> Checkpoint:
        """Return a checkpoint that restores earlier runs, too, of a model in a round of a design.

        `own` has the round's own runs, and gets those that are made.
        """
        return _ReusingCheckpoint(self, own, design, model) if self._earlier[model] else own

    def earlier_runs(self, model: str, inputs: Arrays) -> EarlierRuns | None:
        """Return the runs of a model with those inputs that points have; None for none."""
        names = {variable.name for variable in self._study.models[model].model.inputs}
        return self._earlier[model].get(frozenset(names.intersection(inputs)))

    def find(self, earlier: EarlierRuns, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the positions of earlier runs as `EarlierRuns.find` does.

        Runs at points that the constraints of the study exclude are left out.
        """
        at = earlier.find(inputs, start, size)
        is_admissible = np.ones(len(at), dtype=np.bool_)
        for constraint in self._study.constraints:
            is_admissible &= constraint.is_satisfied(inputs)
        is_wrong = ~is_admissible & (earlier.statuses(at) != Status.INADMISSIBLE)
        return np.where(is_wrong, -1, at)

    def count(self, earlier: EarlierRuns, at: IntArray, design: str, model: str) -> None:
        """Record the runs that a design takes, given their positions."""
        label = f"{model}: {design}" if model else design
        for source, statuses in earlier.use(at):
            self._progress.count_reused(len(statuses), source.place)
            self._made_with.update(f"{label}: {text}" for text in source.made_with)
            if np.isin(statuses, BY_MACHINE).any():
                self._made_with.add(f"{label}: {_LOST_BY_MACHINE}")
            if (model, source.place) in self._not_made_again:
                self.record_not_made_again(design, model)

    def mark_not_made_again(self, model: str, place: str) -> None:
        """Note that none of a model's runs from a place was made again before they are taken."""
        self._not_made_again.add((model, place))

    def record_not_made_again(self, design: str, model: str) -> None:
        """Record that such runs of a design are taken."""
        label = f"{model}: {design}" if model else design
        self._made_with.add(f"{label}: {NOT_MADE_AGAIN}")

    def used_places(self, model: str, inputs: Arrays) -> set[str]:
        """Return the places of a model's runs that are at the first points of a round."""
        earlier = self.earlier_runs(model, inputs)
        if earlier is None:
            return set()
        at = self.find(earlier, inputs, 0, len(next(iter(inputs.values()))))
        return {source.place for source in earlier.sources_of(at)}

    def used_folders(self) -> set[Path]:
        """Return the folders all of whose runs have been taken."""
        runs = [each for found in self._earlier.values() for each in found.values()]
        used = Counter(source.folder for each in runs for source in each.used_up())
        every = Counter(source.folder for each in runs for source in each.sources)
        return {folder for folder in used if folder and used[folder] == every[folder]}

    def record(self) -> str:
        """Return what the taken runs were made with, a line each; empty if all would be alike here.

        Runs that timed out or crashed might not do so here.
        """
        return "\n".join(sorted(self._made_with))


def first_points(study: ValidatedStudy, design: str, model: str) -> Arrays:
    """Return the first points of a design, at most 65 536, as a model takes them.

    Returns
    -------
    mapping of str to ndarray, shape (run,)
        SI values by input.
    """
    stream = Stream(study.seed, "designs", design)
    drawn = first_round(study.designs[design], study.joint, stream)
    points = drawn.assign(study.models[model].given)
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    head = blocked.read(0, min(blocked.size, BLOCK))
    return {str(key): head[key].broadcast_like(head[RUN]).values for key in head.data_vars}


class _ReusingCheckpoint(Checkpoint):
    """Checkpoint of a round that also restores runs of earlier studies."""

    def __init__(self, reused: ReusedRuns, own: Checkpoint, design: str, model: str) -> None:
        self._reused, self._own = reused, own
        self._design, self._model = design, model
        self._size = 0

    def prepare(self, runs: int) -> int:
        self._size = runs
        return self._own.prepare(runs)

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        earlier = self._reused.earlier_runs(self._model, inputs)
        if earlier is None:
            yield from self._own.restore(start, inputs)
            return
        at = self._reused.find(earlier, inputs, start, self._size)
        for batch_result in self._own.restore(start, inputs):
            first = batch_result.start - start
            at[first : first + len(batch_result)] = -1
            yield batch_result
        yield from earlier.batch_results(start, at)
        self._reused.count(earlier, at, self._design, self._model)

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        self._own.save(inputs, batch_result)

    def collect(self, blocks: Iterable[xr.Dataset], runs: int) -> xr.Dataset:
        return self._own.collect(blocks, runs)
