"""Inputs by their importance for an output: the measure that ranks them, and their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE, MEASURES
from uqpen.core.labels import BOUND, INPUT, OF_LOGARITHM
from uqpen.core.statistic import Statistic
from uqpen.results.archive_view import ArchiveView
from uqpen.results.input_measures import index_titles
from uqpen.results.texts import plain_text

__all__ = [
    "InputOrder",
    "Ranking",
    "best_ranking",
    "input_label",
    "input_order",
    "input_ranking",
]

# Measures that the inputs can be ordered by, the most telling first.
_MEASURES = sorted(
    (each for each in CATALOGUE.values() if each.measure.reason),
    key=lambda each: each.measure.rank,
)


class Ranking(NamedTuple):
    """Estimates of one measure of all inputs by one source, the largest first."""

    statistic: Statistic
    source: str
    estimates: Mapping[str, xr.DataArray]

    @property
    def is_of_logarithm(self) -> bool:
        """True if it is of the logarithm of the output."""
        return self.statistic.prefix == OF_LOGARITHM

    @property
    def divides(self) -> bool:
        """True if its estimates add up to the variance, also where inputs depend on each other."""
        return self.statistic.measure.share == "divided"


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

    Of an output that is shown by its logarithm, the measures of that come first. What divides a
    variance comes first where the inputs depend on each other. Where they do not, the parts that
    they cause alone add up as well, and nothing is ranked by it.
    """
    shares = index_titles(view.tree)
    for prefix in (OF_LOGARITHM, "") if view.is_logarithmic(output) else ("",):
        for statistic in shares.ordered(_MEASURES):
            is_telling = shares.is_dependent or statistic.measure.share != "divided"
            if statistic.prefix != prefix or not is_telling:
                continue
            if ranking := best_ranking(view, output, statistic):
                return ranking
    return None


def best_ranking(view: ArchiveView, output: str, statistic: Statistic) -> Ranking | None:
    """Return the inputs by a measure, by the source with the narrowest interval of the largest.

    One without intervals is taken only where there is no other. None where no source has an
    estimate of its own.
    """
    found: list[tuple[float, Ranking]] = []
    for source in view.estimates(output, statistic.name):
        entries = view.statistics.entries(source, output, statistic.name)
        known = {name: each for name, each in entries.items() if np.isfinite(each.values[0])}
        if not known or view.statistics.citation(source):
            continue
        ordered = sorted(known, key=lambda name: -abs(float(known[name].values[0])))
        _, lower, upper = known[ordered[0]].values.tolist()
        width = upper - lower if np.isfinite([lower, upper]).all() else np.inf
        estimates = {str(name): known[name] for name in ordered}
        found.append((width, Ranking(statistic, source, estimates)))
    return min(found, key=lambda each: each[0])[1] if found else None


def input_order(view: ArchiveView, output: str) -> InputOrder:
    """Return the inputs in the order of their importance; without names if it is unknown."""
    if ranking := input_ranking(view, output):
        of = " of the logarithm" * ranking.is_of_logarithm
        reason = f"{ranking.statistic.measure.reason}{of} by {ranking.source}"
        return InputOrder(tuple(ranking.estimates), reason)
    of_category = MEASURES["categories"][0]
    for source, array in view.estimates(output, of_category.name).items():
        largest = np.nan_to_num(array.isel({BOUND: 0})).max(axis=0)
        if largest.any():
            names = array[INPUT].values[np.argsort(-largest, kind="stable")]
            return InputOrder(tuple(names.tolist()), f"{of_category.measure.reason} by {source}")
    return InputOrder()
