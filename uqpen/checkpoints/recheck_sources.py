"""Sources of runs that a study may take, as far as runs that are made again are the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.checkpoints.archived_runs import archived_sources
from uqpen.checkpoints.folder import CheckpointFolder
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.recheck import Recheck, Takeable
from uqpen.checkpoints.reuse import RunFinder, first_points
from uqpen.checkpoints.run_sources import EarlierArchive, shown_path
from uqpen.checkpoints.sources import SET_ASIDE, RunSource
from uqpen.core.labels import RUNS
from uqpen.execution.omitted_runs import are_omitted
from uqpen.study.study import ValidatedStudy

__all__ = ["is_as_made", "runs_that_are_as_made"]

_Sources = Mapping[str, Sequence[RunSource]]

_NEVERTHELESS = "take them nevertheless with --no-recheck"


def is_as_made(study: ValidatedStudy, archive: EarlierArchive, recheck: Recheck) -> bool:
    """Check that some runs of an archive of this very study are the same when made again."""
    outcomes = []
    for name in filter(recheck.applies, study.models):
        found = archived_sources(study, name, archive.tree, archive.place, first_blocks=True)
        group = model_trees(archive.tree)[name]
        designs = {design: read_group(group, RUNS, design) for design in group_names(group, RUNS)}
        omitted = {design: runs for design, runs in designs.items() if are_omitted(runs)}
        outcomes.append(recheck.look(name, _of_archive(archive, found.sources, omitted)))
    return not any(each.is_refused for each in outcomes)


def runs_that_are_as_made(
    study: ValidatedStudy,
    sources: _Sources,
    archives: Mapping[str, EarlierArchive],
    kept: CheckpointFolder,
    recheck: Recheck,
    journal: Journal,
    *,
    has_parts: bool,
) -> RunFinder:
    """Return the earlier runs that a study may take; of those in each place, some are made again.

    They are made again only where one of a design's first points has a run.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    sources : mapping of str to sequence of RunSource
        The sources of runs by the name of a model.
    archives : mapping of str to EarlierArchive
        The archives among their places.
    kept : CheckpointFolder
        The finished runs beside the archive.
    recheck : Recheck
        Makes runs again.
    journal : Journal
        Receives the numbers of runs that are taken.
    has_parts : bool
        Whether finished runs of the study's own designs are taken.

    Raises
    ------
    CheckpointError
        If runs of the folder, or of an archive that the user has named, differ.
    """
    parts = {name: kept.part_sources(name) for name in study.models if recheck.applies(name)}
    parts = {name: found for name, found in parts.items() if found and has_parts}
    planned = sum(study.design_runs(design) for design in study.designs)
    left = {name: planned - _count(parts.get(name, ())) - _count(sources[name]) for name in sources}
    unchecked = [
        (name, source.design)
        for name, own in parts.items()
        if recheck.look(name, _of_folder(kept, kept.folder, own), left[name]).is_unchecked
        for source in own
    ]
    while True:
        reused = RunFinder(study, sources, journal)
        refused = set()
        for name, place in _taken(study, sources, reused):
            own = [each for each in sources[name] if each.place == place]
            if place in archives:
                runs = _of_archive(archives[place], own)
            else:
                runs = _of_folder(kept, kept.folder / SET_ASIDE, own)
            outcome = recheck.look(name, runs, left[name])
            if outcome.is_unchecked:
                reused.mark_not_made_again(name, place)
            if outcome.is_refused:
                refused.add((name, place))
        if not refused:
            break
        sources = {
            name: [each for each in found if (name, each.place) not in refused]
            for name, found in sources.items()
        }
    for name, design in unchecked:
        reused.record_not_made_again(design, name)
    return reused


def _taken(
    study: ValidatedStudy, sources: _Sources, reused: RunFinder
) -> Iterator[tuple[str, str]]:
    """Yield the models and the places from which runs at the first points of a design come."""
    for name, found in sources.items():
        points = (first_points(study, design, name) for design in study.designs if found)
        used = set[str]().union(*(reused.used_places(name, each) for each in points))
        places = dict.fromkeys(each.place for each in found)
        yield from ((name, place) for place in places if place in used)


def _of_archive(
    archive: EarlierArchive,
    sources: Sequence[RunSource],
    omitted: Mapping[str, xr.Dataset] | None = None,
) -> Takeable:
    leave_out = "leave it out to make all runs, or " if archive.is_named else ""
    remedy = f"{leave_out}{_NEVERTHELESS}"
    return Takeable(archive.place, sources, archive.log, remedy, archive.is_named, omitted or {})


def _of_folder(kept: CheckpointFolder, place: Path, sources: Sequence[RunSource]) -> Takeable:
    remedy = f"continue with the model as it was, {_NEVERTHELESS}, or start over with --fresh"
    return Takeable(shown_path(place), sources, kept.folder.with_suffix(".log"), remedy)


def _count(sources: Sequence[RunSource]) -> int:
    return sum(len(each.runs.runs) for each in sources)
