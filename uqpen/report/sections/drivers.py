"""What drives an output, in sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator

import xarray as xr

from uqpen.charts.marks import has_interval
from uqpen.core.catalogue import MEASURES
from uqpen.report.sections.quoted_statistics import no_break, output_name
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text
from uqpen.results.input_measures import (
    Ranking,
    best_ranking,
    index_titles,
    input_label,
    input_ranking,
)
from uqpen.results.texts import capitalized

__all__ = ["driver_sentences"]

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
    measure = ranking.statistic.measure
    if not measure.share:
        words = {"{input}": start, "{output}": name, "{estimate}": text}
        # All in one pass, as a name may have braces itself.
        yield re.sub(r"\{\w+\}", lambda found: words[found[0]], measure.sentence)
    elif (share := float(ranking.estimates[first].values[0])) < _LEAST:
        yield f"No single input causes more than {text} of the variance of {name} by itself."
    else:
        part = f"about {_fraction(share)} of the variance of {name}"
        yield f"{start} {_share_text(view, ranking, part, text)}"
    if further := _next_inputs(view, ranking, others):
        yield f"Next: {further}."
    measure = ranking.statistic.measure
    if measure.share != "alone" or index_titles(view.tree).is_dependent:
        return
    of_total = next(each for each in MEASURES[measure.table] if each.measure.share == "total")
    total = best_ranking(view, output, of_total)
    if total is None:
        return
    shown = {
        name: _estimate_text(array)
        for name, array in total.estimates.items()
        if name in ranking.estimates and _exceeds(array, ranking.estimates[name])
    }
    if shown:
        inputs = ", ".join(f"{input_label(view, each)} ({text})" for each, text in shown.items())
        yield f"With its interactions: {inputs}."


def _share_text(view: ArchiveView, ranking: Ranking, part: str, text: str) -> str:
    if ranking.divides:
        return f"causes {part}: its Shapley effect is {text}."
    if index_titles(view.tree).is_dependent:
        return f"goes with {part} ({text}), which includes what dependent inputs share."
    return f"causes {part} by itself ({text})."


def _next_inputs(view: ArchiveView, ranking: Ranking, others: list[str]) -> str:
    measure = ranking.statistic.measure
    if not measure.share and "{estimate}" not in measure.sentence:
        shown = others[:_NEXT]
        return " and ".join(input_label(view, each) for each in shown)
    shown = [each for each in others if abs(float(ranking.estimates[each].values[0])) >= _LEAST][
        :_NEXT
    ]
    texts = {each: _estimate_text(ranking.estimates[each]) for each in shown}
    return " and ".join(f"{input_label(view, each)} ({text})" for each, text in texts.items())


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
