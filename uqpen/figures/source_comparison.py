"""What all sources say of the same statistic, side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import EXCEEDANCE, MOMENTS, QUANTILES, SHARES
from uqpen.figures.archive_view import ArchiveView
from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Panel
from uqpen.results.table import Conversion, exceedance_label, identity, quantile_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["ComparedStatistic", "compared_statistics", "source_panels"]

_ROW, _FRAME = 0.19, 0.75


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
    """A statistic of an output, and what all sources tell of it.

    Attributes
    ----------
    kind : str
        The group that it stands in.
    label : str
        What it is called in tables.
    axis : str
        What an axis of it says.
    convert : callable
        From SI to the unit that it is shown in.
    estimates : mapping of str to DataArray
        By source; along ``bound``.
    """

    kind: str
    label: str
    axis: str
    convert: Conversion
    estimates: Mapping[str, xr.DataArray]

    @property
    def available_estimates(self) -> dict[str, xr.DataArray]:
        """The estimates that there are."""
        return {s: e for s, e in self.estimates.items() if np.isfinite(e.values[0])}


def compared_statistics(view: ArchiveView, output: str) -> Iterator[ComparedStatistic]:
    """Mean, standard deviation, quantiles, probabilities and shares of an output."""
    measure, axis = view.scale(output), view.axis_label(output)
    moments: tuple[tuple[str, str, Conversion], ...] = (
        ("mean", "mean", measure.from_si),
        ("std", "sd", measure.difference_from_si),
    )
    for suffix, label, convert in moments:
        moment_groups = view.source_groups(MOMENTS)
        name = f"{output}_{suffix}"
        found = {s: group[name] for s, group in moment_groups if name in group}
        yield ComparedStatistic(MOMENTS, label, axis, convert, found)
    entries: tuple[tuple[str, str, str, Conversion], ...] = (
        (QUANTILES, "probability", axis, measure.from_si),
        (EXCEEDANCE, "threshold", "probability", identity),
        (SHARES, "category_label", "share", identity),
    )
    for kind, along, shown, convert in entries:
        arrays = {s: group[output] for s, group in view.source_groups(kind) if output in group}
        for position, called in enumerate(_entry_names(arrays, f"{output}_{along}")):
            label = _entry_label(kind, called)
            entry = {s: array[position] for s, array in arrays.items()}
            yield ComparedStatistic(kind, label, shown, convert, entry)


def _entry_label(kind: str, name: Any) -> str:
    """What an entry of a statistic is called, as in the tables."""
    if kind == QUANTILES:
        return quantile_label(name)
    return exceedance_label(name) if kind == EXCEEDANCE else f"share {name}"


def _entry_names(arrays: Mapping[str, xr.DataArray], coordinate: str) -> list[Any]:
    """What tells the entries of a statistic apart."""
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
