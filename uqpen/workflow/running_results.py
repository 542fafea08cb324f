"""Results of a study while it runs: what its finished runs show so far."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from uqpen.archive.estimates import pack
from uqpen.core.blocks import join_blocks
from uqpen.core.labels import (
    EXCEEDANCE,
    FAILURES_GROUP,
    MODELS,
    MOMENTS,
    QUANTILES,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SHARES,
    SOURCE_KIND,
    STATISTICS_GROUP,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.progress import ProgressRecord
from uqpen.execution import first_repeats, join_rounds
from uqpen.models.user_code import error_text
from uqpen.statistics.analyze import analyze
from uqpen.statistics.convergence import first_runs, sample_so_far
from uqpen.statistics.distribution_function.probabilities import status_probabilities
from uqpen.statistics.run_samples import input_sample
from uqpen.study.identity import root_attributes
from uqpen.study.study import ValidatedStudy

# What is estimated again and again. Measures of the inputs' part would take too long.
_SHOWN = (MOMENTS, QUANTILES, EXCEEDANCE, SHARES)

# Shortest time between two updates, in seconds; and the share of time that they may take.
_BETWEEN, _SHARE = 1.0, 0.1


@dataclass(frozen=True)
class ResultsSoFar:
    """Results of the finished runs of a study."""

    # The archive so far: ``/runs/<design>`` and ``/statistics/<design>/<output>``, of the designs
    # with estimates; below ``/models/<name>`` for several models.
    tree: xr.DataTree
    # All finished runs by design, of each model and round.
    finished: Mapping[str, list[xr.Dataset]] = field(default_factory=dict)
    # Why there are no estimates yet, by design.
    reasons: Mapping[str, str] = field(default_factory=dict)


# Groups of an archive, all finished runs and the reason for no estimates, of one design.
_DesignResults = tuple[dict[str, xr.Dataset], list[xr.Dataset], str]


@dataclass(frozen=True)
class _Round:
    """Runs of a model at the points of a round: its complete blocks, and those under way."""

    open_runs: Callable[[], list[xr.Dataset]]
    blocks: list[xr.Dataset] = field(default_factory=list)

    @property
    def has_runs(self) -> bool:
        """True if a block of points has been drawn."""
        return bool(self.blocks or self.open_runs())

    def finished(self) -> xr.Dataset:
        """Return all finished runs, with their numbers along ``run``."""
        starts = np.cumsum([0, *(block.sizes[RUN] for block in self.blocks)])
        complete = [
            block.assign_coords({RUN: start + np.arange(block.sizes[RUN])})
            for start, block in zip(starts, self.blocks, strict=False)
        ]
        parts = [*complete, *self.open_runs()]
        return join_blocks(parts, sum(part.sizes[RUN] for part in parts))


class RunningResults(ProgressRecord):
    """Receiver that estimates from the finished runs, now and then.

    It does so between two reports, in their thread. So it can change no result: no model runs in
    this process meanwhile, and the linear algebra has the threads that it would have.

    Parameters
    ----------
    study : ValidatedStudy
        The study that runs.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(self, study: ValidatedStudy, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(clock)
        self._study = study
        self._root = xr.Dataset(attrs=root_attributes(study))
        self._rounds: dict[str, list[_Round]] = {}
        self._ended: dict[str, _DesignResults] = {}
        self._due = 0.0
        self.results = ResultsSoFar(xr.DataTree(self._root))

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        """Record the step, and the end of the last design."""
        self._end_design()
        super().start_step(name, number, total)

    def start_design(self, name: str, runs: int) -> None:
        """Record the design, and the end of the one before."""
        self._end_design()
        super().start_design(name, runs)
        self._due = self._clock() + _BETWEEN

    def start_runs(self, model: str, finished_runs: Callable[[], list[xr.Dataset]]) -> None:
        """Keep where the finished runs of a round are to be had."""
        self._rounds.setdefault(model, []).append(_Round(finished_runs))

    def end_block(self, model: str, runs: xr.Dataset) -> None:
        """Keep the runs of a block; of very many, the estimates are from the first."""
        rounds = self._rounds[model]
        kept = (block.sizes[RUN] for each in rounds for block in each.blocks)
        if sum(kept) < RUNS_IN_MEMORY:
            rounds[-1].blocks.append(runs)

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        """Count finished runs, and update the results if the last update is old enough."""
        super().advance(runs, failed, in_progress)
        if self._clock() >= self._due:
            began = self._clock()
            self._update(is_complete=False)
            now = self._clock()
            self._due = now + max(_BETWEEN, (now - began) / _SHARE)

    def warn(self, text: str) -> None:
        """Leave warnings to the receivers that show them."""

    def _end_design(self) -> None:
        if self._rounds:
            self._update(is_complete=True)
            self._rounds.clear()

    def _update(self, *, is_complete: bool) -> None:
        """Take the finished runs of the design into account."""
        design = self.state.design
        current = self._design_results(design, is_complete=is_complete)
        if is_complete:
            self._ended[design] = current
        designs = {**self._ended, design: current}
        groups = {"/": self._root}
        for of_design, _, _ in designs.values():
            groups |= of_design
        self.results = ResultsSoFar(
            xr.DataTree.from_dict(groups),
            {name: finished for name, (_, finished, _) in designs.items()},
            {name: reason for name, (_, _, reason) in designs.items() if reason},
        )

    def _design_results(self, design: str, *, is_complete: bool) -> _DesignResults:
        groups: dict[str, xr.Dataset] = {}
        finished, reason = [], ""
        for model, rounds in self._rounds.items():
            runs = [each.finished() for each in rounds if each.has_runs]
            if not runs:
                continue
            finished += runs
            root = f"/{MODELS}/{model}" if self._study.has_several_models else ""
            made = self._study.designs[design]
            sampling = {SAMPLING: str(made.sampling_of(self._study.joint))}
            # Only the last round can have runs that are not finished.
            first = join_rounds([*runs[:-1], first_runs(runs[-1])]).assign_attrs(sampling)
            sample = sample_so_far(first, is_complete=is_complete)
            reason = reason or sample.reason
            if sample.runs is None:
                continue
            try:
                groups |= self._groups(root, design, model, sample.runs)
            except Exception as error:
                # Runs that took hours must not be lost to a page that shows them.
                reason = f"they fail: {error_text(error)}"
        return groups, finished, reason

    def _groups(
        self, root: str, design: str, model: str, runs: xr.Dataset
    ) -> dict[str, xr.Dataset]:
        """Return the groups of an archive with the estimates of a sample."""
        quantities = self._study.model_quantities(self._study.models[model].model)
        path = f"{root}/{STATISTICS_GROUP}/{design}"
        attributes = {SOURCE_KIND: "design", RUNS_SPENT: runs.sizes[RUN]}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the analysis of all runs has them again
            found = analyze(first_repeats(runs), quantities, only=_SHOWN)
            level = self._study.confidence_level
            failures = {"probability": status_probabilities(input_sample(runs), level)}
        return {
            f"{root}/{RUNS}/{design}": runs,
            f"{root}/{FAILURES_GROUP}/{design}": pack(failures),
            path: xr.Dataset(attrs=attributes),
            **{f"{path}/{name}": pack(arrays) for name, arrays in found.items() if arrays},
        }
