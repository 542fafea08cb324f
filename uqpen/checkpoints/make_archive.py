"""Make the archive of a study on disk from its finished runs, wherever they are, and new ones."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.files import files_by_name
from uqpen.archive.read import group_names, model_trees, read_group, read_unchecked
from uqpen.archive.write import prepare_destination, write
from uqpen.checkpoints.folder import FAILED, CheckpointFolder, lock_archive
from uqpen.checkpoints.identity import has_missing_runs, is_unchanged
from uqpen.checkpoints.journal import Journal, are_costly
from uqpen.checkpoints.recheck import Recheck, is_as_made, runs_that_are_as_made
from uqpen.checkpoints.sources import (
    ArchivePlace,
    PointIndex,
    RunFinder,
    RunSource,
    input_columns,
    open_archives,
    sources_of_archives,
    unused_designs,
)
from uqpen.core.arrays import Arrays
from uqpen.core.errors import (
    ArchiveError,
    CheckpointError,
    ClusterError,
    StudyError,
    TooManyFailedError,
)
from uqpen.core.labels import (
    CONTENT,
    FORMULAS_OVER,
    REUSED_RUNS,
    REWEIGHTED_FROM,
    RUN,
    RUNS,
    STATUS,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.model import Model
from uqpen.core.status import Status
from uqpen.designs.design import Design, Extension, UnloadedDesign
from uqpen.execution import Map, Progress
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.designs_section import read_designs
from uqpen.study.document import parse_document
from uqpen.study.identity import (
    POINT_TABLES,
    StudyIdentity,
    study_identity,
)
from uqpen.study.study import ValidatedStudy
from uqpen.study.table_reader import TableReader
from uqpen.surrogates.refinement import RefinedDesign
from uqpen.workflow import Checkpoints, run
from uqpen.workflow.noise_check import NoiseCheck


@dataclass(frozen=True)
class ResumeOptions:
    """Use of the runs that earlier calls have finished."""

    fresh: bool = False  # whether all checkpointed runs are removed, and all runs made
    repeat_failed: bool = False  # whether the missing ones among the finished runs are made again
    # Whether the outputs of runs whose folders are kept are read from these, without a run. If
    # finished runs have no folder, this needs `fresh`.
    read_again: bool = False
    # Whether some of the finished runs are made again before all are taken; None for all but costly
    # ones.
    recheck: bool | None = None
    # Further archives whose runs may be taken; None for no archive, not even the one that is
    # replaced.
    reuse: Sequence[str | Path] | None = ()

    @property
    def takes_archived_runs(self) -> bool:
        """True if runs may be taken from archives."""
        return self.reuse is not None and not self.fresh


def make_archive(
    study: ValidatedStudy,
    path: str | Path,
    resume: ResumeOptions | None = None,
    *,
    map: Map = map,
    progress: Progress | None = None,
    runs_in_memory: int = RUNS_IN_MEMORY,
) -> xr.DataTree:
    """Make the runs of a study, analyse them, write the archive, and return it.

    Finished runs are kept in ``<path>.parts`` until the archive is complete. After an interruption
    of any kind, the next call makes only the remaining runs, and the same archive. Runs that the
    archive at `path` has already, or another one, are not made either. If nothing has changed since
    that archive was made, it stays as it is. Information that depends on time and place is in
    ``<path>.log``.

    Parameters
    ----------
    study : ValidatedStudy
        The result of `load_study`.
    path : str or Path
        The archive; one that is there is replaced when this one is complete. If it has costly runs
        that this one does not have, it is kept beside it, with a part of its hash in the name.
    resume : ResumeOptions, optional
        Use of finished runs; by default, all are taken.
    map : callable
        Like the built-in; it makes batches of runs. It cannot change a result.
    progress : Progress, optional
        Receives progress reports.
    runs_in_memory : int
        A design of more runs has them in files, also in the tree that is returned.

    Raises
    ------
    ArchiveError
        If the archive or its checkpoint cannot be written, another process is making it, or an
        archive to take runs from cannot be read.
    CheckpointError
        If there are checkpointed runs that this study would not make, or an archive to take runs
        from has runs of other models only; it states the changes.
    StudyError
        If folders are to be read again, and no model keeps any.
    """
    path = Path(path).absolute()
    resume = resume or ResumeOptions()
    prepare_destination(path)
    title = f"{study.name}: study {study.sha256[:16]}"
    log = path.with_name(f"{path.name}.log")
    is_worth_keeping = not resume.fresh and are_costly(log, path.name)
    identity = study_identity(study)
    with (
        lock_archive(path),
        Journal(log, title, progress or Progress()) as journal,
    ):
        recheck = Recheck(study, identity, resume.recheck, map, journal)
        named = resume.reuse or ()
        archives = (
            open_archives(identity, path, named, journal) if resume.takes_archived_runs else []
        )
        replaced = next((each for each in archives if not each.is_named), None)
        if replaced and _stays(replaced, identity, recheck, resume):
            journal.inform(f"{replaced.name}: nothing has changed, so it stays as it is")
            return replaced.tree
        for reason, what in identity.unknown:
            journal.warn(
                f"an interrupted start is not resumed: {reason}, so another version of {what} "
                "cannot be distinguished from this one"
            )
        folder = path.with_name(f"{path.name}.parts")
        finished = CheckpointFolder(folder, identity.runs, journal, runs_in_memory)
        _discard_runs(finished, study, resume)
        finder = _finder(recheck, finished, archives, journal, resume)

        def checkpoint(design: str, model: str, number: int) -> Checkpoint:
            own = (finished.scratch if identity.unknown else finished.checkpoint)(
                design, model, number
            )
            return finder.checkpoint(own, design, model)

        if resume.read_again:
            study = study.reading_again()
        try:
            seen = _seen_noise(study, archives)
            tree = _run_study(study, map, journal, finished, checkpoint, seen)
            if record := finder.record():
                tree.attrs[REUSED_RUNS] = record
            if earlier := next((each for each in archives if _adds_formulas(identity, each)), None):
                tree.attrs[FORMULAS_OVER] = str(earlier.tree.attrs[CONTENT])
            journal.start_step("writing the archive")
            # Of an archive that cannot be read, nobody knows what it has.
            loses = is_worth_keeping and (replaced is None or lacks_runs(study, tree, replaced))
            copy = _write(tree, path, finished, keeps_earlier=loses)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept_text(finished) or "nothing was written") from None
        journal.write_line(f"{path.name}: is written")
        if copy:
            journal.inform(f"{path.name}: the earlier archive is kept as {copy.name}")
        if any(study.design_runs(name) > runs_in_memory for name in study.designs):
            tree = read_unchecked(path, runs_in_memory)  # as the files of the runs are removed
        finished.remove_archived(finder.used_folders())
    return tree


def _stays(
    replaced: ArchivePlace, identity: StudyIdentity, recheck: Recheck, resume: ResumeOptions
) -> bool:
    """Check that an archive has all that a study would make, and that its runs are the same."""
    of_same_name = {
        name: found[name] for name, found in replaced.comparisons.items() if name in found
    }
    return (
        REWEIGHTED_FROM not in replaced.tree.attrs
        and [*model_trees(replaced.tree)] == [*of_same_name]
        and is_unchanged(identity, replaced.identity, of_same_name)
        and not (resume.repeat_failed and has_missing_runs(replaced.tree))
        and is_as_made(recheck, replaced)
    )


def _discard_runs(finished: CheckpointFolder, study: ValidatedStudy, resume: ResumeOptions) -> None:
    """Remove the finished runs that are to be made or read again; check that others are of use.

    Raises
    ------
    StudyError
        If folders are to be read again, and no model of the study keeps them.
    CheckpointError
        If finished runs have no folder that could be read again.
    """
    models = {name: variant.model for name, variant in study.models.items()}
    if resume.read_again and all(each.reading_again() is each for each in models.values()):
        raise StudyError("no model of the study keeps the folders of its runs; a command does")
    without = 0
    for name, found in finished.finished_runs() if resume.read_again and not resume.fresh else ():
        for position in np.flatnonzero(found.results.status == Status.OK).tolist():
            inputs = {key: float(values[position]) for key, values in found.inputs.items()}
            without += models[name].run_folder(inputs) is None
    if without:
        raise CheckpointError(
            f"{finished.folder}: {without} finished runs have no folder that could be read again\n"
            'keep = "all" in [model] keeps those of later runs; with --fresh, the others are '
            "repeated"
        )
    if resume.repeat_failed and any(each.noise.is_unseeded for each in models.values()):
        raise StudyError(
            "lost runs of a model with noise and no seed are not made again: to try until a run "
            "completes draws from another distribution than the model's; give a seed in [model]"
        )
    if resume.fresh or resume.read_again:
        finished.remove_all()
    finished.check_compatibility()
    if resume.repeat_failed:
        finished.discard_failed()


def _finder(
    recheck: Recheck,
    finished: CheckpointFolder,
    archives: Sequence[ArchivePlace],
    journal: Journal,
    resume: ResumeOptions,
) -> RunFinder:
    """Return the finished runs that a study may take, and report those that it cannot take.

    Some of those that it would take are made again.
    """
    study, identity = recheck.study, recheck.identity
    archived = sources_of_archives(study, archives, journal)
    sources: dict[str, list[RunSource]] = {}
    for name, model in identity.models.items():
        # Those set aside come first. Where versions cannot be distinguished, none were.
        is_unknown = study.models[name].model.unknown_dependency
        aside = [] if is_unknown else finished.set_aside_sources(name, model.fingerprint)
        sources[name] = [*aside, *archived[name]]
        if resume.repeat_failed:
            left = (each.without_statuses(FAILED) for each in sources[name])
            sources[name] = [*filter(None, left)]
    finder = runs_that_are_as_made(recheck, sources, archives, finished, journal)
    for archive in archives:
        for name, reason in unused_designs(archive.tree).items():
            journal.inform(f"{archive.name}: no run of its {name} is taken, as {reason}")
    replaced = (archive for archive in archives if not archive.is_named)
    not_kept = next((runs_not_kept(study, archive.tree) for archive in replaced), {})
    for name, text in (not_kept | unusable_runs(study, finder, not_kept)).items():
        journal.inform(f"{name}: {text}")
    return finder


def _kept_text(finished: CheckpointFolder) -> str:
    """Return a sentence on the number of kept runs; empty for none."""
    return (
        f"{finished.runs} runs are kept; the same command continues from there"
        if finished.runs
        else ""
    )


def _run_study(
    study: ValidatedStudy,
    map: Map,
    journal: Journal,
    finished: CheckpointFolder,
    checkpoints: Checkpoints,
    seen: Mapping[str, NoiseCheck],
) -> xr.DataTree:
    """Run a study; keep its finished runs if it is stopped."""
    try:
        return run(study, map=map, progress=journal, checkpoints=checkpoints, seen=seen)
    except TooManyFailedError as error:
        finished.save()
        message = f"{finished.runs} runs are kept. {error.remedy}"
        raise type(error)(f"{error}\n{message}" if finished.runs else str(error)) from None
    except ClusterError as error:
        finished.save()
        raise ClusterError("\n".join(filter(None, (str(error), _kept_text(finished))))) from None
    except BaseException:
        finished.save()
        raise


def _write(
    tree: xr.DataTree, path: Path, finished: CheckpointFolder, *, keeps_earlier: bool
) -> Path | None:
    """Write the archive; if that fails, keep its runs."""
    try:
        return write(tree, path, keeps_earlier=keeps_earlier)
    except ArchiveError as error:
        finished.save()
        message = f"all {finished.runs} runs are kept; the same command continues from there"
        raise ArchiveError(f"{error}\n{message}") from None
    except BaseException:
        finished.save()
        raise


def _seen_noise(study: ValidatedStudy, archives: Sequence[ArchivePlace]) -> dict[str, NoiseCheck]:
    """Return what archives say of the noise of the models, where the first design is the same."""
    design, now = next(iter(study.designs)), study.content
    found = {}
    for archive in archives:
        before = archive.identity.content
        is_same = all(before.get(key) == now.get(key) for key in _DECISIVE)
        if not is_same or design in archive.changed_designs:
            continue
        for name, group in model_trees(archive.tree).items():
            compared = archive.comparisons.get(name, {}).get(name)
            if compared and not compared.changes:
                found[name] = NoiseCheck.of_archive(group, design)
    return {name: check for name, check in found.items() if check}


def _adds_formulas(identity: StudyIdentity, earlier: ArchivePlace) -> bool:
    """Check that a study takes an archive's runs, and has a formula that the archive has not."""
    compared = (found for each in earlier.comparisons.values() for found in each.values())
    if all(found.changes for found in compared):
        return False
    now, before = (
        {name: table.get("formula") for name, table in content.get("outputs", {}).items()}
        for content in (identity.content, earlier.identity.content)
    )
    return any(formula and before.get(name) != formula for name, formula in now.items())


