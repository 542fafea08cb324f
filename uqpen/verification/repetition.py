"""Repetition of an archive's runs and statistics, and comparison with the archive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import xarray as xr

from uqpen.archive.groups import GROUPS, group_place
from uqpen.archive.read import read_group
from uqpen.core.arrays import IntArray
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import CONTENT, RECIPE, RUN
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import Points, points_in_memory
from uqpen.designs.rounds import first_round
from uqpen.execution import EvaluationOptions, Evaluator, FailurePolicy, Map, Progress, evaluate
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import run_inputs
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.differences import NEGLIGIBLE, find_differences, missing_keys
from uqpen.verification.interval_recipes import other_recipe, without_intervals
from uqpen.verification.omitted_designs import omitted_designs
from uqpen.workflow import analyse_runs, run_design
from uqpen.workflow.repetition import TOLERANCE, Difference, run_differences

__all__ = [
    "Runs",
    "draw_runs",
    "repeated_points",
    "repeated_runs",
    "repeated_statistics",
    "reread_runs",
]

Positions = IntArray | range
Runs = Mapping[str, Mapping[str, xr.Dataset]]

# Number of differences listed for one part; a damaged archive may have thousands.
_MOST_LISTED = 8


def repeated_runs(
    study: ValidatedStudy,
    runs: Runs,
    number: int | None,
    tolerance: float,
    *,
    map: Map,
    progress: Progress,
) -> CheckResult:
    """Repeat runs at the archived inputs and compare them with the archived runs.

    Parameters
    ----------
    study : ValidatedStudy
        Read from the archive, with models that may be run.
    runs : mapping of str to mapping of str to Dataset
        The archived ones, by model and design.
    number : int or None
        Number of runs, drawn at random from all; None for all.
    tolerance : float
        Largest relative difference; 0 where every bit must be the same.
    map, progress
        As for `uqpen.run`.
    """
    found: list[Difference] = []
    policy = FailurePolicy(study.failures.retry)
    options = EvaluationOptions(map=map, progress=progress, failures=policy)
    chosen = list(draw_runs(study, runs, number))
    progress.announce_designs({_runs_name(model, design): len(at) for model, design, at in chosen})
    for model, design, positions in chosen:
        progress.start_design(_runs_name(model, design), len(positions))
        variant, archived_runs = study.models[model], runs[model][design]
        for start in range(0, len(positions), RUNS_IN_MEMORY):  # very many are taken by parts
            part = np.asarray(positions[start : start + RUNS_IN_MEMORY])
            archived = archived_runs.isel({RUN: part}).load()
            inputs = {name: archived.variables[name] for name in run_inputs(study, archived)}
            points = xr.Dataset(inputs, {RUN: archived.variables[RUN]})
            again = evaluate(
                Evaluator(variant.model, study.constraints),
                points,
                {},
                options,
            )
            found += run_differences(
                _runs_name(model, design), archived, again, variant.model.all_outputs
            )
    repeated = sum(len(positions) for _, _, positions in chosen)
    total = sum(
        archived_runs.sizes[RUN] for designs in runs.values() for archived_runs in designs.values()
    )
    return _check_result("runs", f"{repeated} of {total} repeated", found, tolerance)


def reread_runs(study: ValidatedStudy, runs: Runs) -> CheckResult:
    """Read runs again from the data file that they come from; no model can repeat them.

    The file is the archived one, or has its hash, so every bit must be the same.
    """
    found: list[Difference] = []
    ((model, variant),) = study.models.items()
    for name, design in study.designs.items():
        stream = Stream(study.seed, "designs", name)
        again = run_design(study, design, stream, map=map, progress=Progress())[model]
        archived = runs[model][name]
        inputs = _without_attributes(archived[run_inputs(study, archived)])
        found += [
            each._replace(what=f"{name}: {each.what}")
            for each in find_differences(inputs, _without_attributes(again[list(inputs)]))
        ]
        found += run_differences(name, archived, again, variant.model.all_outputs)
    rows = sum(archived.sizes[RUN] for archived in runs[model].values())
    file = variant.model.name
    what = f"not repeatable, as they come from a file; {rows} read again from {file}"
    return _check_result("runs", what, found, 0.0)


def repeated_points(study: ValidatedStudy, runs: Runs, tolerance: float) -> CheckResult:
    """Draw the first round of every design again and compare it with the archived runs.

    Later rounds of an adaptive design follow from the runs before.
    """
    found: list[Difference] = []
    for name, design in study.designs.items():
        if name in omitted_designs(runs):  # their points are drawn again with their batches
            continue
        stream = Stream(study.seed, "designs", name)
        for start, part in _parts(first_round(design, study.joint, stream)):
            drawn = _without_attributes(part)
            these = slice(start, start + drawn.sizes[RUN])
            for model, variant in study.models.items():
                again = drawn.drop_vars([RUN, *variant.given], errors="ignore")
                archived = _without_attributes(runs[model][name].isel({RUN: these}))
                archived = xr.Dataset(
                    {key: archived.variables[key] for key in again.variables if key in archived}
                )
                found += [
                    each._replace(what=f"{_runs_name(model, name)}: {each.what}")
                    for each in find_differences(archived, again.reset_coords())
                ]
    what = f"the first round of {', '.join(study.designs)} drawn again"
    return _check_result("points", what, found, tolerance)


def _without_attributes(dataset: xr.Dataset) -> xr.Dataset:
    """Return what `Dataset.drop_attrs` does, which merges all variables for each of them."""
    found = dataset.copy(deep=False)
    found.attrs = {}
    for variable in found.variables.values():
        variable.attrs = {}
    return found


def _parts(points: Points) -> Iterator[tuple[int, xr.Dataset]]:
    """Yield the points of a round with the number of the first: whole, or blocks of very many."""
    if isinstance(points, xr.Dataset) or points.size <= RUNS_IN_MEMORY:
        yield 0, points_in_memory(points)
        return
    for start, stop in block_ranges(points.size):
        yield start, points.read(start, stop)


def repeated_statistics(
    study: ValidatedStudy,
    tree: xr.DataTree,
    runs: Runs,
    tolerance: float,
    besides: Sequence[str],
    *,
    is_earlier: bool = False,
    progress: Progress | None = None,
) -> CheckResult:
    """Repeat the statistics of the archived runs and compare them with the archived ones.

    Parameters
    ----------
    study, tree, runs
        Of the archive.
    tolerance : float
        Largest relative difference; 0 where every bit must be the same.
    besides : sequence of str
        Attributes that may differ.
    is_earlier : bool
        True if the archive is of another uqpen, which may lack statistics of this one.
    progress : Progress, optional
        Receives a report of each step.
    """
    in_order = {
        model: {design: runs[model][design] for design in study.designs} for model in study.models
    }
    again = analyse_runs(study, in_order, progress)
    archived_groups, repeated_groups = _statistics_groups(tree), _statistics_groups(again)
    found = list(missing_keys(archived_groups, repeated_groups))
    uncompared = other_recipe(tree)
    for path in sorted(archived_groups & repeated_groups):
        parts = path.strip("/").split("/") if path != "/" else []
        pair = [without_intervals(read_group(each, *parts), uncompared) for each in (tree, again)]
        found += [
            difference._replace(what=f"{path}: {difference.what}")
            for difference in find_differences(*pair, besides=(CONTENT, RECIPE, *besides))
        ]
    total = len(found)
    found = [each for each in found if each.relative > NEGLIGIBLE]
    rounded = total - len(found)
    if is_earlier:
        found = [each._replace(relative=0.0) if each.is_new else each for each in found]
    what = f"{len(archived_groups)} groups computed again"
    if rounded:
        what = f"{what}, {rounded} differ by less than {NEGLIGIBLE:.0g} of their scale"
    return _check_result("statistics", what, found, tolerance)


def draw_runs(
    study: ValidatedStudy, runs: Runs, number: int | None
) -> Iterator[tuple[str, str, Positions]]:
    """Draw a number of runs at random from all runs, by the study's seed; None for all.

    Yields model, design and positions in that design, in the order in which the study made them;
    of all runs of a design a range.
    """
    places = [
        (model, design, runs[model][design].sizes[RUN])
        for design in study.designs
        for model in study.models
    ]
    total = sum(size for _, _, size in places)
    if number is None or number >= total:
        yield from ((model, design, range(size)) for model, design, size in places if size)
        return
    generator = Stream(study.seed, "verification").generator()
    drawn = np.sort(generator.choice(total, number, replace=False))
    start = 0
    for model, design, size in places:
        positions = drawn[(drawn >= start) & (drawn < start + size)] - start
        if positions.size:
            yield model, design, positions
        start += size


def _check_result(name: str, what: str, found: list[Difference], tolerance: float) -> CheckResult:
    """Return the result of a repetition, the largest differences first."""
    found = sorted(found, key=lambda each: -each.relative)
    details = [each.what for each in found[:_MOST_LISTED]]
    if len(found) > len(details):
        details.append(f"and {len(found) - len(details)} more")
    if not found:
        return CheckResult(name, CheckOutcome.EQUAL, f"{what}: bit-equal")
    if found[0].relative <= tolerance:
        close = f"{what}: equal within {TOLERANCE:g} of the largest value"
        return CheckResult(name, CheckOutcome.CLOSE, close, tuple(details))
    return CheckResult(name, CheckOutcome.DIFFERENT, f"{what}: different", tuple(details))


def _runs_name(model: str, design: str) -> str:
    return f"{model}: {design}" if model else design


def _statistics_groups(tree: xr.DataTree) -> set[str]:
    """Return the paths of all groups, except runs and files, which are not computed."""
    kept = {name for name, group in GROUPS.items() if not group.is_repeated}
    return {node.path for node in tree.subtree if group_place(node.path)[0] not in kept}
