"""Places of finished runs, and what is in them."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.archive.hashes import group_hashes, recorded_hashes
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group, read_tree
from uqpen.archive.structure import find_faults
from uqpen.checkpoints.identity import (
    ModelComparison,
    compare_models,
    fingerprint_changes,
    list_changes,
    read_fingerprint,
)
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.parts import MADE_OF, FinishedRuns, part_files, part_number, select_results
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.core.labels import (
    FAILED_RUN,
    FAILURE_REASON,
    NOT_MADE_AGAIN,
    REUSED_RUNS,
    ROUND,
    RUN,
    RUNS,
    STATUS,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.model import Model, Output, Results
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK
from uqpen.execution.batch import join_results
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.omitted_runs import are_omitted
from uqpen.study.fingerprint import is_user_defined
from uqpen.study.study import ValidatedStudy
from uqpen.workflow import root_attributes

__all__ = [
    "SET_ASIDE",
    "ArchivePlace",
    "Place",
    "RunSource",
    "archived_sources",
    "input_columns",
    "open_archives",
    "set_aside_design",
    "set_aside_sources",
    "shown_path",
    "sources_of_archives",
    "unused_designs",
]

# Folder, beside those of designs, of finished runs that belong to none: they are found by their
# inputs alone. Settings of their design have changed since, or they were made to try a model.
SET_ASIDE = "set_aside"

_KEPT = "those kept before"

_NEVERTHELESS = "take them nevertheless with --no-recheck"


@dataclass(frozen=True)
class Place:
    """Place of finished runs: a folder beside the archive that is made.

    Attributes
    ----------
    name : str
        Its path, for display.
    log : Path
        The log of the making of its runs.
    """

    name: str
    log: Path

    @property
    def are_needed(self) -> bool:
        """True if it is an error if none of its runs can be taken."""
        return True

    @property
    def remedy(self) -> str:
        """What a user can do if none of its runs is taken."""
        return f"continue with the model as it was, {_NEVERTHELESS}, or start over with --fresh"


@dataclass(frozen=True)
class ArchivePlace(Place):
    """Archive of an earlier study, as a place of finished runs.

    Attributes
    ----------
    tree : DataTree
        Its content.
    is_named : bool
        True if the user has named it.
    """

    tree: xr.DataTree
    is_named: bool

    @property
    def are_needed(self) -> bool:
        """True if it is an error if none of its runs can be taken."""
        return self.is_named

    @property
    def remedy(self) -> str:
        """What a user can do if none of its runs is taken."""
        leave_out = "leave it out to make all runs, or " if self.is_named else ""
        return f"{leave_out}{_NEVERTHELESS}"


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
        for runs in _stored_rounds(folder, read):
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


def _stored_rounds(
    folder: Path, read: Callable[[Path], FinishedRuns | None]
) -> Iterator[FinishedRuns]:
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


def open_archives(
    replaced: Path, named: Sequence[str | Path], journal: Journal
) -> list[ArchivePlace]:
    """Read the archive that is replaced, if it can be used, and those that the user has named.

    Raises
    ------
    ArchiveError
        If one that is named cannot be read, or is no archive of a study.
    """
    others = [Path(path) for path in named]
    found = [
        _open_archive(path, is_named=True)
        for path in others
        if path.resolve() != replaced.resolve()
    ]
    if replaced.exists():
        try:
            found.insert(0, _open_archive(replaced, is_named=False))
        except ArchiveError as error:
            reason = str(error).removeprefix(f"{replaced}: ")
            journal.inform(f"{shown_path(replaced)}: none of its runs is taken: {reason}")
    return found


def _open_archive(path: Path, *, is_named: bool) -> ArchivePlace:
    log = path.absolute().with_name(f"{path.name}.log")
    return ArchivePlace(shown_path(path), log, _open_intact(path), is_named)


def sources_of_archives(
    study: ValidatedStudy, archives: Sequence[ArchivePlace], journal: Journal
) -> Mapping[str, list[RunSource]]:
    """Return the runs that each model of a study may take from archives, by the model's name.

    Raises
    ------
    CheckpointError
        If an archive that the user has named has no runs of any of the models; it states what has
        changed.
    """
    found: dict[str, list[RunSource]] = {name: [] for name in study.models}
    for archive in archives:
        changes: list[str] = []
        runs = 0
        for name, sources in found.items():
            own, changed = archived_sources(study, name, archive)
            sources += own
            runs += sum(len(source.runs.runs) for source in own)
            changes += changed
        if runs:
            journal.write_line(f"{archive.name}: {_made_with(study, archive.tree)}")
        elif not changes:
            if archive.is_named:
                reasons = "; ".join(f"{k}: {v}" for k, v in unused_designs(archive.tree).items())
                raise CheckpointError(
                    f"{archive.name}: none of its runs can be taken: {reasons}\n"
                    "leave it out to make all runs"
                )
        elif archive.is_named:
            raise CheckpointError(
                f"{archive.name}: its runs cannot be taken, as they are of another model:\n"
                f"{list_changes(changes)}\nleave it out to make all runs"
            )
        else:
            journal.inform(
                f"{archive.name}: none of its runs is taken, as they are of another model:\n"
                f"{list_changes(changes)}"
            )
    return found


def _made_with(study: ValidatedStudy, tree: xr.DataTree) -> str:
    """Return the provenance of an archive, for the log."""
    differences = provenance_differences(tree.attrs, root_attributes(study))
    texts = ", ".join(f"{name} {one} (here {other})" for name, one, other in differences)
    origin = f"study {str(tree.attrs['study_sha256'])[:16]}"
    return f"{origin}, made with {texts or 'the same versions and kind of processor as here'}"


def shown_path(path: Path) -> str:
    """Return a path as short as it can be written here."""
    path = path.absolute()
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def _open_intact(path: Path) -> xr.DataTree:
    """Read the archive of a study whose groups are those that were written.

    Raises
    ------
    ArchiveError
        If it cannot be read, has been changed, or is no archive of a study.
    """
    tree = read_tree(path)
    if recorded_hashes(tree) != group_hashes(tree):
        raise ArchiveError(f"{path}: has been changed since it was written")
    if fault := next(find_faults(tree), None):
        raise ArchiveError(f"{path}: is damaged: {fault}")
    try:
        tomllib.loads(str(tree.attrs["study_text"]))
    except ValueError as error:
        raise ArchiveError(f"{path}: is damaged: the text of its study: {error}") from None
    if is_benchmark(tree):
        raise ArchiveError(f"{path}: is the archive of a benchmark, which has no runs of a study")
    return tree


def unused_designs(tree: xr.DataTree) -> dict[str, str]:
    """Return the designs whose runs no study takes from an archive, each with the reason."""
    found = {}
    for model in model_trees(tree).values():
        for design in group_names(model, RUNS):
            runs = read_group(model, RUNS, design)
            if are_omitted(runs):
                found[design] = "the archive has only their statistics"
            elif runs.sizes[RUN] > RUNS_IN_MEMORY:
                found[design] = f"it has more than {RUNS_IN_MEMORY} runs"
    return found


def archived_sources(
    study: ValidatedStudy, name: str, archive: ArchivePlace, *, first_blocks: bool = False
) -> tuple[list[RunSource], tuple[str, ...]]:
    """Return the runs of an archive that are runs of a model; if there are none, what has changed.

    Of a design with very many runs there is none, or the first block only.

    Parameters
    ----------
    study, name
        The study, and the name of its model.
    archive : ArchivePlace
        The archive.
    first_blocks : bool
        Whether designs with very many runs have their first block.
    """
    names = list(model_trees(archive.tree))
    # The model of the same name first: its changes are told if there is no other.
    names.sort(key=lambda each: each != name)
    comparisons = {each: compare_models(study, name, archive.tree, each) for each in names}
    found = [
        source
        for archived, comparison in comparisons.items()
        if not comparison.changes
        for source in _sources(study, name, archive, archived, comparison, first_blocks)
    ]
    return found, () if found else comparisons[names[0]].changes


def _sources(
    study: ValidatedStudy,
    name: str,
    archive: ArchivePlace,
    archived_name: str,
    comparison: ModelComparison,
    first_blocks: bool,
) -> Iterator[RunSource]:
    tree = archive.tree
    model = study.models[name].model
    left_out = [] if comparison.is_same_limit else [Status.TIMED_OUT]
    left_out += [] if comparison.is_same_domain else [Status.INADMISSIBLE]
    here = {**provenance(), **(of_python_functions() if is_user_defined(model) else {})}
    then = {key: value for key, value in tree.attrs.items() if key in here}
    others = ", ".join(f"{what} {value}" for what, value, _ in provenance_differences(then, here))
    made_with = [f"runs made with {others}"] if others else []
    group = model_trees(tree)[archived_name]
    changed = _changed_designs(study, tree)
    for design in group_names(group, RUNS):
        archived = read_group(group, RUNS, design)
        is_whole = archived.sizes[RUN] <= RUNS_IN_MEMORY
        if not is_whole:
            if not first_blocks:
                continue  # they are found by their inputs, for which all have to be in memory
            archived = archived.isel({RUN: slice(BLOCK)})
        for runs in _archived_rounds(archived, model, comparison.dependencies):
            source = RunSource(
                archive.name,
                runs,
                is_complete=is_whole,
                made_with=(*made_with, *_inherited(tree, archived_name, design)),
                changed_design=design if design in changed else "",
                design=design,
            ).without_statuses(left_out)
            if source is not None:
                yield source


def _inherited(tree: xr.DataTree, model: str, design: str) -> Iterator[str]:
    """Yield what an archive says of runs of a design that it has taken from others."""
    label = f"{model}: {design}: " if model else f"{design}: "
    for line in str(tree.attrs.get(REUSED_RUNS, "")).split("\n"):
        # Whether they are made again is decided wherever they are taken.
        if line.startswith(label) and not line.endswith(NOT_MADE_AGAIN):
            yield line.removeprefix(label)


def _changed_designs(study: ValidatedStudy, tree: xr.DataTree) -> set[str]:
    """Return the names of the designs that the archive's study has with other settings."""
    texts = str(tree.attrs["study_text"]), study.text
    before, now = (tomllib.loads(text).get("designs", {}) for text in texts)
    return {name for name in before.keys() & now.keys() if before[name] != now[name]}


