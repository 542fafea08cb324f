"""Making some runs again before all of them are taken: they have to be the same."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.checkpoints.folder import CheckpointFolder
from uqpen.checkpoints.identity import compared_names
from uqpen.checkpoints.journal import Journal, run_seconds, seconds_at_last_pace
from uqpen.checkpoints.sources import (
    SET_ASIDE,
    ArchivePlace,
    Place,
    RunFinder,
    RunSource,
    archived_sources,
    by_inputs,
    shown_path,
)
from uqpen.checkpoints.stored_runs import FinishedRuns
from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.errors import CheckpointError
from uqpen.core.labels import BATCH_HASH, FAILED_RUN, FAILURE_REASON, RUN, RUNS, STATUS
from uqpen.core.model import Model
from uqpen.core.status import BY_MACHINE, STATUS_TEXT, Status, mask_numbers
from uqpen.core.streams import Stream
from uqpen.execution import (
    EvaluationOptions,
    Evaluator,
    FailurePolicy,
    Map,
    evaluate,
    run_count,
    status_counts,
)
from uqpen.execution.batch import BatchResult
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.omitted_runs import are_omitted
from uqpen.models.source import BuiltInModel
from uqpen.results.digits import grouped_number
from uqpen.results.texts import duration_text
from uqpen.study.identity import StudyIdentity, depends_on_batch
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.repetition import (
    TOLERANCE,
    Difference,
    NoReports,
    hashes_again,
    run_differences,
    unequal,
)

# As many runs are made again as take so long, in seconds.
_AT_MOST = 1.0

# The first of them is made alone; each further part has at most so many times more.
_GROWTH = 32

# No run is made again that takes longer, in seconds: where others are made, too, and where none is.
_COSTLY, _COSTLY_ALONE = 60.0, 10.0

# A longer one is made again if it takes this share of the time of those that are made anyway.
_SHARE = 0.01

_MOST_NAMED = 4

_NOISE = "its model gives other results for the same inputs"
_REMEDY = "if it has noise of its own, say so by noise = true in [model], or give its runs a seed"
_UNSEEDED = "its model has noise of its own and no seed: each run is another one"
_CHANGE = (
    "the model has changed in a way that its files do not show, or its results depend on the "
    "order of its runs"
)

_Sources = Mapping[str, Sequence[RunSource]]

# As many as a batch has: they meet a change of 1 % of the inputs' space for sure.
_MOST = 1024

# Of very many runs, so many are sorted to bound the lowest values of all.
_SOME = 8192


class RecheckOutcome(NamedTuple):
    """Outcome of making runs again."""

    is_refused: bool = False  # true if none of the runs may be taken
    is_unchecked: bool = False  # true if none was made again, and they may be taken nevertheless


class Recheck:
    """Making of runs again that a study would take.

    Parameters
    ----------
    study, identity : ValidatedStudy, StudyIdentity
        The study, and what decides its runs.
    wanted : bool or None
        Whether runs are made again; None for all but costly ones.
    map : callable
        Like the built-in; it makes the runs.
    journal : Journal
        Receives a line on each place of runs.
    """

    def __init__(
        self,
        study: ValidatedStudy,
        identity: StudyIdentity,
        wanted: bool | None,
        map: Map,
        journal: Journal,
    ) -> None:
        self.study, self.identity = study, identity
        self._wanted, self._map, self._journal = wanted, map, journal
        self._outcomes: dict[tuple[str, str], RecheckOutcome] = {}

    def applies(self, name: str) -> bool:
        """Check for a model whose runs are made again: no built-in one, and no data file.

        An archive has the hash of the whole source of a built-in model.
        """
        model = self.study.models[name].model
        return not (isinstance(model, BuiltInModel) or model.uncallable_reason)

    def look(
        self,
        name: str,
        place: Place,
        sources: Sequence[RunSource],
        left: int | None = None,
        omitted: Mapping[str, xr.Dataset] | None = None,
    ) -> RecheckOutcome:
        """Make some of the runs of a model again, once for each place, and compare them.

        Parameters
        ----------
        left : int or None
            Number of runs that the study makes anyway; None if it makes none.
        omitted : mapping of str to Dataset, optional
            Designs whose runs an archive has not kept, but hashes of them.

        Raises
        ------
        CheckpointError
            If they are needed, and cannot be taken; it states the difference.
        KeyboardInterrupt
            With a text for the user.
        """
        key = (place.name, name)
        if key not in self._outcomes:
            try:
                self._outcomes[key] = self._look(name, place, sources, left, omitted or {})
            except KeyboardInterrupt:
                text = "all finished runs are kept; the same command continues from there"
                raise KeyboardInterrupt(text) from None
        return self._outcomes[key]

    def _look(
        self,
        name: str,
        place: Place,
        sources: Sequence[RunSource],
        left: int | None,
        omitted: Mapping[str, xr.Dataset],
    ) -> RecheckOutcome:
        if not self.applies(name):
            return RecheckOutcome()
        model = self.study.models[name].model
        if model.noise.is_unseeded:
            self._inform(name, place, sources, f"no run is made again, as {_UNSEEDED}")
            return RecheckOutcome(is_unchecked=True)
        generator = Stream(self.study.seed, "recheck", name).generator()
        chosen = choose_runs(model, sources, generator)
        # Of runs that are not kept, those of a design of which none may have ended by the machine.
        kept_none = (
            (design, runs)
            for design, runs in omitted.items()
            if not any(status_counts(runs).get(status, 0) for status in BY_MACHINE)
        )
        design, hashed = (None if chosen else next(kept_none, None)) or ("", None)
        comparison: _Comparison | _HashComparison
        if chosen:
            comparison = _Comparison(self.study, place, sources, chosen, self._map)
            seconds = run_seconds(place.log, name)
        elif hashed is not None:
            comparison = _HashComparison(self.study, name, design, hashed, generator, self._map)
            seconds = seconds_at_last_pace(place.log, comparison.compared, design)
        else:
            return RecheckOutcome()
        if reason := self._reason_against(seconds, left, place.log):
            self._inform(name, place, sources, f"no run is made again, {reason}")
            return RecheckOutcome(is_unchecked=True)
        self._journal.start_preparation(model.name)
        with tempfile.TemporaryDirectory(prefix="uqpen-") as folder:
            # The folders of runs that are kept stay as they are.
            own = model.with_folder(Path(folder))
            own.prepare()
            self._journal.start_step("making finished runs again, for comparison")
            refusal = comparison.make(own, seconds)
        if refusal:
            self._refuse(name, place, refusal)
            return RecheckOutcome(is_refused=True)
        if not comparison.compared:
            reason = "those made again timed out or crashed, which depends on the machine"
            self._inform(name, place, sources, f"no run is compared: {reason}")
            return RecheckOutcome(is_unchecked=True)
        made, total = map(grouped_number, (comparison.compared, comparison.total))
        verb = "are" if comparison.compared > 1 else "is"
        text = f"{made} of {total} runs made again {verb} equal{comparison.tolerance_text}"
        self._inform(name, place, sources, text)
        return RecheckOutcome()

    def _refuse(self, name: str, place: Place, refusal: str) -> None:
        """Say, or raise, why runs cannot be taken."""
        where = f"{place.name}: {name}" if name else place.name
        remedies = [place.remedy, *([_REMEDY] if refusal.startswith(_NOISE) else [])]
        text = "\n".join([f"{where}: its runs are not taken: {refusal}", *remedies])
        if place.are_needed:
            raise CheckpointError(text)
        self._journal.inform(text)

    def _reason_against(self, seconds: float | None, left: int | None, log: Path) -> str:
        """Return the reason for making no run again; empty if there is none."""
        if self._wanted is not None:
            return "" if self._wanted else "as asked by --no-recheck"
        if seconds is None or seconds <= (_COSTLY_ALONE if left is None else _COSTLY):
            return ""
        if left is not None:
            # The workers of the others wait meanwhile.
            others = seconds_at_last_pace(log, left)
            if seconds <= _SHARE * (left * seconds if others is None else others):
                return ""
        return f"as that takes {duration_text(seconds)}; --recheck makes one nevertheless"

    def _inform(self, name: str, place: Place, sources: Sequence[RunSource], text: str) -> None:
        """Say what was compared, and how."""
        lines = frozenset[str]().union(*(each.runs.results.files for each in sources))
        same, uncompared = compared_names(self.identity.models[name], lines)
        others = f"not compared: {', '.join(uncompared)}" if uncompared else ""
        said = "; ".join(filter(None, [_same_text(same), text, others]))
        self._journal.inform(f"{place.name}: {name}: {said}" if name else f"{place.name}: {said}")


class _Comparison:
    """Comparison of chosen runs with those that are made in their place."""

    def __init__(
        self,
        study: ValidatedStudy,
        place: Place,
        sources: Sequence[RunSource],
        chosen: ChosenRuns,
        map: Map,
    ) -> None:
        self._place, self._sources, self._chosen = place, sources, chosen
        retries = FailurePolicy(study.failures.retry, stop_after=0, trial=False)
        self._options = EvaluationOptions(map=map, progress=NoReports(), failures=retries)
        self.compared, self.total = 0, chosen.total
        is_same = chosen.is_whole and not any(each.made_with for each in sources)
        self._tolerance = 0.0 if is_same else TOLERANCE
        self._differs_at_all = False
        self._designs = ", ".join(filter(None, chosen.designs)) or "its runs"

    @property
    def tolerance_text(self) -> str:
        """Text on the distance of runs that are not equal to the bit."""
        return f" within {TOLERANCE:g}" if self._differs_at_all else ""

    def make(self, model: Model, seconds: float | None) -> str:
        """Make runs for about a second; return why all runs are refused, empty if they are not."""
        # The model itself is run: points that a constraint excludes since were admissible.
        self._model, self._evaluator = model, Evaluator(model)
        finished = EvaluationOptions(checkpoint=_Finished(self._chosen), progress=NoReports())
        runs = self._chosen.runs
        self._finished = evaluate(self._evaluator, _points(runs.inputs, runs.runs), {}, finished)
        for at in self._parts(seconds):
            again = self._make(at)
            own = self._comparable(at, again)
            reason = self._other_ending(at, own, again)
            if not reason:
                words = (f"in {self._place.name}", "now")
                made = self._finished.isel({RUN: at[own]})
                found = self._differences(made, again.isel({RUN: own}), words)
                self._differs_at_all |= bool(found)
                if found and found[0].relative > self._tolerance:
                    reason = found[0].what
            if reason:
                return self._refusal(at, own, again, reason)
            self.compared += own.size
        return ""

    def _comparable(self, at: IntArray, again: xr.Dataset) -> IntArray:
        """Return the positions of the runs that are compared: none that ended by the machine."""
        is_compared = self._chosen.runs.results.status[at] == self._chosen.status
        return np.flatnonzero(is_compared & ~np.isin(again[STATUS].values, BY_MACHINE))

    def _parts(self, seconds: float | None) -> Iterator[IntArray]:
        """Yield the runs that are made at once; their pace decides how many take a second."""
        every = np.arange(len(self._chosen.runs.runs))
        if self._chosen.is_batch:
            yield every
            return
        began, done, size = time.monotonic(), 0, 1
        while size and done < len(every):
            yield every[done : done + size]
            done = min(done + size, len(every))
            if done == 1 and seconds is not None and seconds < _AT_MOST:
                began = time.monotonic()  # it has waited for what later ones find ready
                size = min(_GROWTH, int(_AT_MOST / max(seconds, 1e-6)))
                continue
            spent = max(time.monotonic() - began, 1e-6)
            size = min(_GROWTH * size, int(done / spent * max(_AT_MOST - spent, 0.0)))

    def _make(self, at: IntArray) -> xr.Dataset:
        inputs = {name: values[at] for name, values in self._chosen.runs.inputs.items()}
        points = _points(inputs, self._chosen.runs.runs[at])
        return evaluate(self._evaluator, points, {}, self._options)

    def _other_ending(self, at: IntArray, own: IntArray, again: xr.Dataset) -> str:
        """Return how a run has another status or reason now; empty if none has."""
        before, statuses = self._finished[STATUS].values, again[STATUS].values
        reasons_before, reasons = _reasons(self._finished), _reasons(again)
        is_ok = (before[at[own]] == Status.OK) & (statuses[own] == Status.OK)
        for position in own[~is_ok].tolist():
            run = int(at[position])
            then, now = Status(int(before[run])), Status(int(statuses[position]))
            said, says = reasons_before.get(run, ""), reasons.get(position, "")
            if then is not now or mask_numbers(said) != mask_numbers(says):
                was, is_now = (
                    f"{STATUS_TEXT[status]} ({reason})" if reason else STATUS_TEXT[status]
                    for status, reason in ((then, said), (now, says))
                )
                name = f"{self._designs}: run {self._chosen.runs.runs[run]}"
                return f"{name} was {was}, and is {is_now} now"
        return ""

    def _refusal(self, at: IntArray, own: IntArray, again: xr.Dataset, reason: str) -> str:
        """Return why runs are refused that have become others; they are made once more."""
        other = self._make(at)
        own = np.intersect1d(own, self._comparable(at, other))
        words = ("at first", "when it is made once more")
        if noise := self._differences(again.isel({RUN: own}), other.isel({RUN: own}), words):
            return f"{_NOISE}:\n  {noise[0].what}"
        return f"{reason}\n  {_CHANGE}"

    def _differences(
        self, one: xr.Dataset, other: xr.Dataset, words: tuple[str, str]
    ) -> list[Difference]:
        """Return the differences of runs, the largest first."""
        outputs = self._model.all_outputs
        names = [STATUS, *(output.name for output in outputs)]
        if not any(unequal(one[name].values, other[name].values).any() for name in names):
            return []
        scales = self._scales() if self._tolerance else {}
        found = run_differences(self._designs, one, other, outputs, scales, words)
        return sorted(found, key=lambda each: -each.relative)

    def _scales(self) -> dict[str, float]:
        """Return the largest value of each output among all runs that would be taken."""
        largest: dict[str, float] = {}
        for source in self._sources:
            is_ok = source.runs.results.status == Status.OK
            for name, values in source.runs.results.outputs.items():
                finite = values[is_ok][np.isfinite(values[is_ok])]
                found = float(np.abs(finite).max(initial=0.0))
                largest[name] = max(largest.get(name, 0.0), found)
        return largest


class _HashComparison:
    """Comparison of the hash of a batch of runs that an archive has not kept."""

    tolerance_text = ""

    def __init__(
        self,
        study: ValidatedStudy,
        name: str,
        design: str,
        runs: xr.Dataset,
        generator: np.random.Generator,
        map: Map,
    ) -> None:
        self._study, self._name, self._design, self._map = study, name, design, map
        hashes = runs[BATCH_HASH].values
        self._number = int(generator.integers(hashes.size))
        self._sha256, self.total = str(hashes[self._number]), run_count(runs)
        self._start = self._number * BATCH_SIZE
        self.compared = min(BATCH_SIZE, self.total - self._start)

    def make(self, model: Model, seconds: float | None) -> str:
        """Make the batch again; return why all runs are refused, empty if they are not."""
        arguments = (
            self._study,
            self._name,
            model,
            self._design,
            self.total,
            [self._number],
            self._map,
        )
        again = next(sha256 for _, sha256 in hashes_again(*arguments, NoReports()))
        if again == self._sha256:
            return ""
        if again != next(sha256 for _, sha256 in hashes_again(*arguments, NoReports())):
            return _NOISE
        runs = f"runs {self._start} to {self._start + self.compared - 1}"
        return f"{self._design}: {runs} are others now\n  {_CHANGE}"


class _Finished(Checkpoint):
    """Checkpoint that has all runs, so that none is made."""

    def __init__(self, chosen: ChosenRuns) -> None:
        self._results = chosen.runs.results

    def prepare(self, runs: int) -> int:
        return runs

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        yield BatchResult(start, self._results)


def _points(inputs: Arrays, runs: IntArray) -> xr.Dataset:
    columns = {name: (RUN, values) for name, values in inputs.items()}
    return xr.Dataset(columns, {RUN: runs})


def _reasons(runs: xr.Dataset) -> dict[int, str]:
    """Return the reasons of failed runs by position."""
    if FAILED_RUN not in runs:
        return {}
    reasons = map(str, runs[FAILURE_REASON].values.tolist())
    return dict(zip(runs[FAILED_RUN].values.tolist(), reasons, strict=True))


def _same_text(names: Sequence[str]) -> str:
    """Return a text on files that are the same; empty for none.

    >>> _same_text(["m.py", "k.csv"])
    'm.py and k.csv are the same'
    """
    more = len(names) - _MOST_NAMED
    listed = [*names[:_MOST_NAMED], *([f"{more} more files"] if more > 0 else [])]
    if not listed:
        return ""
    joined = " and ".join(filter(None, [", ".join(listed[:-1]), listed[-1]]))
    return f"{joined} {'are' if len(listed) > 1 else 'is'} the same"


def is_as_made(recheck: Recheck, archive: ArchivePlace) -> bool:
    """Check that some runs of an archive of this very study are the same when made again."""
    outcomes = []
    study = recheck.study
    for name in filter(recheck.applies, study.models):
        found = archived_sources(study, name, archive, first_blocks=True)
        group = model_trees(archive.tree)[name]
        designs = {design: read_group(group, RUNS, design) for design in group_names(group, RUNS)}
        omitted = {design: runs for design, runs in designs.items() if are_omitted(runs)}
        outcomes.append(recheck.look(name, archive, found, omitted=omitted))
    return not any(each.is_refused for each in outcomes)


def runs_that_are_as_made(
    recheck: Recheck,
    sources: _Sources,
    archives: Sequence[ArchivePlace],
    finished: CheckpointFolder,
    journal: Journal,
) -> RunFinder:
    """Return the finished runs that a study may take; of those in each place, some are made again.

    They are made again only where one of a design's first points has a run.

    Parameters
    ----------
    sources : mapping of str to sequence of RunSource
        The sources of runs by the name of a model.
    finished : CheckpointFolder
        The finished runs beside the archive.
    journal : Journal
        Receives the numbers of runs that are taken.

    Raises
    ------
    CheckpointError
        If runs of the folder, or of an archive that the user has named, differ.
    """
    study = recheck.study
    # Where versions cannot be distinguished, no runs of the study's own designs were kept.
    names = [] if recheck.identity.unknown else [*filter(recheck.applies, study.models)]
    parts = {name: found for name in names if (found := finished.part_sources(name))}
    planned = sum(study.design_runs(design) for design in study.designs)
    left = {name: planned - _count(parts.get(name, ())) - _count(sources[name]) for name in sources}
    log = finished.folder.with_suffix(".log")
    folder, set_aside = (
        Place(shown_path(each), log) for each in (finished.folder, finished.folder / SET_ASIDE)
    )
    unchecked = [
        (name, source.design)
        for name, own in parts.items()
        if recheck.look(name, folder, own, left[name]).is_unchecked
        for source in own
    ]
    places = {archive.name: archive for archive in archives}
    while True:
        finder = RunFinder(study, sources, journal)
        refused = set()
        for name, place in finder.used_places():
            own = [each for each in sources[name] if each.place == place]
            outcome = recheck.look(name, places.get(place, set_aside), own, left[name])
            if outcome.is_unchecked:
                finder.mark_not_made_again(name, place)
            if outcome.is_refused:
                refused.add((name, place))
        if not refused:
            break
        sources = {
            name: [each for each in found if (name, each.place) not in refused]
            for name, found in sources.items()
        }
    for name, design in unchecked:
        finder.record_not_made_again(design, name)
    return finder


def _count(sources: Sequence[RunSource]) -> int:
    return sum(len(each.runs.runs) for each in sources)


class ChosenRuns(NamedTuple):
    """Finished runs that are made again, in this order."""

    runs: FinishedRuns  # the runs
    status: Status  # the runs with this status are compared
    is_batch: bool  # true if they have to be made together
    # True if they are known to have been made as they will be now, in the same batch.
    is_whole: bool
    designs: tuple[str, ...]  # the designs that they are of
    total: int  # the number of runs from which they are chosen


def choose_runs(
    model: Model, sources: Sequence[RunSource], generator: np.random.Generator
) -> ChosenRuns | None:
    """Choose up to 1 024 runs, those that are ok; where none is, one that failed.

    Of a model whose results may depend on the batch, it is a batch with many extremes. There are
    none (None) among runs that are inadmissible, or that failed as it depends on the machine.

    Parameters
    ----------
    model : Model
        The model of the runs.
    generator : numpy.random.Generator
        Draws the runs that are no extremes.
    """
    alike = by_inputs(model, sources).values()
    if not alike:
        return None
    # Models of one study may be given other inputs; most runs have the same ones.
    of_one_kind = max(
        alike,
        key=lambda own: sum(int((each.runs.results.status == Status.OK).sum()) for each in own),
    )
    joined = FinishedRuns.joined([each.runs for each in of_one_kind])
    statuses = joined.results.status
    # A run that failed by its model has to fail again.
    in_turn = (Status.OK, Status.FAILED, Status.NOT_FINITE)
    status = next((each for each in in_turn if (statuses == each).any()), None)
    if status is None:
        return None
    at = np.flatnonzero(statuses == status)
    order = at[order_runs({name: each[at] for name, each in joined.inputs.items()}, generator)]
    starts = np.cumsum([0, *(len(each.runs.runs) for each in of_one_kind)])
    is_batch, is_whole = depends_on_batch(model), True
    if is_batch:
        # The batch that has most of these runs, whole ones first.
        is_chosen = np.isin(np.arange(len(statuses)), order)
        batches = [
            (is_whole, int(is_chosen[start + batch].sum()), start + batch)
            for start, source in zip(starts, of_one_kind, strict=False)
            for batch, is_whole in _batches(source)
        ]
        batches = [
            each for each in batches if each[1] and not np.isin(statuses[each[2]], BY_MACHINE).any()
        ]
        if not batches:
            return None
        is_whole, _, order = max(batches, key=lambda each: each[:2])
        # A model does not get the inadmissible points of a batch.
        order = order[statuses[order] != Status.INADMISSIBLE]
    elif status is not Status.OK:
        order = order[:1]
    used = np.unique(np.searchsorted(starts, order, side="right") - 1).tolist()
    designs = tuple(dict.fromkeys(of_one_kind[each].design for each in used))
    return ChosenRuns(joined.select(order), status, is_batch, is_whole, designs, len(statuses))


def order_runs(columns: Arrays, generator: np.random.Generator) -> IntArray:
    """Return positions of runs by turns: those at the ends of each input, and random ones.

    Returns
    -------
    ndarray of int
        At most 1 024, each once. The first few of them are a choice of fewer runs.
    """
    size = len(next(iter(columns.values())))
    varied = [values for values in columns.values() if (values != values[0]).any()]
    each = -(-_MOST // (4 * max(len(varied), 1)))
    ends = [_lowest(sign * values, each) for values in varied for sign in (1.0, -1.0)]
    drawn = generator.choice(size, min(_MOST, size), replace=False)
    extremes = np.stack(ends, axis=1).ravel()[: len(drawn)] if ends else drawn
    turns = np.concatenate(
        [np.stack([extremes, drawn[: len(extremes)]], axis=1).ravel(), drawn[len(extremes) :]]
    )
    _, first = np.unique(turns, return_index=True)
    return np.asarray(turns[np.sort(first)][:_MOST], dtype=np.int64)


def _lowest(values: FloatArray, number: int) -> IntArray:
    """Return the positions of the lowest values, in ascending order."""
    number = min(number, len(values))
    # A value of some of them bounds the lowest of all, which are then a few.
    some = np.sort(values[:: len(values) // _SOME + 1])
    at = np.flatnonzero(values <= some[min(number, len(some) - 1)])
    return np.asarray(at[np.argsort(values[at], kind="stable")][:number], dtype=np.int64)


def _batches(source: RunSource) -> Iterator[tuple[IntArray, bool]]:
    """Yield the positions of the runs of each batch, and whether it is known to be whole."""
    whole = [*source.whole_batches()]
    yield from ((batch, True) for batch in whole)
    if not whole:
        # The last batch of a round may have fewer, and so has one whose runs were discarded.
        numbers = source.runs.runs // BATCH_SIZE
        yield np.flatnonzero(numbers == numbers[-1]), False
