"""Fields along two dimensions as maps: their mean and standard deviation."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUND, INTERVAL_LEVEL
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import number_text, percent_text
from uqpen.results.table import first_runs
from uqpen.results.texts import title_with_unit, unit_suffix

__all__ = ["map_panels"]

_SHOWN = {"mean": "mean", "std": "standard deviation"}


def map_panels(view: ArchiveView) -> Iterator[Panel]:
    """Fields along two dimensions: mean and standard deviation."""
    runs = first_runs(view.tree)
    for output in view.fields:
        if len(field_dimensions(runs[output])) != 2:
            continue
        for statistic, name in _SHOWN.items():
            for source, array in list(view.estimates(output, statistic).items())[:1]:
                title = view.title(f"{output}, {source}: {name}")
                draw = partial(_draw, view, output, statistic, array)
                yield Panel(title, draw, 2.8, group=output)


def _draw(
    view: ArchiveView, output: str, statistic: str, array: xr.DataArray, axes: Axes
) -> Iterator[str]:
    along, across = field_dimensions(first_runs(view.tree)[output])
    x, y = (view.scale(name).from_si(array[name].values) for name in (across, along))
    shown = view.conversion(output, CATALOGUE[statistic])(
        array.transpose(along, across, BOUND).values
    )
    values, lower, upper = np.moveaxis(np.asarray(shown, dtype=np.float64), -1, 0)
    # As a picture: a vector file of ten thousand cells would be large.
    mesh = axes.pcolormesh(x, y, values, shading="nearest", cmap="viridis", rasterized=True)
    axes.grid(visible=False)
    axes.set(xlabel=view.axis_label(across), ylabel=view.axis_label(along))
    name = f"{_SHOWN[statistic]} of {view.attributes(output).get('long_name', output)}"
    axes.figure.colorbar(mesh, ax=axes, label=title_with_unit(name, view.unit(output)))
    widths = (upper - lower) / 2
    if np.isfinite(widths).any():
        level = percent_text(float(array.attrs.get(INTERVAL_LEVEL, np.nan)))
        half = f"{number_text(np.nanmax(widths), 3)}{unit_suffix(view.unit(output))}"
        yield f"{output}, {_SHOWN[statistic]}: half-widths of {level} intervals up to {half}"
    else:
        yield f"{output}, {_SHOWN[statistic]}: no intervals"
