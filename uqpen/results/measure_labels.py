"""Measures of the inputs' part in an output: their names for a reader, and their families."""

from __future__ import annotations

from typing import NamedTuple

__all__ = [
    "ASSOCIATIONS",
    "CATEGORY_INDICES",
    "CHANGES",
    "DESIGN_POINT_MEASURES",
    "EFFECTS",
    "EVENT_INDICES",
    "EVENT_SENSITIVITIES",
    "EXCEEDANCE_INDICES",
    "GENERALIZED_INDICES",
    "INDICES",
    "LOGARITHM_INDICES",
    "PAIR_INDICES",
    "RESPONSES",
    "SHAPLEY",
    "Measure",
]


SHAPLEY = "Shapley effect"


class Measure(NamedTuple):
    """Statistic of the inputs' part.

    Attributes
    ----------
    statistic : str
        Its name in the catalogue.
    label : str
        Its name in a table or a chart.
    marker : str
        The shape of its dots in a figure.
    """

    statistic: str
    label: str
    marker: str = "o"


def _indices(prefix: str = "") -> tuple[Measure, ...]:
    """Return the shares of a variance, of the output or of a function of it."""
    return (
        Measure(f"{prefix}first_order", "first order", "o"),
        Measure(f"{prefix}total_order", "total order", "s"),
        Measure(f"{prefix}shapley", SHAPLEY, "D"),
    )


INDICES = _indices()
LOGARITHM_INDICES = _indices("log_")
EXCEEDANCE_INDICES = _indices("exceedance_")
CATEGORY_INDICES = _indices("category_")
GENERALIZED_INDICES = _indices("generalized_")
PAIR_INDICES = (Measure("second_order", "second order"),)
RESPONSES = (
    Measure("response", "response [%]"),
    Measure("contribution", "× uncertainty [%]"),
)
CHANGES = (Measure("change_per_std", "change per sd"),)
EFFECTS = (
    Measure("mu_star", "mean |effect|", "o"),
    Measure("mu", "mean effect"),
    Measure("sigma", "sd of effects", "^"),
)
ASSOCIATIONS = (
    Measure("spearman", "Spearman"),
    Measure("pearson", "Pearson"),
    Measure("partial_rank", "partial, ranks"),
    Measure("partial", "partial"),
    Measure("delta", "delta"),
)
DESIGN_POINT_MEASURES = (
    Measure("reliability_index", "reliability index"),
    Measure("first_order_probability", "probability, first order"),
    Measure("second_order_probability", "probability, second order"),
)
EVENT_INDICES = (Measure("event_first_order", "first order"),)
EVENT_SENSITIVITIES = (
    Measure("mean_sensitivity", "mean, by one sd"),
    Measure("std_sensitivity", "sd, by itself"),
    Measure("mean_elasticity", "elasticity, mean"),
    Measure("std_elasticity", "elasticity, sd"),
    Measure("sensitivity_effective_runs", "effective runs"),
)
