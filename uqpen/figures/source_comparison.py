"""One statistic by all sources, side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE, PROBABILITY, THRESHOLD, UnitRule
from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.table import Conversion, exceedance_label, quantile_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["ComparedStatistic", "compared_statistics", "source_panels"]

_ROW, _FRAME = 0.19, 0.75

# The statistics that are compared as a whole, and their labels in the tables.
_SINGLE = {"mean": "mean", "std": "sd"}
# Those that are compared entry by entry: the coordinate that names an entry, and its label.
_BY_ENTRY: dict[str, tuple[str, Callable[[Any], str]]] = {
    "quantile": (PROBABILITY, quantile_label),
    "exceedance": (THRESHOLD, exceedance_label),
    "share": ("category_label", "share {}".format),
}
# The labels of axes of statistics without a unit.
_AXES = {"exceedance": "probability", "share": "share"}


def source_panels(view: ArchiveView) -> Iterator[Panel]:
    """Means, quantiles, probabilities: what each source says."""
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
    label : str
        Its name in tables.
    axis : str
        The label of its axis.
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
    for name, label in _SINGLE.items():
        arrays = view.estimates(output, name)
        axis, convert = _axis(view, output, name), view.conversion(output, name)
        yield ComparedStatistic(name, label, axis, convert, arrays)
    for name, (coordinate, entry_label) in _BY_ENTRY.items():
        arrays = view.estimates(output, name)
        axis, convert = _axis(view, output, name), view.conversion(output, name)
        for position, entry in enumerate(_entries(arrays, coordinate)):
            found = {source: array[position] for source, array in arrays.items()}
            yield ComparedStatistic(name, entry_label(entry), axis, convert, found)


def _axis(view: ArchiveView, output: str, statistic: str) -> str:
    has_unit = CATALOGUE[statistic].unit is not UnitRule.NONE
    return view.axis_label(output) if has_unit else _AXES[statistic]


def _entries(arrays: Mapping[str, xr.DataArray], coordinate: str) -> list[Any]:
    """Return the names of a statistic's entries, which are the same for all sources."""
    first = next(iter(arrays.values()), None)
    return [] if first is None else list(first[coordinate].values.tolist())


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
