"""One statistic by all sources, side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import LOWER_THRESHOLD, PROBABILITY, THRESHOLD
from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_statistics import source_entries
from uqpen.results.table import Conversion, below_label, exceedance_label, quantile_label

__all__ = ["ComparedStatistic", "compared_statistics", "source_panels"]

_ROW, _FRAME = 0.19, 0.75

# The statistics that are compared as a whole, and their labels in the tables.
_SINGLE = {"mean": "mean", "std": "sd"}
# Statistics that are compared by entry: the coordinate that names an entry, and its label.
_BY_ENTRY: dict[str, tuple[str, Callable[[Any], str]]] = {
    "quantile": (PROBABILITY, quantile_label),
    "exceedance": (THRESHOLD, exceedance_label),
    "below": (LOWER_THRESHOLD, below_label),
    "share": ("category_label", "share {}".format),
}
# The labels of axes of statistics without a unit.
_AXES = {"exceedance": "probability", "below": "probability", "share": "share"}


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
    for name in (*_SINGLE, *_BY_ENTRY):
        arrays, convert = view.estimates(output, name), view.conversion(output, name)
        axis = _AXES.get(name) or view.axis_label(output)
        if name in _SINGLE:
            yield ComparedStatistic(name, _SINGLE[name], axis, convert, arrays)
        else:
            coordinate, entry_label = _BY_ENTRY[name]
            for entry, found in source_entries(arrays, coordinate):
                yield ComparedStatistic(name, entry_label(entry), axis, convert, found)


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
