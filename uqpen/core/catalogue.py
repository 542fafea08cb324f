"""Catalogue of statistics: the meaning of each number of an archive.

An entry gives the dimensions of a statistic, its unit and its name for display. All code that
writes, checks or shows a statistic reads its entry here; nobody parses a name. A statistic that is
not in the catalogue is described by its own variable, and shown from that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from uqpen.core.labels import INPUT, PAIR, RANK, STATUS
from uqpen.core.statistic_dimensions import (
    BAND_CONTENT,
    CATEGORY,
    CONTENT_LEVEL,
    CURVE,
    DESIGN_POINT,
    EVENT,
    INTERVAL_CONTENT,
    LOWER_CONTENT,
    LOWER_THRESHOLD,
    PERCENT,
    PROBABILITY,
    RETURN_PERIOD,
    RUNS_SO_FAR,
    SENSITIVITY_EVENT,
    SHORTFALL_LEVEL,
    THRESHOLD,
)

__all__ = [
    "CATALOGUE",
    "FAILURE_STATISTICS",
    "INTERVAL_RECIPE",
    "JOINT_STATISTICS",
    "MODEL_FORM_STATISTICS",
    "Statistic",
    "UnitRule",
]


class UnitRule(Enum):
    """Relation of a statistic's unit to the unit of its output."""

    VALUE = "a value of the output"
    """Converted with the offset of the unit: 0 degC is 273.15 K."""
    DIFFERENCE = "a difference of two values of the output"
    """Converted by the factor of the unit alone."""
    NONE = "a plain number"


@dataclass(frozen=True)
class Statistic:
    """Description of a statistic.

    Parameters
    ----------
    name : str
        Name of its variable in an archive.
    title : str
        Name for display.
    dims : tuple of str
        Its dimensions, keys of `DIMENSIONS`; an estimate has ``bound`` behind them. That of a field
        has the dimensions of the field before them.
    unit : UnitRule
        Relation of its unit to that of the output.
    has_bounds : bool
        Whether it is an estimate with bounds; a place on an axis, say, is none.
    note_is_of_estimate : bool
        Whether a note concerns the estimate rather than its interval.
    recipe : int
        Version of the recipe that its interval is made by: the number of the last change. Whoever
        changes how the interval is made takes the next number after `INTERVAL_RECIPE`.
    """

    name: str
    title: str
    dims: tuple[str, ...] = ()
    unit: UnitRule = UnitRule.NONE
    has_bounds: bool = True
    note_is_of_estimate: bool = False
    recipe: int = 1

    @property
    def is_function(self) -> bool:
        """True for a distribution function, which is checked and shown as a whole."""
        return RANK in self.dims


_INDICES = {
    "first_order": "first-order Sobol' index",
    "total_order": "total-order Sobol' index",
    "shapley": "Shapley effect",
}


def _indices(prefix: str, of: str, *along: str) -> list[Statistic]:
    """Return the three shares of a variance, of the output or of a function of it."""
    return [
        Statistic(
            f"{prefix}{name}",
            f"{title}{of}",
            (*along, INPUT),
            note_is_of_estimate=True,
        )
        for name, title in _INDICES.items()
    ]


