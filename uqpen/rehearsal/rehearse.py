"""Rehearsal of a study: from its surrogate and its runs to a dataset of coverages."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.benchmark.methods import BenchmarkStatistic, benchmark_statistics
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import CATALOGUE, MEASURES
from uqpen.core.errors import Problem, SettingsError, WorkerError, toml_text
from uqpen.core.interrupts import is_user_interrupt
from uqpen.core.labels import BOUND, BOUNDS, EQUAL, STATED
from uqpen.core.limits import Limits
from uqpen.core.model import Results
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.precision import Precision, Target
from uqpen.execution import Map, Progress
from uqpen.execution.batch import Batch, BatchResult
from uqpen.rehearsal.rehearsed_study import (
    RehearsedSource,
    RehearsedStudy,
    is_drawn,
    large_sample,
    run_once,
    study_sources,
    surrogate_truth,
    tail_record,
)
from uqpen.results.digits import grouped_number
from uqpen.results.texts import duration_text
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.study.study import ONLY_MODEL, ValidatedStudy

# With 1 000 repeats, a coverage of 95 % has a standard error of 0.7 points; with 200, of 1.5.
MOST_REPEATS, FEWEST_REPEATS = 1000, 200

# How long a rehearsal may take where nobody states a number of repeats.
SECONDS = 300.0

# Fewer repeats tell nothing, as the interval of a coverage of 100 % then begins below 69 %.
_FEWEST_STATED = 10

_FEWEST_COMPARED = 8


@dataclass(frozen=True)
class RehearsalSettings:
    """Settings of a rehearsal."""

    # Number of repeats; by default as many as take about `SECONDS`, from `FEWEST_REPEATS` to
    # `MOST_REPEATS`.
    repeats: int | None = None
    runs: int | None = None  # largest number of runs of the designs that are compared at equal runs
    draws: int = 2**18  # number of draws of the surrogate for its true statistics, a power of two

    def __post_init__(self) -> None:
        fewest = {"repeats": _FEWEST_STATED, "runs": _FEWEST_COMPARED}
        problems = [
            Problem((name,), toml_text(value), f"a whole number, at least {least}")
            for name, least in fewest.items()
            if (value := getattr(self, name)) is not None and value < least
        ]
        if problems:
            raise SettingsError(problems)

    def affordable_repeats(self, seconds: float) -> int:
        """Return the number of repeats, given the seconds that each takes."""
        if self.repeats is not None:
            return self.repeats
        affordable = math.floor(SECONDS / seconds) if seconds > 0 else MOST_REPEATS
        return min(max(affordable, FEWEST_REPEATS), MOST_REPEATS)


# Powers of two are fair to all designs.
_FEWEST_RUNS, MOST_RUNS = 64, 131_072

# The median half-width of so many repeats is known to a few per cent.
_REPEATS = 15


class SufficientRuns(NamedTuple):
    """Number of runs of a design after which an interval is as narrow as wanted."""

    target: str  # the wanted half-width in words
    design: str  # the name of the design
    # A power of two, or the most that the design makes of it; None where `MOST_RUNS` are too few.
    runs: int | None


def sufficient_runs(study: ValidatedStudy, rule: Precision) -> Iterator[SufficientRuns]:
    """Yield the number of runs that each design takes for each target.

    It is the first of doubled numbers at which the median half-width of repeats is at most as
    wanted.

    Parameters
    ----------
    study : ValidatedStudy
        With a surrogate as its only model.
    """
    known = {quantity.output.name for quantity in study.quantities_of_interest}
    targets = [target for target in rule.each_target() if target.output in known]
    for name, design in study.designs.items():
        if is_drawn(design) and _scaled(study, design, MOST_RUNS) is not None:
            for target, runs in _first_sufficient(study, name, design, targets).items():
                yield SufficientRuns(str(target), name, runs)


def _first_sufficient(
    study: ValidatedStudy, name: str, stated: Design, targets: list[Target]
) -> Mapping[Target, int | None]:
    found: dict[Target, int | None] = dict.fromkeys(targets)
    budget = _FEWEST_RUNS
    while budget <= MOST_RUNS and (missing := [each for each in targets if found[each] is None]):
        design = _scaled(study, stated, budget)
        if design is not None:
            excesses = [_excesses(study, name, design, missing, i) for i in range(_REPEATS)]
            for target, excess in zip(missing, np.median(excesses, axis=0), strict=True):
                if excess <= 1:
                    found[target] = design.run_count(study.joint)
        budget *= 2
    return found


def _scaled(study: ValidatedStudy, design: Design, runs: int) -> Design | None:
    return design.scaled(study.joint, runs, replicated=design.replicate_count > 1)


def _excesses(
    study: ValidatedStudy, name: str, design: Design, targets: list[Target], repeat: int
) -> list[float]:
    """Return the half-widths in one repeat, in parts of the wanted ones; infinite for none."""
    runs = design.run_count(study.joint)
    stream = Stream(study.seed, "rehearsal", "sufficient runs", name, runs, repeat)
    made = {ONLY_MODEL: run_once(study, design, stream)}
    quantities = {ONLY_MODEL: study.quantities_of_interest}
    feedback = Feedback(made, RunningEstimates((made,), design.sampling, quantities))
    found = [target.excess(feedback, ONLY_MODEL) for target in targets]
    return [np.inf if np.isnan(excess) else excess for excess in found]


# Repeats of a study as work for an executor: a batch is made of numbers of repeats.

_REPEAT, _RUNS, _ESTIMATES = "repeat", "runs", "estimates"


@dataclass(frozen=True)
class Repeat:
    """Estimates of one repeat of a study."""

    number: int  # its number, from 0
    runs: FloatArray  # (source,): number of runs of each source
    # (source, entry, bound): in SI units, the entries of all statistics one after the other; NaN
    # for none.
    estimates: FloatArray


@dataclass(frozen=True)
class RepeatWork:
    """Work of an executor: repeats of a study by all its sources."""

    study: ValidatedStudy  # of a single model, which costs next to nothing
    sources: tuple[RehearsedSource, ...]
    statistics: tuple[BenchmarkStatistic, ...]
    limits: Limits = Limits()
    is_untrusted: bool = False
    retries: int = 0

    @property
    def is_object(self) -> bool:
        """True if the model is an object of this process."""
        return self.study.model.is_object

    def __call__(self, batch: Batch) -> BatchResult:
        """Return the result of a batch of repeats."""
        made = [
            [source.estimates(self.study, int(number)) for source in self.sources]
            for number in batch.inputs[_REPEAT]
        ]
        runs = np.array([[runs for runs, _ in each] for each in made], dtype=np.float64)
        rows = [
            [
                np.concatenate([statistic.estimates(found) for statistic in self.statistics])
                for _, found in each
            ]
            for each in made
        ]
        return BatchResult(batch.start, Results.all_ok({_RUNS: runs, _ESTIMATES: np.array(rows)}))

    def failed_result(self, batch: Batch, status: Status, reason: str) -> BatchResult:
        """Raise an error: a repeat that kills its process says nothing of the intervals."""
        raise WorkerError(f"repeat {batch.start} has ended its process: {reason}")


def make_repeats(work: RepeatWork, numbers: range, map: Map) -> Iterator[Repeat]:
    """Make repeats of a study; yield each as it is done, in any order."""
    batches = (Batch(number, {_REPEAT: np.array([float(number)])}) for number in numbers)
    for done in map(work, batches):
        outputs = done.results.outputs
        for position in range(len(done)):
            estimates = outputs[_ESTIMATES][position]
            assert estimates.shape[-1] == len(BOUNDS)
            yield Repeat(done.start + position, outputs[_RUNS][position], estimates)


# Record of a rehearsal: the estimates of all repeats, and how often their intervals hold.

# An interval falls short where it holds less often than stated by more than this, beyond the noise.
# It is what the project allows its own intervals without a note.
_ALLOWED = 0.03


@dataclass(frozen=True)
class RepeatRecord:
    """Estimates along repeat, source, entry and bound."""

    estimates: FloatArray  # (repeat, source, entry, bound): in SI units; NaN where there is none
    run_counts: FloatArray  # (repeat, source): number of runs
    # (entry, bound): the true values; their bounds are of a sample, and NaN where they are exact.
    truth: FloatArray

    @classmethod
    def of(cls, repeats: Sequence[Repeat], truth: Sequence[FloatArray]) -> RepeatRecord:
        """Return the record of repeats in any order, with the truth of each statistic."""
        ordered = sorted(repeats, key=lambda repeat: repeat.number)
        estimates = np.stack([each.estimates for each in ordered])
        return cls(estimates, np.stack([each.runs for each in ordered]), np.concatenate(truth))

    @property
    def repeats(self) -> int:
        """Number of repeats."""
        return len(self.estimates)

    @property
    def has_interval(self) -> BoolArray:
        """True where an estimate has an interval, of shape (repeat, source, entry)."""
        return np.asarray(~np.isnan(self.estimates[..., 1:]).any(axis=-1))

    def coverage(self) -> FloatArray:
        """Return the share of the intervals that hold the truth, of shape (source, entry, bound).

        Its own interval is Clopper and Pearson's. NaN where no repeat has an interval.
        """
        lower, upper = np.moveaxis(self.estimates[..., 1:], -1, 0)
        given = self.has_interval.sum(axis=0)
        truth = self.truth[:, 0]
        held = (self.has_interval & (lower <= truth) & (truth <= upper)).sum(axis=0)
        with np.errstate(invalid="ignore"):
            found = np.stack([held / given, *clopper_pearson(held, given, LEVEL)], axis=-1)
        found[given == 0] = np.nan
        return found

    def falls_short(self, levels: FloatArray) -> BoolArray:
        """Return whether intervals hold less often than stated, of shape (source, entry)."""
        coverage = self.coverage()
        return np.asarray((coverage[..., 0] < levels - _ALLOWED) & (coverage[..., 2] < levels))

    def half_widths(self) -> FloatArray:
        """Return the median half-widths, of shape (source, entry); NaN where there are none."""
        halves = (self.estimates[..., 2] - self.estimates[..., 1]) / 2
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # where no repeat has an interval
            return np.asarray(np.nanmedian(halves, axis=0))


# Findings of a rehearsal as a labelled dataset.

# An interval that few repeats have is that of the repeats that look harmless.
_NEARLY_ALWAYS = 0.95

# Where the tail beyond the training range has this share of a statistic's sampling variance, in the
# surrogate or in the study's own runs, how often the interval holds depends on that tail.
_MUCH = 0.5

# Designs whose intervals are this close in width to the narrowest are level with it.
_LEVEL = 1.05


def rehearsal_dataset(
    rehearsed: RehearsedStudy,
    work: RepeatWork,
    record: RepeatRecord,
    tails: FloatArray,
    wanted: int,
) -> xr.Dataset:
    """Return the findings of a rehearsal.

    Parameters
    ----------
    record : RepeatRecord
        The estimates of all repeats.
    tails : ndarray, shape (2, entry)
        As of `tail_record`.

    Returns
    -------
    Dataset
        Along ``source`` (a design with its ``size``), ``entry`` (an ``output``, a ``statistic`` and
        its ``label``) and ``bound``, in SI units: ``coverage``, ``given``, ``half_width``,
        ``falls_short``, ``truth``, ``level``, ``tail_in_surrogate``, ``tail_in_runs``,
        ``hangs_on_tail`` and ``best``.
    """
    coverage, half_width = record.coverage(), record.half_widths()
    study = rehearsed.original
    described = [
        {
            "output": statistic.output,
            "statistic": statistic.name,
            "label": str(label),
            "level": statistic.quantity.confidence_level,
            "units": statistic.units,
            "display_units": statistic.display_units,
        }
        for statistic in work.statistics
        for label in statistic.entries
    ]
    levels = np.array([each["level"] for each in described])
    falls_short = record.falls_short(levels)
    given = record.has_interval.mean(axis=0)
    is_candidate = ~falls_short & (given >= _NEARLY_ALWAYS)
    sources, entries = ("source",), ("entry",)
    return xr.Dataset(
        {
            "coverage": ((*sources, *entries, BOUND), coverage),
            "given": ((*sources, *entries), given),
            "half_width": ((*sources, *entries), half_width),
            "falls_short": ((*sources, *entries), falls_short),
            "truth": ((*entries, BOUND), record.truth),
            "tail_in_surrogate": (entries, tails[0]),
            "tail_in_runs": (entries, tails[1]),
            "hangs_on_tail": (entries, (tails > _MUCH).any(axis=0)),
            "best": (entries, _best(work, half_width, is_candidate)),
        },
        {
            "design": (sources, [each.name for each in work.sources]),
            "size": (sources, [each.size for each in work.sources]),
            "runs": (sources, np.median(record.run_counts, axis=0).astype(np.int64)),
            **{name: (entries, [each[name] for each in described]) for name in described[0]},
            BOUND: list(BOUNDS),
        },
        {
            "title": study.title,
            "study_sha256": study.sha256,
            "seed": str(study.seed),
            "surrogate": rehearsed.surrogate.name,
            "repeats": record.repeats,
            "repeats_wanted": wanted,
        },
    )


def _best(work: RepeatWork, half_width: FloatArray, is_candidate: BoolArray) -> list[str]:
    """Return the designs with the narrowest intervals at equal runs, of those that hold."""
    equal = np.array([each.size == EQUAL for each in work.sources])
    widths = np.where(is_candidate & equal[:, np.newaxis], half_width, np.inf)
    least = widths.min(axis=0, initial=np.inf)
    level = np.isfinite(widths) & (widths <= _LEVEL * least)
    names = np.array([each.name for each in work.sources])
    return [" ".join(names[column]) for column in level.T]


# The statistics whose intervals are rehearsed: of samples those that runs correct in a surrogate,
# and the indices of pick-freeze designs.
_OF_SAMPLES = [
    each.name for each in CATALOGUE.values() if "corrected" in each.by and each.shown.label
]
_INDICES = [each.name for each in MEASURES["shares"] if each.measure.share != "divided"]

# Repeats that are timed before the number of all is decided.
_TIMED = 10


def rehearse(
    rehearsed: RehearsedStudy,
    settings: RehearsalSettings | None = None,
    *,
    map: Map = map,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Repeat a study on its own surrogate, and count how often its intervals hold.

    Parameters
    ----------
    rehearsed : RehearsedStudy
        The study, its surrogate and its own runs.
    settings : RehearsalSettings, optional
    map : callable
        Like the built-in; it makes the repeats. It cannot change a result.
    progress : Progress, optional
        Receives reports of progress.

    Returns
    -------
    Dataset
        As `rehearsal_dataset` makes it. After Ctrl-C it is of the repeats
        finished so far, if there are two at least.

    Raises
    ------
    SettingsError
        If the study has nothing to rehearse.
    """
    settings, progress = settings or RehearsalSettings(), progress or Progress()
    study, fitted = rehearsed.study, rehearsed.fitted
    for output, reason in rehearsed.refuted.items():
        progress.inform(f"{output} is not rehearsed: {reason}")
    sources = study_sources(study, settings.runs)
    work = RepeatWork(study, sources, rehearsed_statistics(study, sources))
    progress.start_step(f"the statistics of {fitted.name}")
    sample = large_sample(study, settings.draws)
    truth = surrogate_truth(study, fitted, work.statistics, sample)
    repeats, wanted = _all_repeats(work, settings, map, progress)
    record = RepeatRecord.of(repeats, truth)
    tails = tail_record(rehearsed, work.statistics, record.truth[:, 0], sample)
    return rehearsal_dataset(rehearsed, work, record, tails, wanted)


