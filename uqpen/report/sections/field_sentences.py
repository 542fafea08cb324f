"""A sentence to quote on each output with dimensions: where its mean is largest."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from uqpen.archive.fields import coordinate_text
from uqpen.core.catalogue import CATALOGUE
from uqpen.report.sections.quoted_statistics import QuotedStatistic, no_break, output_name
from uqpen.results.archive_view import ArchiveView

__all__ = ["field_sentences"]

# Fields with a sentence, at the most.
_MOST = 3


def field_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield a sentence on each of the first fields, with the band of the mean if it has one."""
    yield from islice(filter(None, (_sentence(view, each, design) for each in view.fields)), _MOST)


def _sentence(view: ArchiveView, field: str, design: str) -> str:
    statistics = view.statistics.statistics(design, field)
    statistic = "mean_band" if "mean_band" in statistics else "mean"
    if statistic not in statistics:
        return ""
    array = statistics[statistic]
    estimates = array.values[..., 0]
    if not np.isfinite(estimates).any():
        return ""
    index = np.unravel_index(int(np.nanargmax(estimates)), estimates.shape)
    quantity = QuotedStatistic(view, field, CATALOGUE[statistic])
    value, interval = quantity.texts(array[index])[0], quantity.interval(array[index])
    if statistic == "mean_band":
        interval = interval.replace("without an interval", "without a band", 1)
        interval = interval.replace("% interval", "% band, valid at all places at once", 1)
    places = (
        coordinate_text(array[dim], array[dim].values[at], 6)
        for dim, at in zip(array.dims, index, strict=False)
    )
    place = no_break(", ".join(places))
    return f"The mean of {output_name(view, field)} is largest at {place}: {value} {interval}."
