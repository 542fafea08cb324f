"""Repetition of an archive's points, runs and statistics, and comparison with the archive."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from uqpen.archive.groups import GROUPS, group_place
from uqpen.archive.provenance import provenance
from uqpen.archive.read import read_group
from uqpen.core.arrays import IntArray
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import BATCH_HASH, RUN
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import Points, points_in_memory
from uqpen.designs.rounds import first_round
from uqpen.execution import (
    EvaluationOptions,
    Evaluator,
    FailurePolicy,
    Map,
    Progress,
    evaluate,
    run_count,
)
from uqpen.execution.batching import BATCH_SIZE
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import Runs, run_inputs
from uqpen.verification.check_result import (
    NEGLIGIBLE,
    CheckOutcome,
    CheckResult,
    find_differences,
    first_lines,
    missing_keys,
)
from uqpen.verification.run_pairs import DEFAULT_RUNS, RunPairs
from uqpen.verification.unrepeated import omitted_designs, other_recipe, without_intervals
from uqpen.workflow import analyse_runs, run_design
from uqpen.workflow.noise_check import is_noisy
from uqpen.workflow.repetition import Difference, hashes_again, run_differences

_ELSEWHERE = "last bits may differ where the versions or processors do, and a hash shows no size"


# Number of runs that are repeated if a user names none, and what stands for it: noise needs more.
FEW, SOME = 100, 0


@dataclass(frozen=True)
class Repetition:
    """Repetition of a study whose runs an archive has."""

    study: ValidatedStudy  # read from the archive
    runs: Runs  # the archived ones, by model and design
    # Number of runs to repeat, drawn at random from all; None for all, `SOME` for as many as show.
    number: int | None
    tolerance: float = 0.0  # largest relative difference; 0 where every bit must be the same
    map: Map = map  # as for `uqpen.run`
    progress: Progress = field(default_factory=Progress)  # as for `uqpen.run`

    def check_runs(self) -> Iterator[CheckResult]:
        """Repeat runs at the archived inputs and compare them with the archived runs.

        Those of a model with noise of its own, and no seed, are compared by their distribution.
        """
        found, pairs = list[Difference](), RunPairs()
        policy = FailurePolicy(self.study.failures.retry)
        options = EvaluationOptions(map=self.map, progress=self.progress, failures=policy)
        drawn = list(self.drawn_runs())
        self.progress.announce_designs(
            {_runs_name(model, design): len(at) for model, design, at in drawn}
        )
        repeated = {False: 0, True: 0}
        total = dict(repeated)
        for model, designs in self.runs.items():
            total[self.is_random(model)] += sum(made.sizes[RUN] for made in designs.values())
        for model, design, positions in drawn:
            name, variant = _runs_name(model, design), self.study.models[model]
            is_random = self.is_random(model)
            repeated[is_random] += len(positions)
            self.progress.start_design(name, len(positions))
            for start in range(0, len(positions), RUNS_IN_MEMORY):  # very many are taken by parts
                part = np.asarray(positions[start : start + RUNS_IN_MEMORY])
                archived = self.runs[model][design].isel({RUN: part}).load()
                inputs = {
                    each: archived.variables[each] for each in run_inputs(self.study, archived)
                }
                points = xr.Dataset(inputs, {RUN: archived.variables[RUN]})
                evaluator = Evaluator(variant.model, self.study.constraints)
                again = evaluate(evaluator, points, {}, options)
                if is_random:
                    pairs.add(name, archived, again, variant.model.all_outputs)
                else:
                    found += run_differences(name, archived, again, variant.model.all_outputs)
        if total[False] or not total[True]:
            what = f"{repeated[False]} of {total[False]} repeated"
            yield CheckResult.of_differences("runs", what, found, self.tolerance)
        if total[True]:
            generator = Stream(self.study.seed, "verification", "noise").generator()
            yield pairs.result(f"{repeated[True]} of {total[True]} repeated", generator)

    def is_random(self, model: str) -> bool:
        """Check if runs of a model cannot be repeated: it has noise, and its runs have no seed."""
        own = self.study.models[model].model
        return is_noisy(own, self.runs[model]) and not own.noise.seed

    def drawn_runs(self) -> Iterator[tuple[str, str, IntArray | range]]:
        """Draw runs at random from all runs, by the study's seed.

        Yields model, design and positions in that design, in the order in which the study made
        them; of all runs of a design a range.
        """
        places = [
            (model, design, self.runs[model][design].sizes[RUN])
            for design in self.study.designs
            for model in self.study.models
        ]
        total = sum(size for _, _, size in places)
        number = self.number
        if number == SOME:
            number = DEFAULT_RUNS if any(map(self.is_random, self.study.models)) else FEW
        if number is None or number >= total:
            yield from ((model, design, range(size)) for model, design, size in places if size)
            return
        generator = Stream(self.study.seed, "verification").generator()
        drawn = np.sort(generator.choice(total, number, replace=False))
        start = 0
        for model, design, size in places:
            positions = drawn[(drawn >= start) & (drawn < start + size)] - start
            if positions.size:
                yield model, design, positions
            start += size

    def check_batches(self) -> CheckResult:
        """Make batches of runs that are not kept again, and compare hashes with the archived ones.

        Their number is that of runs, rounded up to whole batches, which are drawn at random.
        """
        found: list[str] = []
        repeated = total = 0
        for model, variant in self.study.models.items():
            for design in omitted_designs(self.runs):
                made = self.runs[model][design]
                archived, size = made[BATCH_HASH].values, run_count(made)
                wanted = len(archived)
                if self.number is not None:
                    wanted = min(-(-max(self.number, 1) // BATCH_SIZE), wanted)
                stream = Stream(self.study.seed, "verification", "batches")
                generator = stream.generator(f"{model} {design}")
                drawn = np.sort(generator.choice(len(archived), wanted, replace=False)).tolist()
                for batch, own in hashes_again(
                    self.study, model, variant.model, design, size, drawn, self.map, self.progress
                ):
                    if own != archived[batch]:
                        last = min((batch + 1) * BATCH_SIZE, size) - 1
                        which = f"runs {batch * BATCH_SIZE} to {last}"
                        found.append(f"{_runs_name(model, design)}: {which} are others now")
                repeated, total = repeated + wanted, total + len(archived)
        what = f"{repeated} of {total} batches of {BATCH_SIZE} runs made again"
        if not found:
            return CheckResult("batches", CheckOutcome.EQUAL, f"{what}: equal by their hashes")
        details = first_lines(found)
        if self.tolerance:
            outcome, details = CheckOutcome.UNCHECKED, (*details, _ELSEWHERE)
        else:
            outcome = CheckOutcome.DIFFERENT
        return CheckResult("batches", outcome, f"{what}: different", details)

    def check_data(self) -> CheckResult:
        """Read runs again from the data file that they come from; no model can repeat them.

        The file is the archived one, or has its hash, so every bit must be the same.
        """
        study, found = self.study, list[Difference]()
        ((model, variant),) = study.models.items()
        for name, design in study.designs.items():
            stream = Stream(study.seed, "designs", name)
            again = run_design(study, design, stream, map=map, progress=Progress())[model]
            archived = self.runs[model][name]
            inputs = archived[run_inputs(study, archived)]
            differences = find_differences(inputs, again[list(inputs)], besides=None)
            found += [each.within(name) for each in differences]
            found += run_differences(name, archived, again, variant.model.all_outputs)
        rows = sum(archived.sizes[RUN] for archived in self.runs[model].values())
        file = variant.model.name
        what = f"not repeatable, as they come from a file; {rows} read again from {file}"
        return CheckResult.of_differences("runs", what, found, 0.0)

    def check_points(self) -> CheckResult:
        """Draw the first round of every design again and compare it with the archived runs.

        Later rounds of an adaptive design follow from the runs before.

        Raises
        ------
        StudyError
            If a user-defined design fails.
        """
        study, found = self.study, list[Difference]()
        for name, design in study.designs.items():
            if name in omitted_designs(self.runs):  # their points are drawn with their batches
                continue
            stream = Stream(study.seed, "designs", name)
            for start, part in _parts(first_round(design, study.joint, stream)):
                these = {RUN: slice(start, start + part.sizes[RUN])}
                for model, variant in study.models.items():
                    again = part.drop_vars([RUN, *variant.given], errors="ignore").reset_coords()
                    archived = self.runs[model][name].isel(these)
                    shared = {
                        key: archived.variables[key] for key in again.variables if key in archived
                    }
                    differences = find_differences(xr.Dataset(shared), again, besides=None)
                    found += [each.within(_runs_name(model, name)) for each in differences]
        what = f"the first round of {', '.join(study.designs)} drawn again"
        return CheckResult.of_differences("points", what, found, self.tolerance)

    def check_statistics(self, tree: xr.DataTree, ignored: Collection[str]) -> CheckResult:
        """Repeat the statistics of the archived runs and compare them with the archived ones.

        Parameters
        ----------
        tree : DataTree
            The archive. One of another uqpen may lack statistics of this one.

        Raises
        ------
        StudyError
            If a user-defined analysis fails.
        """
        runs = {
            model: {design: self.runs[model][design] for design in self.study.designs}
            for model in self.study.models
        }
        again = analyse_runs(self.study, runs, self.progress)
        archived_groups, repeated_groups = _statistics_groups(tree), _statistics_groups(again)
        found = list(missing_keys(archived_groups, repeated_groups))
        recipe = other_recipe(tree)
        for path in sorted(archived_groups & repeated_groups):
            parts = path.strip("/").split("/") if path != "/" else []
            pair = [without_intervals(read_group(each, *parts), recipe) for each in (tree, again)]
            found += [each.within(path) for each in find_differences(*pair, besides=ignored)]
        total = len(found)
        found = [each for each in found if each.relative > NEGLIGIBLE]
        rounded = total - len(found)
        if tree.attrs.get("version_uqpen") != provenance()["version_uqpen"]:
            found = [each._replace(relative=0.0) if each.is_new else each for each in found]
        what = f"{len(archived_groups)} groups computed again"
        if rounded:
            what = f"{what}, {rounded} differ by less than {NEGLIGIBLE:.0g} of their scale"
        return CheckResult.of_differences("statistics", what, found, self.tolerance)


def _parts(points: Points) -> Iterator[tuple[int, xr.Dataset]]:
    """Yield the points of a round with the number of the first: whole, or blocks of very many."""
    if isinstance(points, xr.Dataset) or points.size <= RUNS_IN_MEMORY:
        yield 0, points_in_memory(points)
        return
    for start, stop in block_ranges(points.size):
        yield start, points.read(start, stop)


def _runs_name(model: str, design: str) -> str:
    return f"{model}: {design}" if model else design


def _statistics_groups(tree: xr.DataTree) -> set[str]:
    """Return the paths of all groups, except runs and files, which are not computed."""
    kept = {name for name, group in GROUPS.items() if not group.is_repeated}
    return {node.path for node in tree.subtree if group_place(node.path)[0] not in kept}