# What becomes of the runs of an archive that is replaced

# Where one of these has changed, the points or the model have, whatever the designs are.
_DECISIVE = ("seed", "model", "models", "inputs", "joint", "dependence", "constraints")


def lacks_runs(study: ValidatedStudy, tree: xr.DataTree, earlier: ArchivePlace) -> bool:
    """Check whether an earlier archive has runs that the new one of a study does not have.

    Only runs that are ok count: of the others, a study takes those that it would make.
    """
    if _lacks_designs(study, earlier):
        return True
    new = model_trees(tree)
    for archived, group in model_trees(earlier.tree).items():
        # A model that stands under several names has its runs under each of them.
        names = [name for name, found in earlier.comparisons.items() if not found[archived].changes]
        if not any(_has_runs(study.models[name].model, new[name], group) for name in names):
            return True
    return False


def _lacks_designs(study: ValidatedStudy, earlier: ArchivePlace) -> bool:
    """Check whether a design without runs, or with very many, was another one."""
    unused = unused_designs(earlier.tree)
    if not unused:
        return False
    before, now = earlier.identity.content, study.content
    if any(before.get(key) != now.get(key) for key in POINT_TABLES):
        return True
    for name in unused:
        if name not in study.designs or before["designs"][name] != now["designs"][name]:
            return True
        # These place the points of a refinement.
        is_refined = isinstance(study.designs[name], RefinedDesign)
        tables = ("surrogates", "outputs") if is_refined else ()
        files = files_by_name([*study.joint.files, *study.design_files(name)], study.folder)
        if any(before.get(key) != now.get(key) for key in tables) or any(
            earlier.identity.files.get(file) != snapshot.sha256 for file, snapshot in files.items()
        ):
            return True
    return False


