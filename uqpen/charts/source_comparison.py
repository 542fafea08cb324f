"""One statistic by all sources, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import Dots, has_interval, interval_notes, series_marker
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.statistic_entries import COMPARED, labelled_entries
from uqpen.results.table import Conversion, identity, shown_estimate
from uqpen.results.texts import title_with_unit, unit_suffix

__all__ = [
    "ComparedStatistic",
    "available_statistics",
    "compared_sources",
    "compared_statistics",
    "comparison_chart",
    "hollow_keys",
    "source_charts",
]

# Rows of a chart, and what is around them, in CSS pixels.
_ROW, _FRAME = 22, 66


def source_charts(view: ArchiveView) -> Iterator[Chart]:
    """Means, quantiles and probabilities by each source."""
    for output in (*view.numeric_outputs, *view.categorical_outputs):
        found = available_statistics(view, output)
        rows = compared_sources(view, found)
        for each in found:
            chart = comparison_chart(view, output, each, rows)
            estimates = each.available_estimates.values()
            yield replace(chart, keys=hollow_keys(estimates), notes=(*interval_notes(estimates),))


class ComparedStatistic(NamedTuple):
    """A single statistic of an output, and its estimates by all sources.

    Attributes
    ----------
    statistic : str
        An entry of the catalogue.
    label : str
        Its name in tables.
    convert : callable
        From SI to the unit that it is shown in.
    estimates : mapping of str to DataArray
        By source; along ``bound``.
    """

    statistic: str
    label: str
    convert: Conversion
    estimates: Mapping[str, xr.DataArray]

    @property
    def available_estimates(self) -> dict[str, xr.DataArray]:
        """The estimates that there are."""
        return {s: e for s, e in self.estimates.items() if np.isfinite(e.values[0])}


def compared_statistics(view: ArchiveView, output: str) -> Iterator[ComparedStatistic]:
    """Yield mean, standard deviation, quantiles, probabilities and shares of an output."""
    for statistic in COMPARED:
        name = statistic.name
        convert = view.conversion(output, name)
        for label, found in labelled_entries(statistic, view.estimates(output, name)):
            yield ComparedStatistic(name, label, convert, found)


def available_statistics(view: ArchiveView, output: str) -> list[ComparedStatistic]:
    """Return the statistics of an output that any source has an estimate of."""
    return [each for each in compared_statistics(view, output) if each.available_estimates]


def compared_sources(view: ArchiveView, found: Sequence[ComparedStatistic]) -> tuple[str, ...]:
    """Return the sources that have an estimate of any of some statistics."""
    return tuple(
        name for name in view.sources if any(name in each.available_estimates for each in found)
    )


def comparison_chart(
    view: ArchiveView, output: str, statistic: ComparedStatistic, rows: tuple[str, ...]
) -> Chart:
    """Return the estimates of a statistic, with a row for each source."""
    dots: list[Dots] = []
    texts = []
    unit = DIMENSIONLESS if statistic.convert is identity else view.unit(output)
    for source, estimate in statistic.available_estimates.items():
        is_log = view.is_logarithmic(output) and statistic.convert is not identity
        shown = shown_estimate(estimate, statistic.convert, is_logarithmic=is_log)
        texts.append(f"{source} {shown}{unit_suffix(unit)}")
        bounds = np.asarray([statistic.convert(estimate.values)], dtype=np.float64)
        place, position = [rows.index(source)], view.series(source)
        marker = series_marker(position)
        dots.append(Dots(bounds, place, position, hovers=texts[-1:], name=source, marker=marker))
    return Chart(
        title=statistic.label,
        summary=f"Of {output_title(view, output)}: {'; '.join(texts)}.",
        x=Axis(title_with_unit(statistic.label, unit)),
        y=Axis("", rows=rows),
        marks=tuple(dots),
        height=_FRAME + _ROW * len(rows),
        of=output,
    )


def hollow_keys(estimates: Iterable[xr.DataArray]) -> tuple[LegendKey, ...]:
    """Return the entry of a legend for estimates without an interval, if there are any."""
    if all(has_interval(each.values) for each in estimates):
        return ()
    return (LegendKey("no interval", "ink", "circle-open"),)
