"""Places of finished runs, and the run of a point among them."""

from __future__ import annotations

import hashlib
import tomllib
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.hashes import group_hashes, recorded_hashes
from uqpen.archive.provenance import provenance_differences
from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group, read_tree
from uqpen.archive.structure import find_faults
from uqpen.checkpoints.identity import (
    ModelComparison,
    compare_models,
    list_changes,
)
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.stored_runs import (
    FinishedRuns,
    select_results,
)
from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.blocks import LoadedDataset
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
from uqpen.core.status import BY_MACHINE, Status
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.rounds import first_round
from uqpen.distributions.constraints import Constraint
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.omitted_runs import are_omitted
from uqpen.execution.seeds import Occurrences
from uqpen.study.identity import StudyIdentity, archived_identity, depends_on_batch
from uqpen.study.study import ValidatedStudy

# Folder, beside those of designs, of finished runs that belong to none: they are found by their
# inputs alone. Settings of their design have changed since, or they were made to try a model.
SET_ASIDE = "set_aside"

_NEVERTHELESS = "take them nevertheless with --no-recheck"


@dataclass(frozen=True)
class Place:
    """Place of finished runs: a folder beside the archive that is made."""

    name: str  # its path, for display
    log: Path  # the log of the making of its runs

    @property
    def are_needed(self) -> bool:
        """True if it is an error if none of its runs can be taken."""
        return True

    @property
    def remedy(self) -> str:
        """Advice to the user if none of its runs is taken."""
        return f"continue with the model as it was, {_NEVERTHELESS}, or start over with --fresh"


@dataclass(frozen=True)
class ArchivePlace(Place):
    """Archive of an earlier study, as a place of finished runs."""

    tree: xr.DataTree  # its content
    identity: StudyIdentity  # what it says of what decided it
    is_named: bool  # true if the user has named it
    # Its models by name, compared with those of the study; by the name of the study's model.
    comparisons: Mapping[str, Mapping[str, ModelComparison]]
    changed_designs: frozenset[str]  # names of the designs that its study has with other settings
    made_with: str  # what it was made with, in words

    @property
    def are_needed(self) -> bool:
        """True if it is an error if none of its runs can be taken."""
        return self.is_named

    @property
    def remedy(self) -> str:
        """Advice to the user if none of its runs is taken."""
        leave_out = "leave it out to make all runs, or " if self.is_named else ""
        return f"{leave_out}{_NEVERTHELESS}"


@dataclass(frozen=True)
class RunSource:
    """Finished runs of a model in one round of a design."""

    place: str  # where they are kept, for display
    runs: FinishedRuns  # the runs, with their numbers in the round, ascending and each once
    is_complete: bool  # true if they are all runs of the round
    # What they were made with, where that is not as it is here, in words.
    made_with: tuple[str, ...] = ()
    folder: Path | None = None  # their folder, if they are in no archive
    changed_design: str = ""  # name of their design, if the study has it with other settings
    design: str = ""  # name of their design; empty if they have none

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


def open_archives(
    study: StudyIdentity, replaced: Path, named: Sequence[str | Path], journal: Journal
) -> list[ArchivePlace]:
    """Read the archive that is replaced, if it can be used, and those that the user has named.

    Their models are compared with those of the study.

    Raises
    ------
    ArchiveError
        If one that is named cannot be read, or is no archive of a study.
    """
    found = []
    wanted = [path for path in map(Path, named) if path.resolve() != replaced.resolve()]
    for path in [*wanted, *([replaced] if replaced.exists() else [])]:
        try:
            found.append(_open_archive(study, path, is_named=path in wanted))
        except ArchiveError as error:
            if path in wanted:
                raise
            reason = str(error).removeprefix(f"{replaced}: ")
            journal.inform(f"{shown_path(replaced)}: none of its runs is taken: {reason}")
    return sorted(found, key=lambda each: each.is_named)


