"""Titles of indices of the inputs' part in a variance; they overlap where inputs are dependent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import DEPENDENCE, RUNS
from uqpen.results.measure_labels import Measure

__all__ = ["VarianceTitles", "has_dependent_inputs", "index_titles"]


class VarianceTitles(NamedTuple):
    """Titles, order and note of the indices of a model's inputs.

    Attributes
    ----------
    is_dependent : bool
        Whether the random inputs depend on each other.
    """

    is_dependent: bool

    def title(self, of: str) -> str:
        """Return the title of indices of a variance, such as ``"its variance"``."""
        if self.is_dependent:
            return f"{of} explained by inputs that depend on each other"
        return f"shares of {of}"

    @property
    def axis(self) -> str:
        """Title of the axis of a chart."""
        return "explained part of the variance" if self.is_dependent else "share of the variance"

    def ordered(self, measures: Sequence[Measure]) -> tuple[Measure, ...]:
        """Return measures in the order that they are shown; first those that divide the variance.

        Of dependent inputs only Shapley effects do.
        """
        if not self.is_dependent:
            return tuple(measures)
        return tuple(sorted(measures, key=lambda each: not each.statistic.endswith("shapley")))

    @property
    def note(self) -> str:
        """Note on reading the indices of dependent inputs; empty for independent ones."""
        if not self.is_dependent:
            return ""
        return (
            "The inputs depend on each other. The first-order index of an input includes what it "
            "shares with others, so these indices can add up to more than 1. Shapley effects "
            "divide the variance and add up to 1."
        )


def has_dependent_inputs(tree: xr.DataTree) -> bool:
    """Return whether the random inputs of a model depend on each other."""
    designs = (read_group(tree, RUNS, name) for name in group_names(tree, RUNS))
    return any(runs.attrs.get(DEPENDENCE) for runs in designs)


def index_titles(tree: xr.DataTree) -> VarianceTitles:
    """Return the titles of the indices of a model's inputs."""
    return VarianceTitles(has_dependent_inputs(tree))
