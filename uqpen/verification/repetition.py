"""Runs of an archive made again, and its statistics worked out again, and held against it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.files import FILES
from uqpen.archive.read import group
from uqpen.evaluation import Evaluator, Failures, Map, Progress, evaluate
from uqpen.labels import CONTENT, MODELS, RUN, RUNS, STATUS
from uqpen.model import Output
from uqpen.streams import Stream
from uqpen.study.study import Study
from uqpen.verification.agreement import (
    NEGLIGIBLE,
    TOLERANCE,
    Disagreement,
    differing,
    disagreements,
    gap,
    size_of,
)
from uqpen.verification.archived import inputs_of
from uqpen.verification.report import Part, Verdict
from uqpen.workflow import analysed

__all__ = ["Runs", "drawn_runs", "repeated_runs", "repeated_statistics"]

Positions = npt.NDArray[np.int64]
Runs = Mapping[str, Mapping[str, xr.Dataset]]

_TO_THE_BIT = "bit-equal"
# What is told of one part; a damaged archive may differ in thousands of things.
_MOST_TOLD = 8


def repeated_runs(
    study: Study,
    runs: Runs,
    number: int | None,
    tolerance: float,
    *,
    map: Map,
    progress: Progress,
) -> Part:
    """Runs made again at the archived inputs.

    Parameters
    ----------
    study : Study
        Read from the archive, with models that may be run.
    runs : mapping of str to mapping of str to Dataset
        The archived ones, by model and design.
    number : int or None
        How many are drawn at random from all; None for all.
    tolerance : float
        0 where every bit must be the same.
    map : callable
        Like the built-in: where batches of runs are made.
    progress : Progress
        Told how far it is.
    """
    found: list[Disagreement] = []
    chosen = list(drawn_runs(study, runs, number))
    for model, design, positions in chosen:
        progress.design(_called(model, design), len(positions))
        variant, made = study.models[model], runs[model][design]
        inputs = {name: made.variables[name] for name in inputs_of(study, made)}
        points = xr.Dataset(inputs, {RUN: made.variables[RUN]}).isel({RUN: positions})
        again = evaluate(
            Evaluator(variant.model, study.constraints),
            points,
            {},
            map=map,
            progress=progress,
            failures=Failures(study.failures.retry),
        )
        archived = made.isel({RUN: positions})
        found += _of_runs(_called(model, design), archived, again, variant.model.outputs)
    repeated = sum(len(positions) for _, _, positions in chosen)
    held = sum(made.sizes[RUN] for designs in runs.values() for made in designs.values())
    return _part("runs", f"{repeated} of {held} repeated", found, tolerance)


def repeated_statistics(
    study: Study,
    tree: xr.DataTree,
    runs: Runs,
    tolerance: float,
    besides: Sequence[str],
    *,
    is_earlier: bool = False,
) -> Part:
    """All that the archived runs tell, worked out again.

    Parameters
    ----------
    study : Study
        Read from the archive.
    tree : DataTree
        The archive.
    runs : mapping of str to mapping of str to Dataset
        Its runs.
    tolerance : float
        0 where every bit must be the same.
    besides : sequence of str
        Attributes that may differ.
    is_earlier : bool
        Whether the archive was made by a uqpen that did not tell yet all that this one tells.
    """
    in_order = {
        model: {design: runs[model][design] for design in study.designs} for model in study.models
    }
    again = analysed(study, in_order)
    held, made = _groups(tree), _groups(again)
    found = [Disagreement(f"{path} is not found again", np.inf) for path in sorted(held - made)]
    found += [
        Disagreement(f"{path} is missing", np.inf, is_new=True) for path in sorted(made - held)
    ]
    for path in sorted(held & made):
        parts = path.strip("/").split("/") if path != "/" else []
        pair = group(tree, *parts), group(again, *parts)
        found += [
            told._replace(what=f"{path}: {told.what}")
            for told in disagreements(*pair, besides=(CONTENT, *besides))
        ]
    counting = [each for each in found if each.gap > NEGLIGIBLE]
    rounded = len(found) - len(counting)
    found = counting
    if is_earlier:
        found = [each._replace(gap=0.0) if each.is_new else each for each in found]
    what = f"{len(held)} groups worked out again"
    if rounded:
        what = f"{what}, {rounded} differ by less than {NEGLIGIBLE:.0g} of their scale"
    return _part("statistics", what, found, tolerance)


def drawn_runs(
    study: Study, runs: Runs, number: int | None
) -> Iterator[tuple[str, str, Positions]]:
    """Runs drawn at random of all that there are, the same ones each time.

    Parameters
    ----------
    study : Study
        Whose seed decides.
    runs : mapping of str to mapping of str to Dataset
        By model and design.
    number : int or None
        How many; None for all.

    Yields
    ------
    model, design : str
        In the order in which the study made them.
    positions : ndarray of int
        Of the runs in that design, ascending.
    """
    places = [
        (model, design, runs[model][design].sizes[RUN])
        for design in study.designs
        for model in study.models
    ]
    total = sum(size for _, _, size in places)
    if number is None or number >= total:
        drawn = np.arange(total)
    else:
        generator = Stream(study.seed, "verification").generator()
        drawn = np.sort(generator.choice(total, number, replace=False))
    start = 0
    for model, design, size in places:
        positions = drawn[(drawn >= start) & (drawn < start + size)] - start
        if positions.size:
            yield model, design, positions
        start += size


def _of_runs(
    called: str, archived: xr.Dataset, again: xr.Dataset, outputs: Sequence[Output]
) -> Iterator[Disagreement]:
    """What came out otherwise, with the first run of which it did."""
    for name in (STATUS, *(output.name for output in outputs)):
        one, other = archived[name].values, again[name].values
        at = np.flatnonzero(differing(one, other))
        if at.size:
            first = at[0]
            numbers = archived[RUN].values[at]
            apart = gap(one, other)
            count = f"; {at.size} of its runs differ" if at.size > 1 else "; it differs"
            yield Disagreement(
                f"{called}: {name} of run {numbers[0]} is {one[first]!s} in the archive and "
                f"{other[first]!s} now{count}{size_of(apart)}",
                apart,
            )


def _part(name: str, what: str, found: list[Disagreement], tolerance: float) -> Part:
    """The verdict on what was repeated, the largest differences first."""
    found = sorted(found, key=lambda each: -each.gap)
    details = [each.what for each in found[:_MOST_TOLD]]
    if len(found) > len(details):
        details.append(f"and {len(found) - len(details)} more")
    if not found:
        return Part(name, Verdict.EQUAL, f"{what}: {_TO_THE_BIT}")
    if found[0].gap <= tolerance:
        close = f"{what}: equal within {TOLERANCE:g} of the largest value"
        return Part(name, Verdict.CLOSE, close, tuple(details))
    return Part(name, Verdict.DIFFERENT, f"{what}: different", tuple(details))


def _called(model: str, design: str) -> str:
    return f"{model}: {design}" if model else design


def _groups(tree: xr.DataTree) -> set[str]:
    """The paths of all groups but those of runs and files, which are not worked out."""
    split = {node.path: node.path.strip("/").split("/") for node in tree.subtree}
    return {
        path
        for path, parts in split.items()
        if parts[0] not in (RUNS, FILES) and not (parts[0] == MODELS and parts[2:3] == [RUNS])
    }
