"""Rehearsal of a study: from its surrogate and its runs to a dataset of coverages."""

from __future__ import annotations

import time

import xarray as xr

from uqpen.benchmark.statistics import BenchmarkStatistic, benchmark_statistics
from uqpen.core.catalogue import CATALOGUE, MEASURES
from uqpen.core.interrupts import is_user_interrupt
from uqpen.core.labels import STATED
from uqpen.core.sampling import Sampling
from uqpen.execution import Map, Progress
from uqpen.rehearsal.findings import rehearsal_dataset
from uqpen.rehearsal.rehearsal_settings import RehearsalSettings
from uqpen.rehearsal.rehearsed_study import RehearsedStudy
from uqpen.rehearsal.repeat_record import RepeatRecord
from uqpen.rehearsal.repeats import Repeat, RepeatWork, make_repeats
from uqpen.rehearsal.sources import RehearsedSource, study_sources
from uqpen.rehearsal.tail import tail_record
from uqpen.rehearsal.truth import large_sample, surrogate_truth
from uqpen.results.digits import grouped_number
from uqpen.results.progress_texts import duration_text
from uqpen.study.study import ValidatedStudy

__all__ = ["rehearse", "rehearsed_statistics"]

# The statistics whose intervals are rehearsed: of samples those that runs correct in a surrogate,
# and the indices of pick-freeze designs.
_OF_SAMPLES = [each.name for each in CATALOGUE.values() if each.is_corrected and each.shown.label]
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
        progress.inform(_announcement(work, wanted, seconds))
        for repeat in make_repeats(work, range(first, wanted), map):
            progress.start_step("repeats", len(repeats) + 1, wanted)
            repeats.append(repeat)
    except KeyboardInterrupt as interrupt:
        if not is_user_interrupt(interrupt) or len(repeats) < 2:
            raise
    return repeats, wanted


def _announcement(work: RepeatWork, repeats: int, seconds: float) -> str:
    """Return the number of repeats, and how long they will take, in words."""
    left = duration_text(seconds * max(repeats - _TIMED, 0))
    designs = sum(source.size == STATED for source in work.sources)
    return f"{grouped_number(repeats)} repeats of {designs} designs, about {left} to go"
