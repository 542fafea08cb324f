"""The inputs' shares in the variance of each output."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.measures import Series, panel_of, series
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.labels import SENSITIVITY
from uqpen.summary.table import unchanged

__all__ = ["EFFECTS", "INDICES", "best", "sensitivity"]

INDICES = (
    ("first_order", "first order", "o"),
    ("total_order", "total order", "s"),
    ("shapley", "Shapley effect", "D"),
)
EFFECTS = (("mu_star", "mean |effect|", "o"), ("sigma", "sd of effects", "^"))


def sensitivity(part: Part) -> Iterator[Panel]:
    """Each input's share of the variance, and its effects."""
    for output in part.numbers:
        if found := best(part, series(part, output, INDICES)):
            title = part.titled(f"{output}: shares of its variance")
            yield panel_of(part, title, "share of the variance", found, unchanged)
    for output in part.numbers:
        if found := series(part, output, EFFECTS):
            title = part.titled(f"{output}: elementary effects")
            convert = part.measure(output).difference_from_si
            yield panel_of(part, title, _effect_on(part, output), found, convert)


def _effect_on(part: Part, output: str) -> str:
    return f"effect on {part.axis(output)}"


def best(part: Part, found: list[Series]) -> list[Series]:
    """Without what plain samples tell, unless it is asked for or there is nothing else."""
    made_for = [each for each in found if not part.is_plain(each.source)]
    if part.source is not None or made_for or not found:
        return made_for or found
    largest = max(found, key=lambda each: _runs(group(part.tree, SENSITIVITY, each.source)))
    return [each for each in found if each.source == largest.source]


def _runs(told: xr.Dataset) -> int:
    return int(told.attrs["runs"])
