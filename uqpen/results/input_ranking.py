"""Inputs by their importance for an output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import BOUND, DEPENDENCE, INPUT, RUNS
from uqpen.results.archive_view import ArchiveView
from uqpen.results.texts import plain_text

__all__ = [
    "OF_LOGARITHM",
    "InputOrder",
    "Ranking",
    "best_ranking",
    "has_dependent_inputs",
    "input_label",
    "input_order",
    "input_ranking",
]


# Measures of the inputs' part, the most telling first.
_MEASURES = ("first_order", "mu_star", "contribution", "spearman")
_OF_DEPENDENT_INPUTS = ("shapley", *_MEASURES)
# Before these, of an output that is shown by its logarithm.
OF_LOGARITHM = "log_"
_REASONS = {
    "first_order": "the largest first order",
    "shapley": "the largest Shapley effects",
    "mu_star": "the largest mean elementary effects",
    "contribution": "the largest response times uncertainty",
    "spearman": "the strongest rank correlations",
}


class Ranking(NamedTuple):
    """Estimates of one measure of all inputs by one source, the largest first."""

    statistic: str
    source: str
    estimates: Mapping[str, xr.DataArray]

    @property
    def measure(self) -> str:
        """The measure, be it of the output or of its logarithm."""
        return self.statistic.removeprefix(OF_LOGARITHM)

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
    measures = _OF_DEPENDENT_INPUTS if has_dependent_inputs(view) else _MEASURES
    if view.is_logarithmic(output):
        indices = measures[: measures.index("first_order") + 1]
        measures = (*(f"{OF_LOGARITHM}{each}" for each in indices), *measures)
    for statistic in measures:
        if found := best_ranking(view, output, statistic):
            return found
    return None


def best_ranking(view: ArchiveView, output: str, statistic: str) -> Ranking | None:
    """Return the inputs by one measure, with its best-known source; None without any."""
    found = []
    for source in view.estimates(output, statistic):
        entries = view.statistics.entries(source, output, statistic)
        known = {name: each for name, each in entries.items() if np.isfinite(each.values[0])}
        if known and not view.statistics.citation(source):
            ordered = sorted(known, key=lambda name: -abs(float(known[name].values[0])))
            found.append(Ranking(statistic, source, {name: known[name] for name in ordered}))
    return min(found, key=_width, default=None)


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


def has_dependent_inputs(view: ArchiveView) -> bool:
    """Return whether any inputs of the model depend on each other."""
    return any(DEPENDENCE in read_group(view.tree, RUNS, name).attrs for name in view.designs)


def _width(ranking: Ranking) -> tuple[bool, float]:
    first = next(iter(ranking.estimates.values()))
    _, lower, upper = first.values
    is_known = bool(np.isfinite([lower, upper]).all())
    return not is_known, float(upper - lower) if is_known else 0.0