def _archived_rounds(
    runs: xr.Dataset, model: Model, dependencies: frozenset[str]
) -> Iterator[FinishedRuns]:
    """Yield the runs of each round of a design; none if a variable is not as the model has it."""
    inputs = input_columns(runs, model)
    if not all(_has_output(runs, output) for output in model.outputs):
        return
    outputs = {output.name: _values(runs, output) for output in model.outputs}
    status = runs[STATUS].values.astype(np.int8)
    reasons = dict.fromkeys(np.flatnonzero(status != Status.OK).tolist(), "no reason was recorded")
    if FAILED_RUN in runs:
        failed = zip(runs[FAILED_RUN].values.tolist(), runs[FAILURE_REASON].values, strict=True)
        reasons |= {run: str(reason) for run, reason in failed if run in reasons}
    whole = Results(outputs, status, reasons, dependencies)
    if ROUND not in runs:
        if runs.sizes[RUN]:
            yield FinishedRuns(np.arange(runs.sizes[RUN]), inputs, whole)
        return
    number = runs[ROUND].values
    for each in np.unique(number):
        at = np.flatnonzero(number == each)
        own = {name: values[at] for name, values in inputs.items()}
        yield FinishedRuns(np.arange(len(at)), own, select_results(whole, at))


def input_columns(runs: xr.Dataset, model: Model) -> dict[str, FloatArray]:
    """Return the inputs of a model that archived runs have, each a value a run."""
    size = runs.sizes[RUN]
    return {
        variable.name: np.broadcast_to(runs.variables[variable.name].values, size)
        for variable in model.inputs
        if variable.name in runs
    }


def _has_output(runs: xr.Dataset, output: Output) -> bool:
    """Check that runs have an output along the dimensions and coordinates of the model's."""
    if output.name not in runs:
        return False
    if runs[output.name].dims != (RUN, *(dim.name for dim in output.dims)):
        return False
    return all(np.array_equal(runs[dim.name].values, dim.values) for dim in output.dims)


def _values(runs: xr.Dataset, output: Output) -> FloatArray:
    """Return the values of an output as a model returns them."""
    values = runs[output.name].values.astype(np.float64, copy=False)
    # A failed run has a category of its own there.
    return np.where(values < 0, np.nan, values) if output.categories else values