def _open_archive(study: StudyIdentity, path: Path, *, is_named: bool) -> ArchivePlace:
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
        before = tomllib.loads(str(tree.attrs["study_text"])).get("designs", {})
    except (ValueError, RecursionError) as error:
        raise ArchiveError(f"{path}: is damaged: the text of its study: {error}") from None
    if is_benchmark(tree):
        raise ArchiveError(f"{path}: is the archive of a benchmark, which has no runs of a study")
    log = path.absolute().with_name(f"{path.name}.log")
    identity = archived_identity(tree)
    comparisons = {
        name: {archived: compare_models(model, its) for archived, its in identity.models.items()}
        for name, model in study.models.items()
    }
    now = study.content.get("designs", {})
    changed = frozenset(name for name in before.keys() & now.keys() if before[name] != now[name])
    differences = provenance_differences(tree.attrs, study.attributes)
    texts = ", ".join(f"{what} {one} (here {other})" for what, one, other in differences)
    made_with = (
        f"study {str(tree.attrs['study_sha256'])[:16]}, made with "
        f"{texts or 'the same versions and kind of processor as here'}"
    )
    return ArchivePlace(
        shown_path(path), log, tree, identity, is_named, comparisons, changed, made_with
    )


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
            own = archived_sources(study, name, archive)
            sources += own
            runs += sum(len(source.runs.runs) for source in own)
            if not own:
                # Those of the model of the same name, if there is one.
                compared = archive.comparisons[name]
                changes += (compared.get(name) or next(iter(compared.values()))).changes
        if runs:
            journal.write_line(f"{archive.name}: {archive.made_with}")
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


def shown_path(path: Path) -> str:
    """Return a path as short as it can be written here."""
    path = path.absolute()
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


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
) -> list[RunSource]:
    """Return the runs of an archive that are runs of a model; none if it has changed.

    Of a design with very many runs there is none, or the first block only.

    Parameters
    ----------
    study, name
        The study, and the name of its model.
    first_blocks : bool
        Whether designs with very many runs have their first block.
    """
    tree = archive.tree
    # The model of the same name first.
    archived = sorted(archive.comparisons[name].items(), key=lambda each: each[0] != name)
    found = []
    for model, comparison in archived:
        left_out = [] if comparison.is_same_limit else [Status.TIMED_OUT]
        left_out += [] if comparison.is_same_domain else [Status.INADMISSIBLE]
        group = model_trees(tree)[model]
        for design in () if comparison.changes else group_names(group, RUNS):
            runs = read_group(group, RUNS, design)
            is_whole = runs.sizes[RUN] <= RUNS_IN_MEMORY
            if not is_whole and not first_blocks:
                continue  # they are found by their inputs, for which all have to be in memory
            found += [
                RunSource(
                    archive.name,
                    each,
                    is_complete=is_whole,
                    made_with=(*comparison.made_with, *_inherited(tree, model, design)),
                    changed_design=design if design in archive.changed_designs else "",
                    design=design,
                ).without_statuses(left_out)
                for each in _archived_rounds(
                    runs if is_whole else runs.isel({RUN: slice(BLOCK)}),
                    study.models[name].model,
                    comparison.dependencies,
                )
            ]
    return [*filter(None, found)]


def _inherited(tree: xr.DataTree, model: str, design: str) -> Iterator[str]:
    """Yield what an archive says of runs of a design that it has taken from others."""
    label = f"{model}: {design}: " if model else f"{design}: "
    for line in str(tree.attrs.get(REUSED_RUNS, "")).split("\n"):
        # Whether they are made again is decided wherever they are taken.
        if line.startswith(label) and not line.endswith(NOT_MADE_AGAIN):
            yield line.removeprefix(label)


def _archived_rounds(
    runs: xr.Dataset, model: Model, dependencies: frozenset[str]
) -> Iterator[FinishedRuns]:
    """Yield the runs of each round of a design; none if a variable is not as the model has it."""
    inputs = input_columns(runs, model)
    for output in model.outputs:
        dims = (RUN, *(dim.name for dim in output.dims))
        if output.name not in runs or runs[output.name].dims != dims:
            return
        if not all(np.array_equal(runs[dim.name].values, dim.values) for dim in output.dims):
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
        name: np.broadcast_to(runs.variables[name].values, size)
        for name in model.run_inputs
        if name in runs
    }


def _values(runs: xr.Dataset, output: Output) -> FloatArray:
    """Return the values of an output as a model returns them."""
    values = runs[output.name].values.astype(np.float64, copy=False)
    # A failed run has a category of its own there.
    return np.where(values < 0, np.nan, values) if output.categories else values


