"""One statistic by all sources, side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.statistic_entries import COMPARED, labelled_entries
from uqpen.results.table import Conversion

__all__ = ["ComparedStatistic", "compared_statistics", "source_panels"]

_ROW, _FRAME = 0.19, 0.75

# The labels of axes of statistics without a unit.


def source_panels(view: ArchiveView) -> Iterator[Panel]:
    """Means, quantiles and probabilities by each source."""
    for output in (*view.numeric_outputs, *view.categorical_outputs):
        found = list(compared_statistics(view, output))
        rows = tuple(
            name for name in view.sources if any(name in each.available_estimates for each in found)
        )
        for each in found:
            if each.available_estimates:
                title = view.title(f"{output}: {each.label}")
                height = _FRAME + _ROW * len(rows)
                yield Panel(title, partial(_draw, view, each, rows), height, rows, output)


class ComparedStatistic(NamedTuple):
    """A single statistic of an output, and its estimates by all sources.

    Attributes
    ----------
    statistic : str
        An entry of the catalogue.
    label, axis : str
        Its name in tables, and the label of its axis.
    convert : callable
        From SI to the unit that it is shown in.
    estimates : mapping of str to DataArray
        By source; along ``bound``.
    """

    statistic: str
    label: str
    axis: str
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
        axis = statistic.shown.axis or view.axis_label(output)
        for label, found in labelled_entries(statistic, view.estimates(output, name)):
            yield ComparedStatistic(name, label, axis, convert, found)


def _draw(
    view: ArchiveView, statistic: ComparedStatistic, rows: tuple[str, ...], axes: Axes
) -> Iterator[str]:
    axes.set_xlabel(statistic.axis)
    axes.locator_params(axis="x", nbins=3)
    dots = [
        EstimateDot.from_array(estimate, statistic.convert, rows.index(source), view.look(source))
        for source, estimate in statistic.available_estimates.items()
    ]
    yield from draw_dots(axes, dots)
