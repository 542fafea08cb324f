"""Designs whose runs an archive has not kept: batches of them are repeated, and their hashes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.groups import GROUPS, group_place
from uqpen.core.arrays import IntArray
from uqpen.core.labels import BATCH_HASH
from uqpen.core.streams import Stream
from uqpen.execution import (
    Map,
    Progress,
    run_count,
)
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.omitted_runs import are_omitted
from uqpen.study.study import ValidatedStudy
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.user_defined_statistics import without_groups
from uqpen.workflow.repetition import hashes_again

__all__ = ["omitted_designs", "repeated_batches", "without_omitted"]

_MOST_LISTED = 8

_ADVICE = "uqpen rerun makes the runs and their statistics again, and uqpen diff compares these"
_ELSEWHERE = "last bits may differ where the versions or processors do, and a hash shows no size"


def omitted_designs(runs: Mapping[str, Mapping[str, xr.Dataset]]) -> list[str]:
    """Return the designs whose runs the archive has not kept, given the runs by model and design.

    They are the same for all models.
    """
    first = next(iter(runs.values()), {})
    return [design for design, made in first.items() if are_omitted(made)]


def repeated_batches(
    study: ValidatedStudy,
    runs: Mapping[str, Mapping[str, xr.Dataset]],
    number: int | None,
    tolerance: float,
    *,
    map: Map,
    progress: Progress,
) -> CheckResult:
    """Draw and make batches of runs again, and compare their hashes with the archived ones.

    Parameters
    ----------
    study, runs, tolerance, map, progress
        As for `repeated_runs`.
    number : int or None
        Number of runs, rounded up to whole batches, which are drawn at random; None for all.
    """
    found: list[str] = []
    repeated = total = 0
    for model, variant in study.models.items():
        for design in omitted_designs(runs):
            archived = runs[model][design][BATCH_HASH].values
            chosen = _drawn_batches(study, f"{model} {design}", archived.size, number)
            size = run_count(runs[model][design])
            name = f"{model}: {design}" if model else design
            again = hashes_again(study, variant, design, size, chosen, map, progress)
            for batch, own in again:
                if own != archived[batch]:
                    last = min((batch + 1) * BATCH_SIZE, size) - 1
                    found.append(f"{name}: runs {batch * BATCH_SIZE} to {last} are others now")
            repeated, total = repeated + len(chosen), total + archived.size
    what = f"{repeated} of {total} batches of {BATCH_SIZE} runs made again"
    if not found:
        return CheckResult("batches", CheckOutcome.EQUAL, f"{what}: equal by their hashes")
    details = tuple(found[:_MOST_LISTED])
    if len(found) > _MOST_LISTED:
        details += (f"and {len(found) - _MOST_LISTED} more",)
    if tolerance:
        outcome, details = CheckOutcome.UNCHECKED, (*details, _ELSEWHERE)
    else:
        outcome = CheckOutcome.DIFFERENT
    return CheckResult("batches", outcome, f"{what}: different", details)


def _drawn_batches(study: ValidatedStudy, name: str, batches: int, number: int | None) -> list[int]:
    """Draw as many batches as have a number of runs, by the study's seed; in order."""
    wanted = batches if number is None else min(-(-number // BATCH_SIZE), batches)
    generator = Stream(study.seed, "verification", "batches").generator(name)
    drawn: IntArray = np.sort(generator.choice(batches, wanted, replace=False))
    return [int(each) for each in drawn]


def without_omitted(
    study: ValidatedStudy, tree: xr.DataTree, designs: list[str]
) -> tuple[ValidatedStudy, xr.DataTree, CheckResult]:
    """Leave out what follows from runs that are not kept, with a result for it."""
    named = ", ".join(designs)
    message = f"not checked: those of {named}, as the archive has not kept the runs"
    unchecked = CheckResult("statistics", CheckOutcome.UNCHECKED, message, (_ADVICE,))
    kept = {name: each for name, each in study.designs.items() if name not in designs}
    return replace(study, designs=kept), without_groups(tree, _groups_of(tree, designs)), unchecked


def _groups_of(tree: xr.DataTree, designs: list[str]) -> Iterator[xr.DataTree]:
    """Yield the groups that follow from the runs of some designs."""
    for node in tree.subtree:
        name, names = group_place(node.path)
        design = names.get("design") or names.get("source")
        if design in designs and name in GROUPS and GROUPS[name].is_repeated:
            yield node
