"""Charts of statistics over the values of a swept input."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.charts.axes import padded_limits
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import Dots, interval_notes, series_marker
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.archive_view import ArchiveView
from uqpen.results.sweeps import Sweep, SweptStatistic
from uqpen.results.table import shown_estimate
from uqpen.results.texts import title_with_unit

# Lines, one for each value of the second input, that a chart has at the most.
_MOST_LINES = 8


def sweep_charts(view: ArchiveView) -> Iterator[Chart]:
    """Statistics over the values of a swept input, a chart for each."""
    sweep, design = Sweep.of_archive(view.archive), view.leading_design
    if sweep is None or design is None:
        return
    for output in view.numeric_outputs:
        for statistic in sweep.swept_statistics(output, design):
            yield _chart(view, sweep, output, design, statistic)


def _chart(
    view: ArchiveView, sweep: Sweep, output: str, design: str, statistic: SweptStatistic
) -> Chart:
    """Return the chart of a statistic over the first input, a line for each value of the others."""
    along, *others = sweep.inputs
    texts = [sweep.texts(name) for name in sweep.inputs]
    # Labels have no place along an axis but their order.
    is_number = not view.code_labels(along)
    places = sweep.values(along) if is_number else np.unique(texts[0], return_inverse=True)[1]
    lines: dict[tuple[str, ...], list[int]] = {}
    for number, model in enumerate(sweep.models):
        if model in statistic.estimates:
            lines.setdefault(tuple(text[number] for text in texts[1:]), []).append(number)
    models = [*sweep.models]
    marks, keys, said = [], [], []
    for series, (values, numbers) in enumerate([*lines.items()][:_MOST_LINES]):
        numbers = sorted(numbers, key=lambda number: float(places[number]))
        estimates = [statistic.estimates[models[number]] for number in numbers]
        bounds = np.array([statistic.convert(each.values) for each in estimates], dtype=np.float64)
        named = ", ".join(f"{name} {text}" for name, text in zip(others, values, strict=True))
        hovers = [
            f"{along} {texts[0][number]}: {shown_estimate(each, statistic.convert)}"
            for number, each in zip(numbers, estimates, strict=True)
        ]
        marker = series_marker(series)
        marks.append(
            Dots(bounds, places[numbers], series, hovers, named, marker, along="y", is_joined=True)
        )
        said += hovers
        if named:
            keys.append(LegendKey(named, series, marker))
    unit = "" if statistic.unit == DIMENSIONLESS else statistic.unit
    ticks = tuple({float(each): text for each, text in zip(places, texts[0], strict=True)}.items())
    notes = [*interval_notes(statistic.estimates.values(), ", each value by itself")]
    if len(lines) > _MOST_LINES:
        notes.append(f"The first {_MOST_LINES} of {len(lines)} lines; the table has all.")
    return Chart(
        title=f"{statistic.label} over {along}",
        summary=f"Of {output}, by {design}: {'; '.join(said)}.",
        x=Axis(
            view.axis_label(along),
            padded_limits(float(places.min()), float(places.max())),
            ticks=() if is_number else ticks,
        ),
        y=Axis(title_with_unit(statistic.label, unit or DIMENSIONLESS)),
        marks=tuple(marks),
        keys=tuple(keys),
        notes=tuple(notes),
        of=output,
        source=design,
        is_of_all_models=True,
    )