_LOST_BY_MACHINE = "runs that timed out or crashed in an earlier study"

_Hashes = npt.NDArray[np.uint64]

# Odd, with its bits spread: a multiplication moves each bit of an input into the higher ones.
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(29)


def by_inputs(model: Model, sources: Iterable[RunSource]) -> dict[frozenset[str], list[RunSource]]:
    """Return sources of runs by those inputs of a model that their runs were given."""
    names = set(model.run_inputs)
    found: dict[frozenset[str], list[RunSource]] = {}
    for source in sources:
        inputs = {name: each for name, each in source.runs.inputs.items() if name in names}
        own = replace(source, runs=replace(source.runs, inputs=inputs))
        found.setdefault(frozenset(inputs), []).append(own)
    return found


# Of a model with noise and no seed, a run is one of those at its point, and of its design. It
# stands for one of the points there, never for two: this column has its number among equal ones.
_OCCURRENCE = "\0occurrence"


def _numbered(model: Model, sources: Iterable[RunSource]) -> dict[frozenset[str], list[RunSource]]:
    """Return sources as `by_inputs` does, by the name of their design as well, and numbered."""
    found: dict[frozenset[str], list[RunSource]] = {}
    counts: dict[tuple[object, ...], Occurrences] = {}
    for inputs, own in by_inputs(model, sources).items():
        for source in own:
            count = counts.setdefault((source.place, source.folder, source.design), Occurrences())
            columns = {**source.runs.inputs, _OCCURRENCE: count.numbers(source.runs.inputs)}
            numbered = replace(source, runs=replace(source.runs, inputs=columns))
            found.setdefault(inputs | {_design_key(source.design)}, []).append(numbered)
    return found


def _design_key(design: str) -> str:
    return f"\0design {design}"


