"""Measures of the inputs' part in an output: how they are called, and which stand together."""

from __future__ import annotations

from typing import NamedTuple

from uqpen.core.catalogue import CATALOGUE, UnitRule

__all__ = [
    "ASSOCIATIONS",
    "CATEGORY_INDICES",
    "EFFECTS",
    "EXCEEDANCE_INDICES",
    "INDICES",
    "LOGARITHM_INDICES",
    "PAIR_INDICES",
    "RESPONSES",
    "SENSITIVITY_MEASURES",
    "Measure",
]


class Measure(NamedTuple):
    """A statistic of the inputs' part.

    Attributes
    ----------
    statistic : str
        Its name in the catalogue.
    label : str
        How a table or a chart calls it.
    factor : float
        Its estimates are shown multiplied by this.
    """

    statistic: str
    label: str
    factor: float = 1.0

    @property
    def has_unit(self) -> bool:
        """True if its unit follows from the output's."""
        return CATALOGUE[self.statistic].unit is not UnitRule.NONE


_FIRST_ORDER, _TOTAL_ORDER, _SHAPLEY = "first order", "total order", "Shapley effect"

INDICES = (
    Measure("first_order", _FIRST_ORDER),
    Measure("total_order", _TOTAL_ORDER),
    Measure("shapley", _SHAPLEY),
)
PAIR_INDICES = (Measure("second_order", "second order"),)
LOGARITHM_INDICES = (
    Measure("log_first_order", _FIRST_ORDER),
    Measure("log_total_order", _TOTAL_ORDER),
    Measure("log_shapley", _SHAPLEY),
)
EXCEEDANCE_INDICES = (
    Measure("exceedance_first_order", _FIRST_ORDER),
    Measure("exceedance_total_order", _TOTAL_ORDER),
    Measure("exceedance_shapley", _SHAPLEY),
)
CATEGORY_INDICES = (
    Measure("category_first_order", _FIRST_ORDER),
    Measure("category_total_order", _TOTAL_ORDER),
    Measure("category_shapley", _SHAPLEY),
)
RESPONSES = (
    Measure("response", "response [%]", 100.0),
    Measure("contribution", "× uncertainty [%]", 100.0),
)
EFFECTS = (
    Measure("mu_star", "mean |effect|"),
    Measure("mu", "mean effect"),
    Measure("sigma", "sd of effects"),
)
ASSOCIATIONS = (
    Measure("spearman", "Spearman"),
    Measure("pearson", "Pearson"),
    Measure("partial_rank", "partial, ranks"),
    Measure("partial", "partial"),
    Measure("delta", "delta"),
)

SENSITIVITY_MEASURES = {
    measure.statistic: measure
    for family in (
        INDICES,
        PAIR_INDICES,
        LOGARITHM_INDICES,
        EXCEEDANCE_INDICES,
        CATEGORY_INDICES,
        RESPONSES,
        EFFECTS,
        ASSOCIATIONS,
    )
    for measure in family
}
