"""Sentences on the probabilities of events of several outputs."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.report.counting import percent_texts
from uqpen.report.notes import has_interval
from uqpen.report.sections.quoted_statistics import no_break
from uqpen.report.sections.sentences import Population, verdict_sentence
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text
from uqpen.results.table import estimate_remark
from uqpen.results.texts import plain_text

__all__ = ["joint_sentences"]


def joint_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield a sentence on each event whose probability the study requests."""
    joint = view.statistics.joint_probability(design)
    if joint is None:
        return
    of = Population.from_design(view, design)
    for array in joint:
        event = plain_text(str(array["event_condition"].values))
        yield (
            f"The probability that {event}{of.condition} is {_stated(array)}."
            f"{of.missing_run_sentence(array)}{verdict_sentence(array)}"
        )


def _stated(array: xr.DataArray) -> str:
    value, lower, upper = map(no_break, percent_texts(*array.values.tolist()))
    if not has_interval(array.values):
        return f"{value} (without an interval: {estimate_remark(array)})"
    level = no_break(percent_text(array.attrs[INTERVAL_LEVEL]))
    return f"{value} ({lower} to {upper}, {level} interval)"
