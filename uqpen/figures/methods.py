"""What all sources say of the same statistic, side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.figures.estimates import Dot, draw_dots
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.labels import EXCEEDANCE, MOMENTS, QUANTILES, SHARES
from uqpen.summary.table import Conversion, exceedance_label, quantile_label, unchanged

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Statistic", "methods", "statistics"]

_ROW, _FRAME = 0.19, 0.75


def methods(part: Part) -> Iterator[Panel]:
    """Means, quantiles, probabilities: what each source says."""
    for output in (*part.numbers, *part.kinds):
        found = list(statistics(part, output))
        rows = tuple(name for name in part.sources if any(name in each.told for each in found))
        for each in found:
            if each.told:
                title = part.titled(f"{output}: {each.label}")
                height = _FRAME + _ROW * len(rows)
                yield Panel(title, partial(_draw, part, each, rows), height, rows, output)


class Statistic(NamedTuple):
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
    def told(self) -> dict[str, xr.DataArray]:
        """The estimates that there are."""
        return {s: e for s, e in self.estimates.items() if np.isfinite(e.values[0])}


def statistics(part: Part, output: str) -> Iterator[Statistic]:
    """Mean, standard deviation, quantiles, probabilities and shares of an output."""
    measure, axis = part.measure(output), part.axis(output)
    moments: tuple[tuple[str, str, Conversion], ...] = (
        ("mean", "mean", measure.from_si),
        ("std", "sd", measure.difference_from_si),
    )
    for suffix, label, convert in moments:
        told = part.told(MOMENTS)
        name = f"{output}_{suffix}"
        found = {s: group[name] for s, group in told if name in group}
        yield Statistic(MOMENTS, label, axis, convert, found)
    entries: tuple[tuple[str, str, str, Conversion], ...] = (
        (QUANTILES, "probability", axis, measure.from_si),
        (EXCEEDANCE, "threshold", "probability", unchanged),
        (SHARES, "category_label", "share", unchanged),
    )
    for kind, along, shown, convert in entries:
        arrays = {s: group[output] for s, group in part.told(kind) if output in group}
        for position, called in enumerate(_called(arrays, f"{output}_{along}")):
            label = _label(kind, called)
            entry = {s: array[position] for s, array in arrays.items()}
            yield Statistic(kind, label, shown, convert, entry)


def _label(kind: str, called: Any) -> str:
    """What an entry of a statistic is called, as in the tables."""
    if kind == QUANTILES:
        return quantile_label(called)
    return exceedance_label(called) if kind == EXCEEDANCE else f"share {called}"


def _called(arrays: Mapping[str, xr.DataArray], coordinate: str) -> list[Any]:
    """What tells the entries of a statistic apart."""
    first = next(iter(arrays.values()), None)
    return [] if first is None else list(first[coordinate].values.tolist())


def _draw(part: Part, statistic: Statistic, rows: tuple[str, ...], axes: Axes) -> Iterator[str]:
    axes.set_xlabel(statistic.axis)
    axes.locator_params(axis="x", nbins=3)
    dots = [
        Dot.of(estimate, statistic.convert, rows.index(source), part.look(source))
        for source, estimate in statistic.told.items()
    ]
    yield from draw_dots(axes, dots)