def rehearsed_statistics(
    study: ValidatedStudy, sources: tuple[RehearsedSource, ...]
) -> tuple[BenchmarkStatistic, ...]:
    """Return the statistics whose intervals are rehearsed, output by output."""
    inputs = tuple(entry.variable.name for entry in study.joint.random)
    has_indices = any(each.design.sampling is Sampling.PICK_FREEZE for each in sources)
    found: list[BenchmarkStatistic] = []
    for quantity in study.quantities_of_interest:
        found += benchmark_statistics([quantity], _OF_SAMPLES)
        if has_indices:
            found += [BenchmarkStatistic(quantity, name, inputs) for name in _INDICES]
    return tuple(found)


def _all_repeats(
    work: RepeatWork, settings: RehearsalSettings, map: Map, progress: Progress
) -> tuple[list[Repeat], int]:
    """Return the repeats that were finished, and how many were wanted."""
    repeats: list[Repeat] = []
    wanted = settings.repeats or 0
    try:
        first = min(wanted or _TIMED, _TIMED)
        began = time.perf_counter()
        for repeat in make_repeats(work, range(first), map):
            repeats.append(repeat)
            progress.start_step("first repeats", len(repeats), first)
        seconds = (time.perf_counter() - began) / first
        wanted = settings.affordable_repeats(seconds)
        left = duration_text(seconds * max(wanted - _TIMED, 0))
        designs = sum(source.size == STATED for source in work.sources)
        number = f"{grouped_number(wanted)} repeats of {designs} designs"
        progress.inform(f"{number}, about {left} to go")
        for repeat in make_repeats(work, range(first, wanted), map):
            progress.start_step("repeats", len(repeats) + 1, wanted)
            repeats.append(repeat)
    except KeyboardInterrupt as interrupt:
        if not is_user_interrupt(interrupt) or len(repeats) < 2:
            raise
    return repeats, wanted