class IndexedRuns:
    """Finished runs of a model that were given the same inputs, found by their values.

    Parameters
    ----------
    model : Model
        The model that the runs were made with.
    sources : sequence of RunSource
        One or more, the preferred ones first. All runs have the same inputs and outputs.
    constraints : sequence of Constraint
        Those of the study.
    """

    def __init__(
        self, model: Model, sources: Sequence[RunSource], constraints: Sequence[Constraint]
    ) -> None:
        self._model = model
        self.sources = sources
        self._constraints = constraints
        self._starts = np.cumsum([0, *(len(source.runs.runs) for source in sources)])
        self._is_used = np.zeros(self._starts[-1], dtype=np.bool_)

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of the run at each point, shape (run,); -1 where there is none.

        Of a model whose results may depend on the batch, only runs of whole batches are found. Runs
        at points that the constraints exclude are not.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            Consecutive points of a round in SI units.
        start, size : int
            Number of the first of them in its round, and of all points of the round.
        """
        at = self._index.find(inputs, start, size)
        is_admissible = np.ones(len(at), dtype=np.bool_)
        for constraint in self._constraints:
            is_admissible &= constraint.is_satisfied(inputs)
        is_wrong = ~is_admissible & (self._runs.results.status[at] != Status.INADMISSIBLE)
        return np.where(is_wrong, -1, at)

    def batch_results(self, start: int, at: IntArray) -> Iterator[BatchResult]:
        """Yield runs as batch results; the runs of each are consecutive.

        Parameters
        ----------
        start : int
            Number of the first point.
        at : ndarray of int, shape (run,)
            The position of the run at each point; -1 for none.
        """
        ends = np.flatnonzero(np.diff(at >= 0)) + 1
        for begin, end in pairwise([0, *ends.tolist(), len(at)]):
            if at[begin] >= 0:
                yield BatchResult(start + begin, select_results(self._runs.results, at[begin:end]))

    def use(self, at: IntArray) -> Iterator[tuple[RunSource, IntArray]]:
        """Record that runs are taken, given positions or -1; yield their sources and statuses."""
        at = at[at >= 0]
        self._is_used[at] = True
        numbers = self._source_numbers(at)
        for number in np.unique(numbers).tolist():
            yield self.sources[number], self._runs.results.status[at[numbers == number]]

    def sources_of(self, at: IntArray) -> list[RunSource]:
        """Return the sources of runs, given their positions or -1."""
        numbers = np.unique(self._source_numbers(at[at >= 0]))
        return [self.sources[number] for number in numbers.tolist()]

    def _source_numbers(self, at: IntArray) -> IntArray:
        return np.searchsorted(self._starts, at, side="right") - 1

    def used_up(self) -> Iterator[RunSource]:
        """Yield the sources all of whose runs have been taken."""
        for source, start in zip(self.sources, self._starts, strict=False):
            if self._is_used[start : start + len(source.runs.runs)].all():
                yield source

    @cached_property
    def _runs(self) -> FinishedRuns:
        return FinishedRuns.joined([source.runs for source in self.sources])

    @cached_property
    def _index(self) -> PointIndex | BatchIndex:
        if not depends_on_batch(self._model):
            return PointIndex(self._runs.inputs)
        batches = [
            start + batch
            for start, source in zip(self._starts, self.sources, strict=False)
            for batch in source.whole_batches()
        ]
        return BatchIndex(self._runs.inputs, batches, BATCH_SIZE)


class RunFinder:
    """Finished runs of the models of a study, and a record of those that it takes.

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
        self._indexed = {
            name: {
                inputs: IndexedRuns(model, own, study.constraints)
                for inputs, own in (
                    _numbered(model, found) if model.noise.is_unseeded else by_inputs(model, found)
                ).items()
            }
            for name, found in sources.items()
            for model in [study.models[name].model]
        }
        self._occurrences = defaultdict[tuple[str, str], Occurrences](Occurrences)
        self._made_with: set[str] = set()
        self._not_made_again: set[tuple[str, str]] = set()

    def checkpoint(self, own: Checkpoint, design: str, model: str) -> Checkpoint:
        """Return a checkpoint that restores these runs, too, of a model in a round of a design.

        `own` has the round's own runs, and gets those that are made.
        """
        return _ReusingCheckpoint(self, own, design, model) if self._indexed[model] else own

    def indexed_runs(
        self, model: str, inputs: Arrays, design: str, count: Occurrences | None = None
    ) -> tuple[IndexedRuns, Arrays] | None:
        """Return the runs of a model with those inputs that points have; None for none.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            The next points of a design.
        count : Occurrences, optional
            Count of the points so far; without it, that of the design as its runs are made.

        Returns
        -------
        runs : IndexedRuns
        inputs : mapping of str to ndarray, shape (run,)
            The inputs by which these find a run.
        """
        own = self._study.models[model].model
        names = frozenset(set(own.run_inputs).intersection(inputs))
        if own.noise.is_unseeded:
            count = self._occurrences[design, model] if count is None else count
            number = count.numbers({name: inputs[name] for name in names})
            inputs, names = {**inputs, _OCCURRENCE: number}, names | {_design_key(design)}
        found = self._indexed[model].get(names)
        return None if found is None else (found, inputs)

    def count(self, found: IndexedRuns, at: IntArray, design: str, model: str) -> None:
        """Record the runs that a design takes, given their positions."""
        label = f"{model}: {design}" if model else design
        for source, statuses in found.use(at):
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

    def used_places(self) -> Iterator[tuple[str, str]]:
        """Yield the models and the places from which runs at first points of a design come."""
        for model, found in self.sources.items():
            designs = self._study.designs if found else ()
            used = set[str]().union(*(self.places_of(model, design) for design in designs))
            places = dict.fromkeys(each.place for each in found)
            yield from ((model, place) for place in places if place in used)

    def places_of(self, model: str, design: str) -> set[str]:
        """Return the places of a model's runs that are at the first points of a design."""
        inputs = first_points(self._study, design, model)
        indexed = self.indexed_runs(model, inputs, design, Occurrences())
        if indexed is None:
            return set()
        found, inputs = indexed
        at = found.find(inputs, 0, len(next(iter(inputs.values()))))
        return {source.place for source in found.sources_of(at)}

    def used_folders(self) -> set[Path]:
        """Return the folders all of whose runs have been taken."""
        runs = [each for found in self._indexed.values() for each in found.values()]
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
    points = study.run_seeds(model).assigned(drawn.assign(study.models[model].given))
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    head = blocked.read(0, min(blocked.size, BLOCK))
    return {str(key): head[key].broadcast_like(head[RUN]).values for key in head.data_vars}