_STATISTICS = [
    Statistic("mean", "mean", unit=UnitRule.VALUE),
    Statistic("std", "standard deviation", unit=UnitRule.DIFFERENCE),
    Statistic("half_spread", "half the 16 % to 84 % range", unit=UnitRule.DIFFERENCE),
    Statistic("skewness", "skewness"),
    Statistic("kurtosis", "kurtosis"),
    Statistic("effective_runs", "effective number of runs"),
    Statistic("effective_size", "effective sample size"),
    Statistic("quantile", "quantile", (PROBABILITY,), UnitRule.VALUE),
    Statistic("tolerance_limit", "upper tolerance limit", (CONTENT_LEVEL,), UnitRule.VALUE),
    Statistic("lower_tolerance_limit", "lower tolerance limit", (LOWER_CONTENT,), UnitRule.VALUE),
    Statistic("tolerance_interval", "tolerance interval", (INTERVAL_CONTENT,), UnitRule.VALUE),
    Statistic("expected_shortfall", "mean beyond a quantile", (SHORTFALL_LEVEL,), UnitRule.VALUE),
    Statistic("return_level", "return level", (RETURN_PERIOD,), UnitRule.VALUE),
    Statistic("tail_threshold", "threshold of the fitted tail", unit=UnitRule.VALUE),
    Statistic("tail_shape", "shape of the fitted tail"),
    Statistic("tail_scale", "scale of the fitted tail", unit=UnitRule.DIFFERENCE),
    Statistic("tail_runs", "number of runs beyond the threshold of the fitted tail"),
    Statistic("tail_p_value", "p-value of the fit of the tail (Anderson-Darling)"),
    Statistic("exceedance", "probability of exceeding a value", (THRESHOLD,)),
    Statistic("below", "probability of lying below a value", (LOWER_THRESHOLD,)),
    Statistic("share", "probability of a category", (CATEGORY,)),
    Statistic("cdf", "distribution function, pointwise bounds", (RANK,)),
    Statistic("cdf_band", "distribution function, simultaneous bounds", (RANK,)),
    Statistic("cdf_value", "value of the output", (RANK,), UnitRule.VALUE, has_bounds=False),
    Statistic("percentile", "percentile", (PERCENT,), UnitRule.VALUE),
    Statistic("reached", "probability that a curve reaches a place"),
    Statistic("mean_band", "mean, simultaneous bounds", unit=UnitRule.VALUE),
    Statistic("quantile_band", "quantile, simultaneous bounds", (PROBABILITY,), UnitRule.VALUE),
    Statistic("tolerance_band", "tolerance band", (BAND_CONTENT,), UnitRule.VALUE),
    Statistic("central_region", "median curve and central region", unit=UnitRule.VALUE),
    Statistic("envelope", "median curve and range without outlying curves", unit=UnitRule.VALUE),
    Statistic("band_depth", "modified band depth", (CURVE,), has_bounds=False),
    Statistic("outlying", "whether a curve is outlying", (CURVE,), has_bounds=False),
    *(
        Statistic(f"convergence_{name}", f"{title}, by the runs so far", (RUNS_SO_FAR, *dims), unit)
        for name, title, dims, unit in (
            ("mean", "mean", (), UnitRule.VALUE),
            ("quantile", "quantile", (PROBABILITY,), UnitRule.VALUE),
            ("exceedance", "probability of exceeding a value", (THRESHOLD,), UnitRule.NONE),
            ("below", "probability of lying below a value", (LOWER_THRESHOLD,), UnitRule.NONE),
            ("share", "probability of a category", (CATEGORY,), UnitRule.NONE),
        )
    ),
    *_indices("", ""),
    Statistic(
        "second_order",
        "second-order Sobol' index",
        (PAIR,),
        note_is_of_estimate=True,
    ),
    # Of a whole field: along its places, each input has one.
    *(
        Statistic(
            f"generalized_{name}",
            f"generalized {_INDICES[name]}",
            (INPUT,),
            note_is_of_estimate=True,
        )
        for name in ("first_order", "total_order")
    ),
    *_indices("log_", " of the logarithm"),
    *_indices("exceedance_", " of exceeding a value", THRESHOLD),
    *_indices("category_", " of a category", CATEGORY),
    *(
        Statistic(name, title, (INPUT,), unit, note_is_of_estimate=True)
        for name, title, unit in (
            ("pearson", "Pearson correlation", UnitRule.NONE),
            ("spearman", "Spearman rank correlation", UnitRule.NONE),
            ("partial", "partial correlation", UnitRule.NONE),
            ("partial_rank", "partial rank correlation", UnitRule.NONE),
            ("delta", "moment-independent delta", UnitRule.NONE),
            ("mu", "mean elementary effect", UnitRule.DIFFERENCE),
            ("mu_star", "mean absolute elementary effect", UnitRule.DIFFERENCE),
            ("sigma", "standard deviation of the elementary effects", UnitRule.DIFFERENCE),
            ("response", "relative response", UnitRule.NONE),
            ("contribution", "contribution to the relative uncertainty", UnitRule.NONE),
            ("change_per_std", "change per standard deviation of an input", UnitRule.DIFFERENCE),
        )
    ),
]

_FAILURE_STATISTICS = [
    Statistic("probability", "probability that a run ends so", (STATUS,)),
    Statistic("larger", "probability that an input is larger in a failed run", (INPUT,)),
    Statistic("further_out", "probability that an input is further out in a failed run", (INPUT,)),
    Statistic("lowest", "lowest value in a failed run", (INPUT,), has_bounds=False),
    Statistic("highest", "highest value in a failed run", (INPUT,), has_bounds=False),
]


def _by_name(statistics: list[Statistic]) -> Mapping[str, Statistic]:
    return MappingProxyType({each.name: each for each in statistics})


CATALOGUE = _by_name(_STATISTICS)

# Statistics of a design's runs as a whole, of no output in particular.
FAILURE_STATISTICS = _by_name(_FAILURE_STATISTICS)

# Statistics of a design's runs that concern several outputs.
JOINT_STATISTICS = _by_name(
    [
        Statistic("joint_probability", "probability of an event of several outputs", (EVENT,)),
        Statistic(
            "event_first_order",
            "first-order Sobol' index of an event",
            (SENSITIVITY_EVENT, INPUT),
            note_is_of_estimate=True,
        ),
        *(
            Statistic(name, title, (SENSITIVITY_EVENT, INPUT), note_is_of_estimate=True)
            for name, title in (
                ("mean_sensitivity", "change of an event's probability with a mean"),
                ("std_sensitivity", "change of an event's probability with a standard deviation"),
                ("mean_elasticity", "elasticity of an event's probability to a mean"),
                ("std_elasticity", "elasticity of an event's probability to a standard deviation"),
                ("sensitivity_effective_runs", "effective number of runs with an event"),
            )
        ),
        *(
            Statistic(name, title, (DESIGN_POINT,), note_is_of_estimate=True)
            for name, title in (
                ("reliability_index", "distance of a design point from the median"),
                ("first_order_probability", "probability beyond the plane at a design point"),
                ("second_order_probability", "probability beyond the paraboloid at a design point"),
            )
        ),
        Statistic(
            "importance_factor",
            "share of an input in the direction to a design point",
            (DESIGN_POINT, INPUT),
            note_is_of_estimate=True,
        ),
    ]
)

# Shares of the variance over several models, which count the same.
_MODEL_FORM_SHARES = {
    "model_form_share": "share of the variance between models",
    "parameter_share": "share of the variance between inputs",
    "interaction_share": "share of the variance of models and inputs together",
}
MODEL_FORM_STATISTICS = _by_name(
    [
        *(Statistic(name, title) for name, title in _MODEL_FORM_SHARES.items()),
        *(
            Statistic(f"exceedance_{name}", f"{title}, of exceeding a value", (THRESHOLD,))
            for name, title in _MODEL_FORM_SHARES.items()
        ),
    ]
)

# The recipe by which this uqpen makes intervals: that of the statistic that was changed last.
INTERVAL_RECIPE = max(
    each.recipe
    for each in (
        *CATALOGUE.values(),
        *FAILURE_STATISTICS.values(),
        *JOINT_STATISTICS.values(),
        *MODEL_FORM_STATISTICS.values(),
    )
)
