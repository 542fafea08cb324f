"""A model beside measurements: measured against predicted, errors by condition, and curves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from uqpen.archive.groups import group_names, read_group
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey
from uqpen.charts.marks import Band, Bars, Dots, Line, Mark, Points, Rule
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.core.labels import CALIBRATIONS, MEASURED_CONDITION, RUNS, UNKNOWN
from uqpen.core.units import scale
from uqpen.results.archive_view import ArchiveView
from uqpen.results.calibrations import fitted_rows, unknown_unit
from uqpen.results.digits import count_text, number_text
from uqpen.results.texts import title_with_unit, unit_suffix
from uqpen.results.validations import MeasuredRows, measured_rows

# Conditions that errors are drawn against, and experiments whose curves are drawn.
_MOST_CONDITIONS, _MOST_CURVES = 3, 6
# Unknowns and pairs of them whose draws are drawn, the most dependent pairs first; and how.
_MOST_UNKNOWNS, _MOST_PAIRS, _MOST_POINTS, _BINS = 8, 3, 500, 60
# Bars of one standard deviation would hide most of what is compared.
_BARS = 2
_NOTE = "Bars are two standard deviations."
_NOTE_ON_PREDICTIONS = "Those of predictions are their intervals."


def measurement_charts(view: ArchiveView) -> Iterator[Charts]:
    """Measured values beside the model, by each design."""
    for of in measured_rows(view.tree):
        if "measured" in of.statistics:
            found = (of.values("predicted_mean"), of.values("predicted_std"))
            z = np.asarray(of.statistics["z_score"].values)
            charts = _charts(view, of, *found, z)
            if of.are_fresh:
                named = (replace(each, title=f"held out: {each.title}") for each in charts.charts)
                charts = replace(charts, charts=tuple(named))
            yield charts
    for of, beyond in fitted_rows(view.tree):
        is_posterior = "predicted_mean" in of.statistics
        model = of.values("predicted_mean" if is_posterior else "fitted")
        spread = of.values("predicted_std") if is_posterior else 0 * model
        z = (model - of.values("measured")) / np.hypot(of.values("measured_std"), spread)
        z[of.statistics["bound_side"].values != 0] = np.nan  # no value was measured
        charts = _charts(view, of, model, spread, z)
        if beyond is not None:
            shown = (*charts.charts, *_predictions(view, of, beyond))
            charts = Charts(shown, notes=(*charts.notes, _NOTE_ON_PREDICTIONS))
        yield charts


class _Unknown(NamedTuple):
    """An unknown, the title of an axis along it, and its draws in the unit that is shown."""

    name: str
    title: str
    prior: FloatArray
    posterior: FloatArray


def posterior_charts(view: ArchiveView) -> Iterator[Charts]:
    """Draws of each posterior beside those of its prior, and pairs."""
    for design in group_names(view.tree, CALIBRATIONS):
        groups = [
            read_group(view.tree, CALIBRATIONS, design, name) for name in ("prior", "posterior")
        ]
        if not groups[-1].data_vars:
            continue
        runs = read_group(view.tree, RUNS, design)
        found = []
        for like in read_group(view.tree, CALIBRATIONS, design)["unit_like"][:_MOST_UNKNOWNS]:
            name = str(like[UNKNOWN].item())
            unit, convert = unknown_unit(name, str(like.item()), runs)
            draws = (convert(each[name].values.ravel()) for each in groups)
            found.append(_Unknown(name, title_with_unit(name, unit), *draws))
        charts = [_prior_and_posterior(view, design, each) for each in found]
        ranks = [np.argsort(np.argsort(each.posterior)) for each in found]
        dependence = np.abs(np.atleast_2d(np.corrcoef(ranks)))
        pairs = sorted(combinations(range(len(found)), 2), key=lambda pair: -dependence[pair])
        charts += [_pair(view, design, found[n], found[m]) for n, m in pairs[:_MOST_PAIRS]]
        keys = (
            LegendKey("posterior", view.series(design), "bar"),
            LegendKey("prior", "quiet", "line"),
        )
        yield Charts(tuple(charts), keys=keys)


def _prior_and_posterior(view: ArchiveView, design: str, of: _Unknown) -> Chart:
    edges = np.histogram_bin_edges(np.concatenate([of.prior, of.posterior]), _BINS)
    before, after = (np.histogram(each, edges)[0] / len(each) for each in (of.prior, of.posterior))
    return Chart(
        title=of.name,
        summary=f"Draws of {of.name}: prior and posterior by {design}.",
        x=Axis(of.title),
        y=Axis("share of the draws"),
        marks=(
            Bars(edges, after, view.series(design), "%{x}<br>%{y:.2~f}"),
            Line(edges, np.append(before, before[-1]), "quiet", name="prior", is_stepped=True),
        ),
        source=design,
    )


def _pair(view: ArchiveView, design: str, one: _Unknown, other: _Unknown) -> Chart:
    rows = evenly_spread(len(one.posterior), _MOST_POINTS)
    before = evenly_spread(len(one.prior), _MOST_POINTS)
    return Chart(
        title=f"{other.name} against {one.name}",
        summary=f"Draws of {one.name} and {other.name}: prior and posterior by {design}.",
        x=Axis(one.title),
        y=Axis(other.title),
        marks=(
            Points(one.prior[before], other.prior[before], "quiet", name="prior", opacity=0.3),
            Points(one.posterior[rows], other.posterior[rows], view.series(design), name=design),
        ),
        source=design,
    )


def _charts(
    view: ArchiveView, of: MeasuredRows, predicted: FloatArray, std: FloatArray, z: FloatArray
) -> Charts:
    charts = [_measured_against_predicted(view, of, predicted, std)]
    dims = [str(each) for each in of.runs[of.output].dims if str(each) != "run"]
    if len(dims) == 1 and dims[0] in of.conditions:
        charts += _curves(view, of, dims[0], predicted, std)
    charts += _errors_by_condition(view, of, z)
    return Charts(tuple(charts), notes=(_NOTE,))


def _hovers(of: MeasuredRows, predicted: FloatArray) -> list[str]:
    unit = unit_suffix(of.unit)
    measured, sides = of.values("measured"), of.statistics["bound_side"].values
    words = {1: "at least ", -1: "at most "}
    return [
        f"{of.label(row)}: measured {words.get(int(sides[row]), '')}"
        f"{number_text(float(measured[row]), 5)}{unit}, model {number_text(float(each), 5)}{unit}"
        for row, each in enumerate(predicted)
    ]


def _bars(middle: FloatArray, std: FloatArray) -> FloatArray:
    return np.stack([middle, middle - _BARS * std, middle + _BARS * std], axis=-1)


def _measured_against_predicted(
    view: ArchiveView, of: MeasuredRows, predicted: FloatArray, std: FloatArray
) -> Chart:
    measured, series = of.values("measured"), view.series(of.design)
    ends = [min(measured.min(), predicted.min()), max(measured.max(), predicted.max())]
    hovers, label = _hovers(of, predicted), title_with_unit("measured", of.unit)
    marks: list[Mark] = [
        Line(ends, ends, "quiet", dash="dash", width=1),
        Dots(_bars(measured, of.values("measured_std")), predicted, series, hovers, of.design),
    ]
    if std.any():
        marks.append(Dots(_bars(predicted, std), measured, series, hovers, along="y"))
    return Chart(
        title="measured against predicted",
        summary=f"{count_text(len(measured), 'measured value')} of {of.output} against the model.",
        x=Axis(label),
        y=Axis(title_with_unit("model", of.unit)),
        marks=tuple(marks),
        keys=(LegendKey("equal", "quiet", "line", "dash"),),
        of=of.output,
        source=of.design,
    )


def _errors_by_condition(view: ArchiveView, of: MeasuredRows, z: FloatArray) -> Iterator[Chart]:
    texts = [f"{of.label(row)}: {number_text(float(each), 3)}" for row, each in enumerate(z)]
    for name, (unit, values) in [*of.conditions.items()][:_MOST_CONDITIONS]:
        yield Chart(
            title=f"error against {name}",
            summary=f"Errors of the model of {of.output}, by their uncertainty, against {name}.",
            x=Axis(title_with_unit(name, unit)),
            y=Axis("error / its uncertainty"),
            marks=(
                Rule(0.0, "quiet", is_horizontal=True),
                *(Rule(at, "quiet", "dash", is_horizontal=True) for at in (-2.0, 2.0)),
                Points(
                    values,
                    z,
                    view.series(of.design),
                    "%{text}",
                    of.design,
                    texts,
                    size=7,
                    opacity=0.8,
                ),
            ),
            of=of.output,
            source=of.design,
        )


def _predictions(view: ArchiveView, of: MeasuredRows, beyond: MeasuredRows) -> Iterator[Chart]:
    """Yield what a posterior predicts beside what was measured, against conditions."""
    series, unit = view.series(of.design), unit_suffix(of.unit)
    predicted = np.asarray(of.scale.from_si(beyond.statistics["prediction"].values))
    hovers = [
        f"row {beyond.label(row)}: predicted {number_text(float(each), 5)}{unit}"
        for row, each in enumerate(predicted[:, 0])
    ]
    bars = _bars(of.values("measured"), of.values("measured_std"))
    labels = [f"measured in {of.label(row)}" for row in range(len(bars))]
    for name, (own_unit, values) in [*of.conditions.items()][:_MOST_CONDITIONS]:
        known = beyond.statistics["condition"].sel({MEASURED_CONDITION: name}).values
        where = np.asarray(scale(own_unit).from_si(known))
        keys = [
            LegendKey("measured", "ink", "circle"),
            LegendKey("predicted", series, "square"),
            LegendKey("predicted, no interval", series, "square-open"),
        ]
        yield Chart(
            title=f"predictions against {name}",
            summary=f"{count_text(len(where), 'prediction')} of {of.output} against {name}.",
            x=Axis(title_with_unit(name, own_unit)),
            y=Axis(title_with_unit(of.output, of.unit)),
            marks=(
                Dots(bars, values, "ink", labels, "measured", along="y"),
                Dots(predicted, where, series, hovers, "predicted", "square", along="y"),
            ),
            keys=tuple(keys[: 2 + bool(np.isnan(predicted).any())]),
            of=of.output,
            source=of.design,
        )


def _curves(
    view: ArchiveView, of: MeasuredRows, along: str, predicted: FloatArray, std: FloatArray
) -> Iterator[Chart]:
    """Yield the curve of each experiment with its measured points."""
    unit, places = of.conditions[along]
    numbers = of.statistics["experiment_number"].values
    hovers, series = _hovers(of, predicted), view.series(of.design)
    for number in np.unique(numbers)[:_MOST_CURVES].tolist():
        own = np.flatnonzero(numbers == number)
        order = own[np.argsort(places[own], kind="stable")]
        x, middle, spread = places[order], predicted[order], _BARS * std[order]
        marks: list[Mark] = []
        if spread.any():
            marks.append(Band(x, middle - spread, middle + spread, series))
        bars = _bars(of.values("measured")[own], of.values("measured_std")[own])
        marks += [
            Line(x, middle, series, name="model"),
            Dots(bars, places[own], "ink", [hovers[row] for row in own], "measured", along="y"),
        ]
        yield Chart(
            title=f"experiment {number}" if len(np.unique(numbers)) > 1 else "curve",
            summary=f"{of.output} along {along}: the model and the measured points.",
            x=Axis(title_with_unit(along, unit)),
            y=Axis(title_with_unit(of.output, of.unit)),
            marks=tuple(marks),
            keys=(LegendKey("model", series, "line"), LegendKey("measured", "ink", "circle")),
            of=of.output,
            source=of.design,
        )