def _has_runs(model: Model, new: xr.DataTree, earlier: xr.DataTree) -> bool:
    """Check that the group of a model in an archive has all runs of an earlier group."""
    own = [*_ok_inputs(new, model)]
    for inputs in _ok_inputs(earlier, model):
        same = [each for each in own if each.keys() == inputs.keys()]
        known = {key: np.concatenate([each[key] for each in same]) for key in inputs if same}
        runs = len(next(iter(inputs.values())))
        if runs and not (known and (PointIndex(known).find(inputs, 0, runs) >= 0).all()):
            return False
    return True


def _ok_inputs(group: xr.DataTree, model: Model) -> Iterator[Arrays]:
    """Yield the inputs of the runs that are ok, design by design, as far as they are at hand."""
    unused = unused_designs(group)
    for design in group_names(group, RUNS):
        if design not in unused:
            runs = read_group(group, RUNS, design)
            is_ok = runs[STATUS].values == Status.OK
            columns = input_columns(runs, model)
            yield {key: values[is_ok] for key, values in columns.items()}


def runs_not_kept(study: ValidatedStudy, archive: xr.DataTree) -> dict[str, str]:
    """Return what becomes of the runs of an archive that the designs of a study do not keep.

    Each text has the number of runs, and the settings nearest to the study's that keep them. Of
    a study with another model, other inputs or another seed there is none.

    Parameters
    ----------
    study : ValidatedStudy
        The study that is going to replace the archive.

    Returns
    -------
    dict of str to str
        By the name of a design.
    """
    try:
        document = parse_document(str(archive.attrs.get("study_text", "")), study.name)
    except StudyError:
        return {}
    before, now = document.content, study.content
    if any(before.get(key) != now.get(key) for key in _DECISIVE):
        return {}
    # Without trust, no code that the archive names is executed.
    table = TableReader(document, study.folder, trust=False, content=before).table("designs")
    designs, _ = read_designs(table, study.measured)
    first = next(iter(model_trees(archive).values()))
    found = {}
    for name, settings in table.content.items():
        runs = read_group(first, RUNS, name).sizes.get(RUN, 0)
        table_now = now.get("designs", {}).get(name)
        text = _use_text(study, name, settings, table_now, designs.get(name), runs)
        if runs and text:
            found[name] = text
    return found


