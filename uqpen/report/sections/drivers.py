"""Inputs by their importance for an output, in a sentence and as an order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.marks import has_interval
from uqpen.core.labels import BOUND, DEPENDENCE, INPUT, RUNS
from uqpen.report.sections.quoted_statistics import no_break, output_name
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text
from uqpen.results.texts import capitalized, plain_text

__all__ = ["Ranking", "driver_sentences", "input_label", "input_order", "input_ranking"]

# Measures of the inputs' part, the most telling first.
_MEASURES = ("first_order", "mu_star", "contribution", "spearman")
_OF_DEPENDENT_INPUTS = ("shapley", *_MEASURES)
# Before these, of an output that is shown by its logarithm.
_OF_LOGARITHM = "log_"
_REASONS = {
    "first_order": "the largest first order",
    "shapley": "the largest Shapley effects",
    "mu_star": "the largest mean elementary effects",
    "contribution": "the largest response times uncertainty",
    "spearman": "the strongest rank correlations",
}
_FRACTIONS = {
    0.1: "a tenth",
    0.2: "a fifth",
    0.25: "a quarter",
    0.33: "a third",
    0.4: "two fifths",
    0.5: "half",
    0.6: "three fifths",
    0.67: "two thirds",
    0.75: "three quarters",
    0.8: "four fifths",
    0.9: "nine tenths",
    1.0: "all",
}
# The least share of the variance that is worth a word, and that of interactions.
_LEAST, _INTERACTING = 0.05, 0.1
# Inputs that are named after the first.
_NEXT = 2


class Ranking(NamedTuple):
    """Estimates of one measure of all inputs by one source, the largest first."""

    statistic: str
    source: str
    estimates: Mapping[str, xr.DataArray]

    @property
    def measure(self) -> str:
        """The measure, be it of the output or of its logarithm."""
        return self.statistic.removeprefix(_OF_LOGARITHM)

    @property
    def is_of_logarithm(self) -> bool:
        """True if it is of the logarithm of the output."""
        return self.measure != self.statistic


class InputOrder(NamedTuple):
    """Names of inputs, the most important first, and the statistic that this goes by."""

    names: tuple[str, ...] = ()
    reason: str = ""

    def sort(self, inputs: Sequence[str]) -> list[str]:
        """Return some inputs in this order; those that it lacks come last."""
        places = {name: place for place, name in enumerate(self.names)}
        return sorted(inputs, key=lambda name: places.get(name, len(places)))


def input_label(view: ArchiveView, name: str) -> str:
    """Return the title of an input for a reader, which no other input of the model has."""
    title = view.input_titles.get(name, name)
    is_alone = list(view.input_titles.values()).count(title) < 2
    return plain_text(title if is_alone else f"{title} ({name})", 50)


def input_ranking(view: ArchiveView, output: str) -> Ranking | None:
    """Return the inputs by the first measure that the archive has, with its best-known source.

    That is the source with the narrowest interval of its largest estimate. One without intervals is
    taken only where there is no other.
    """
    measures = _OF_DEPENDENT_INPUTS if _dependence(view) else _MEASURES
    if view.is_logarithmic(output):
        indices = measures[: measures.index("first_order") + 1]
        measures = (*(f"{_OF_LOGARITHM}{each}" for each in indices), *measures)
    for statistic in measures:
        if found := list(_rankings(view, output, statistic)):
            return min(found, key=_width)
    return None


def input_order(view: ArchiveView, output: str) -> InputOrder:
    """Return the inputs in the order of their importance; without names if it is unknown."""
    if ranking := input_ranking(view, output):
        of = " of the logarithm" * ranking.is_of_logarithm
        reason = f"{_REASONS[ranking.measure]}{of} by {ranking.source}"
        return InputOrder(tuple(ranking.estimates), reason)
    for source, array in view.estimates(output, "category_first_order").items():
        largest = np.nan_to_num(array.isel({BOUND: 0})).max(axis=0)
        if largest.any():
            names = array[INPUT].values[np.argsort(-largest, kind="stable")]
            return InputOrder(tuple(names.tolist()), f"{_REASONS['first_order']} by {source}")
    return InputOrder()


def _dependence(view: ArchiveView) -> bool:
    return any(DEPENDENCE in read_group(view.tree, RUNS, name).attrs for name in view.designs)


def _rankings(view: ArchiveView, output: str, statistic: str) -> Iterator[Ranking]:
    for source in view.estimates(output, statistic):
        entries = view.statistics.entries(source, output, statistic)
        known = {name: each for name, each in entries.items() if np.isfinite(each.values[0])}
        if not known or view.statistics.citation(source):
            continue
        ordered = sorted(known, key=lambda name: -abs(float(known[name].values[0])))
        yield Ranking(statistic, source, {str(name): known[name] for name in ordered})


def _width(ranking: Ranking) -> tuple[bool, float]:
    first = next(iter(ranking.estimates.values()))
    _, lower, upper = first.values
    is_known = bool(np.isfinite([lower, upper]).all())
    return not is_known, float(upper - lower) if is_known else 0.0


def driver_sentences(view: ArchiveView, output: str) -> Iterator[str]:
    """Yield what drives an output: the most important input, the next ones, interactions."""
    ranking = input_ranking(view, output)
    if ranking is None:
        return
    name, (first, *others) = output_name(view, output), list(ranking.estimates)
    name = f"the logarithm of {name}" if ranking.is_of_logarithm else name
    text = _estimate_text(ranking.estimates[first])
    if not has_interval(ranking.estimates[first].values):
        text = f"{text} by {ranking.source}, without an interval"
    start = capitalized(input_label(view, first))
    if ranking.measure in ("first_order", "shapley"):
        share = float(ranking.estimates[first].values[0])
        if share < _LEAST:
            yield f"No single input causes more than {text} of the variance of {name} by itself."
        else:
            part = f"about {_fraction(share)} of the variance of {name}"
            yield f"{start} {_share_text(view, ranking, part, text)}"
    elif ranking.statistic == "spearman":
        yield f"{start} has the strongest rank correlation with {name} ({text})."
    else:
        yield f"{start} changes {name} most ({_MEASURE_TEXTS[ranking.statistic]})."
    if further := _next_inputs(view, ranking, others):
        yield f"Next: {further}."
    yield from _interactions(view, output, ranking)


_MEASURE_TEXTS = {
    "mu_star": "by its mean elementary effect",
    "contribution": "by its response at the nominal point times its uncertainty",
}


def _share_text(view: ArchiveView, ranking: Ranking, part: str, text: str) -> str:
    if ranking.measure == "shapley":
        return f"causes {part}: its Shapley effect is {text}."
    if _dependence(view):
        return f"goes with {part} ({text}), which includes what dependent inputs share."
    return f"causes {part} by itself ({text})."


def _next_inputs(view: ArchiveView, ranking: Ranking, others: list[str]) -> str:
    if ranking.statistic in ("mu_star", "contribution"):
        shown = others[:_NEXT]
        return " and ".join(input_label(view, each) for each in shown)
    shown = [each for each in others if abs(float(ranking.estimates[each].values[0])) >= _LEAST][
        :_NEXT
    ]
    texts = {each: _estimate_text(ranking.estimates[each]) for each in shown}
    return " and ".join(f"{input_label(view, each)} ({text})" for each, text in texts.items())


def _interactions(view: ArchiveView, output: str, ranking: Ranking) -> Iterator[str]:
    """Yield the inputs whose interactions count, by the best-known total order."""
    prefix = _OF_LOGARITHM * ranking.is_of_logarithm
    totals = list(_rankings(view, output, f"{prefix}total_order"))
    if ranking.measure != "first_order" or not totals or _dependence(view):
        return
    total = min(totals, key=_width)
    shown = {
        name: _estimate_text(array)
        for name, array in total.estimates.items()
        if name in ranking.estimates and _exceeds(array, ranking.estimates[name])
    }
    if shown:
        inputs = ", ".join(f"{input_label(view, each)} ({text})" for each, text in shown.items())
        yield f"With its interactions: {inputs}."


def _exceeds(total: xr.DataArray, first: xr.DataArray) -> bool:
    """Return whether a total order is above a first order by more than their intervals."""
    beyond = float(total.values[0] - first.values[0]) > _INTERACTING
    if has_interval(total.values) and has_interval(first.values):
        return beyond and bool(total.values[1] > first.values[2])
    return beyond


def _fraction(share: float) -> str:
    nearest = min(_FRACTIONS, key=lambda each: abs(each - share))
    return _FRACTIONS[nearest]


def _estimate_text(array: xr.DataArray) -> str:
    return no_break(estimate_text(*array.values.tolist()))