class _ReusingCheckpoint(Checkpoint):
    """Checkpoint of a round that also restores runs of other places."""

    def __init__(self, finder: RunFinder, own: Checkpoint, design: str, model: str) -> None:
        self._finder, self._own = finder, own
        self._design, self._model = design, model
        self._size = 0

    def prepare(self, runs: int) -> int:
        self._size = runs
        return self._own.prepare(runs)

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        indexed = self._finder.indexed_runs(self._model, inputs, self._design)
        if indexed is None:
            yield from self._own.restore(start, inputs)
            return
        found, columns = indexed
        at = found.find(columns, start, self._size)
        for batch_result in self._own.restore(start, inputs):
            first = batch_result.start - start
            at[first : first + len(batch_result)] = -1
            yield batch_result
        yield from found.batch_results(start, at)
        self._finder.count(found, at, self._design, self._model)

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        self._own.save(inputs, batch_result)

    def collect(self, blocks: Iterable[xr.Dataset], runs: int) -> xr.Dataset:
        return self._own.collect(blocks, runs)


class PointIndex:
    """Index of single points; of equal ones it finds the first.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (run,)
        The known points.
    """

    def __init__(self, inputs: Arrays) -> None:
        self._names = list(inputs)
        self._columns = _bits(inputs, self._names)
        hashes = _hashes(self._columns)
        self._order = np.argsort(hashes, kind="stable")
        self._hashes = hashes[self._order]

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of each point among the known ones, shape (run,); -1 for none.

        The arguments are as those of `IndexedRuns.find`.
        """
        columns = _bits(inputs, self._names)
        hashes = _hashes(columns)
        found = np.full(len(hashes), -1)
        # In ascending order a search takes a tenth of the time.
        left = np.argsort(hashes)
        place = np.empty(len(hashes), dtype=np.int64)
        place[left] = np.searchsorted(self._hashes, hashes[left])
        # Points of one hash stand side by side. They are nearly always equal.
        while left.size:
            left = left[place[left] < len(self._hashes)]
            left = left[self._hashes[place[left]] == hashes[left]]
            known = self._order[place[left]]
            is_equal = np.ones(len(left), dtype=np.bool_)
            for own, other in zip(self._columns, columns, strict=True):
                is_equal &= own[known] == other[left]
            found[left[is_equal]] = known[is_equal]
            left = left[~is_equal]
            place[left] += 1
        return found


class BatchIndex:
    """Index of whole batches, for a model whose results may depend on the batch.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (run,)
        The known points.
    batches : sequence of ndarray
        The positions of the points of each batch, in their order.
    size : int
        Number of points of a batch; the last one of a round may have fewer.
    """

    def __init__(self, inputs: Arrays, batches: Sequence[IntArray], size: int) -> None:
        self._names = list(inputs)
        self._size = size
        columns = _bits(inputs, self._names)
        self._batches: dict[bytes, IntArray] = {}
        for batch in batches:
            self._batches.setdefault(_digest([column[batch] for column in columns]), batch)

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of each point among the known ones, as `PointIndex.find` does."""
        columns = _bits(inputs, self._names)
        stop = start + len(columns[0])
        found = np.full(stop - start, -1)
        # A batch may begin in an earlier block, and end in a later one; such a one is not found.
        for first in range(start + -start % self._size, stop, self._size):
            end = min(first + self._size, size)
            if end > stop:
                break
            part = slice(first - start, end - start)
            batch = self._batches.get(_digest([column[part] for column in columns]))
            if batch is not None:
                found[part] = batch
        return found


def _bits(inputs: Arrays, names: Sequence[str]) -> list[_Hashes]:
    """Return the bits of each input as whole numbers: -0 is not 0."""
    return [np.ascontiguousarray(inputs[name], dtype=np.float64).view(np.uint64) for name in names]


def _hashes(columns: Sequence[_Hashes]) -> _Hashes:
    hashes = np.zeros_like(columns[0])
    for column in columns:
        hashes ^= column
        hashes *= _MULTIPLIER
        hashes ^= hashes >> _SHIFT
    return hashes


def _digest(columns: Sequence[_Hashes]) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for column in columns:
        digest.update(column.tobytes())
    return digest.digest()
