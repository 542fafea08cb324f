"""Findings of a rehearsal as a labelled dataset."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import BOUND, BOUNDS, EQUAL
from uqpen.rehearsal.rehearsed_study import RehearsedStudy
from uqpen.rehearsal.repeat_record import RepeatRecord
from uqpen.rehearsal.repeats import RepeatWork

__all__ = ["rehearsal_dataset"]

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
    rehearsed : RehearsedStudy
    work : RepeatWork
        Its sources and statistics.
    record : RepeatRecord
        The estimates of all repeats.
    tails : ndarray, shape (2, entry)
        As of `tail_record`.
    wanted : int
        The number of repeats that was wanted.

    Returns
    -------
    Dataset
        Along ``source`` (a design with its ``size``), ``entry`` (an ``output``, a ``statistic`` and
        its ``label``) and ``bound``, in SI units: ``coverage``, ``given``, ``half_width``,
        ``falls_short``, ``truth``, ``level``, ``tail_in_surrogate``, ``tail_in_runs``,
        ``hangs_on_tail`` and ``best``.
    """
    coverage, half_width = record.coverage(), record.half_widths()
    levels = np.array([each["level"] for each in _entries(work)])
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
        {**_source_coordinates(work, record), **_entry_coordinates(work), BOUND: list(BOUNDS)},
        _attributes(rehearsed, record, wanted),
    )


def _attributes(rehearsed: RehearsedStudy, record: RepeatRecord, wanted: int) -> dict[str, Any]:
    study = rehearsed.original
    return {
        "title": study.title,
        "study_sha256": study.sha256,
        "seed": str(study.seed),
        "surrogate": rehearsed.surrogate.name,
        "repeats": record.repeats,
        "repeats_wanted": wanted,
    }


def _source_coordinates(work: RepeatWork, record: RepeatRecord) -> dict[str, Any]:
    return {
        "design": ("source", [each.name for each in work.sources]),
        "size": ("source", [each.size for each in work.sources]),
        "runs": ("source", np.median(record.run_counts, axis=0).astype(np.int64)),
    }


def _entry_coordinates(work: RepeatWork) -> dict[str, Any]:
    entries = list(_entries(work))
    return {name: ("entry", [each[name] for each in entries]) for name in entries[0]}


def _entries(work: RepeatWork) -> Iterator[dict[str, Any]]:
    """Yield what describes each entry of each statistic."""
    for statistic in work.statistics:
        for label in statistic.entries:
            yield {
                "output": statistic.output,
                "statistic": statistic.name,
                "label": str(label),
                "level": statistic.quantity.confidence_level,
                "units": statistic.units,
                "display_units": statistic.display_units,
            }


def _best(work: RepeatWork, half_width: FloatArray, is_candidate: BoolArray) -> list[str]:
    """Return the designs with the narrowest intervals at equal runs, of those that hold."""
    equal = np.array([each.size == EQUAL for each in work.sources])
    widths = np.where(is_candidate & equal[:, np.newaxis], half_width, np.inf)
    least = widths.min(axis=0, initial=np.inf)
    level = np.isfinite(widths) & (widths <= _LEVEL * least)
    names = np.array([each.name for each in work.sources])
    return [" ".join(names[column]) for column in level.T]