def _use_text(
    study: ValidatedStudy,
    name: str,
    before: dict[str, Any],
    now: dict[str, Any] | None,
    earlier: Design | None,
    runs: int,
) -> str:
    """Return what becomes of the runs of a design, given its tables; empty if all are kept."""
    if before == now:
        return ""
    if now is None:
        return f"its {runs} earlier runs are not used: the study has no design of this name"
    if before.get("kind") != now.get("kind"):
        return f"its {runs} earlier runs are not used: it is of another kind"
    design = study.designs[name]
    if earlier is None or isinstance(earlier, UnloadedDesign):
        return Extension(None).text(runs, design.run_count(study.joint))
    # A design that redraws points has made more runs than its settings say, one that stops fewer.
    settled = min(runs, earlier.run_count(study.joint))
    return design.extension(earlier, study.joint).text(settled, design.run_count(study.joint))


def unusable_runs(
    study: ValidatedStudy,
    finder: RunFinder,
    known: Collection[str],
) -> dict[str, str]:
    """Return a text for each changed design of whose finished runs none is at its first points.

    Parameters
    ----------
    known : collection of str
        Names of designs that are left out.

    Returns
    -------
    dict of str to str
        By the name of a design.
    """
    texts = {}
    for name in study.designs:
        for model, found in finder.sources.items():
            runs = sum(len(each.runs.runs) for each in found if each.changed_design == name)
            if not runs or name in known:
                continue
            if not finder.places_of(model, name):
                texts[name] = f"none of its {runs} earlier runs is at a point of the changed design"
    return texts
