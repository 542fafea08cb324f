"""Charts of a curve at one place, which a slider chooses: its distribution and its drivers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.charts.axes import ValueAxis, quantity
from uqpen.charts.chart import Axis, Chart, LegendKey, PlaceReadout, PlaceSlices
from uqpen.charts.marks import Bars, Dots, Mark, escape_text, series_marker
from uqpen.core.arrays import FloatArray, IntArray, evenly_spread
from uqpen.core.labels import INPUT
from uqpen.report.counting import count_text
from uqpen.report.sections.drivers import input_label
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.digits import estimate_text

__all__ = ["place_drivers", "place_histogram"]

# Places with a histogram or with drivers of their own, at the most.
_MOST_PLACES = 21
_HOVER = "%{y} runs around %{x:.4~g}"


def place_histogram(curve: CurveEstimates, readout: PlaceReadout) -> Chart:
    """Return the runs in bins at the place that is chosen."""
    numbers = evenly_spread(curve.places.size, _MOST_PLACES)
    series = curve.view.series(curve.source)
    bars = [[_bars(curve.runs[:, number], series)] for number in numbers]
    start = int(np.abs(numbers - readout.start).argmin())
    return Chart(
        title="Runs at the chosen place",
        summary=f"{count_text(len(curve.runs), 'run')} of {curve.source} in bins.",
        x=Axis(curve.view.axis_label(curve.output)),
        y=Axis("runs in a bin"),
        marks=(bars[start][0],),
        keys=(LegendKey(f"runs of {curve.source}", series, "bar"),),
        notes=_notes(curve, numbers),
        height=280,
        slices=_slices(curve, numbers, bars),
    )


def place_drivers(
    curve: CurveEstimates, readout: PlaceReadout, indices: list[tuple[str, str, xr.DataArray]]
) -> Iterator[Chart]:
    """Yield the shares of the variance at the place that is chosen.

    Parameters
    ----------
    indices : list of tuple
        The label, the source and the array of each measure along place, ``input`` and ``bound``.
    """
    if not indices:
        return
    numbers = evenly_spread(curve.places.size, _MOST_PLACES)
    rows = tuple(input_label(curve.view, str(name)) for name in indices[0][2][INPUT].values)
    traces = [
        [
            _dots(array.values[number], place, rows, label, source)
            for place, (label, source, array) in enumerate(indices)
        ]
        for number in numbers
    ]
    start = int(np.abs(numbers - readout.start).argmin())
    sources = ", ".join(dict.fromkeys(source for _, source, _ in indices))
    yield Chart(
        title="Shares of the variance at the chosen place",
        summary=f"{', '.join(label for label, _, _ in indices)} by {sources}.",
        x=Axis("share of the variance", (-0.1, 1.1)),
        y=Axis("", rows=rows),
        marks=tuple(traces[start]),
        keys=tuple(
            LegendKey(f"{label}, {source}", place, series_marker(place))
            for place, (label, source, _) in enumerate(indices)
        ),
        notes=_notes(curve, numbers),
        height=110 + 34 * len(rows),
        slices=_slices(curve, numbers, traces),
    )


def _notes(curve: CurveEstimates, numbers: IntArray) -> tuple[str, ...]:
    if len(numbers) == curve.places.size:
        return ()
    return (f"At the nearest of {len(numbers)} of {curve.size} places.",)


def _slices(
    curve: CurveEstimates, numbers: IntArray, traces: Sequence[Sequence[Mark]]
) -> PlaceSlices:
    return PlaceSlices(
        quantity(curve.view, curve.dimension),
        curve.places[numbers].tolist(),
        traces,
    )


def _bars(values: FloatArray, series: int) -> Mark:
    known = values[np.isfinite(values)]
    if not known.size:
        return Bars(np.array([0.0, 1.0]), [0], series, hover=_HOVER, is_even=True)
    counts, edges = ValueAxis.of_values([known]).bins(known)
    return Bars(edges, counts, series, hover=_HOVER, is_even=True)


def _dots(bounds: FloatArray, place: int, rows: tuple[str, ...], label: str, source: str) -> Mark:
    offsets = [row + 0.22 * (place - 0.5) for row in range(len(rows))]
    texts = [estimate_text(*each) for each in bounds.tolist()]
    return Dots(
        bounds,
        offsets,
        place,
        hovers=texts,
        name=label,
        marker=series_marker(place),
        hover=f"%{{customdata}}, {escape_text(label)} by {escape_text(source, 40)}: %{{text}}",
        labels=rows,
    )
