"""Catalogue of statistics: the meaning of each number of an archive.

A record gives the dimensions of a statistic, its unit, how a study asks for it, the functions that
estimate it, and its words and place where it is shown. All code that reads, estimates, writes,
checks or shows a statistic takes its record from here; nobody parses a name. A statistic that is
not in the catalogue is described by its own variable, and shown from that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from types import MappingProxyType

from uqpen.core.labels import (
    BOUNDS,
    BUDGET,
    EXCEEDANCE,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    MOMENTS,
    NOTE,
    PAIR,
    QUANTILES,
    RANK,
    REPEAT,
    REPLICATES_OF_BUDGET,
    RESERVED,
    RUNS_OF_BUDGET,
    SHARES,
    STATUS,
    TAILS,
    VARIANT,
)
from uqpen.core.statistic import EntryDimension, Request, Shown, Statistic, UnitRule
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
    "BENCHMARK_STATISTICS",
    "CATALOGUE",
    "COMPARISON_DIMENSIONS",
    "COMPARISON_STATISTICS",
    "DIMENSIONS",
    "FAILURE_STATISTICS",
    "INTERVAL_RECIPE",
    "JOINT_STATISTICS",
    "METHOD_STATISTICS",
    "MODEL_FORM_STATISTICS",
    "NAMES_IN_USE",
    "REQUESTED",
    "REQUESTED_DIMENSIONS",
    "TABLE_COLUMNS",
    "UNLISTED_DIMENSIONS",
    "comparison_statistics",
    "method_statistics",
]


# Where the functions that estimate statistics stand.
_CDF = "uqpen.statistics.distribution_function"
_MOMENTS = "uqpen.statistics.moments.sample_moments"
_FIELDS = "uqpen.statistics.fields"
_PLACES = f"{_FIELDS}.place_statistics"

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


def _contents(name: str) -> EntryDimension:
    """Return the dimension of the shares that tolerance limits hold."""
    return EntryDimension(name, companions={f"{name.removesuffix('_level')}_runs_needed": "count"})


def _thresholds(name: str) -> EntryDimension:
    """Return the dimension of the values that probabilities are of, as they were written."""
    return EntryDimension(name, "text", {f"{name}_value": "number"}, _accepted(name))


def _accepted(name: str) -> dict[str, str]:
    """Return the coordinates of the acceptance limits along a dimension."""
    return {f"{name}_at_most": "number", f"{name}_at_least": "number"}


_STATISTICS = [
    Statistic(
        "mean",
        "mean",
        unit=UnitRule.VALUE,
        shown=Shown("mean", 30, is_compared=True),
        group=MOMENTS,
        by={"sample": f"{_MOMENTS}:sample_moments", "field": f"{_PLACES}:moments_at_places"},
        is_of_surrogates=True,
    ),
    Statistic(
        "std",
        "standard deviation",
        unit=UnitRule.DIFFERENCE,
        shown=Shown("sd", 32, is_compared=True),
    ),
    Statistic(
        "half_spread",
        "half the 16 % to 84 % range",
        unit=UnitRule.DIFFERENCE,
        shown=Shown("half 16–84 % range", 33),
    ),
    Statistic("skewness", "skewness", shown=Shown("skewness", 34)),
    Statistic("kurtosis", "kurtosis"),
    Statistic("effective_runs", "effective number of runs"),
    Statistic("effective_size", "effective sample size", shown=Shown("effective runs", 20)),
    Statistic(
        "quantile",
        "quantile",
        (PROBABILITY,),
        UnitRule.VALUE,
        own=EntryDimension(PROBABILITY),
        asked=Request("quantiles", always=(0.05, 0.5, 0.95)),
        shown=Shown("{entry}", 40, "quantiles", "quantile", rank=22, is_compared=True),
        group=QUANTILES,
        by={
            "sample": f"{_CDF}.quantiles:quantile_estimates",
            "field": f"{_PLACES}:quantiles_at_places",
        },
        is_of_surrogates=True,
    ),
    Statistic(
        "tolerance_limit",
        "upper tolerance limit",
        (CONTENT_LEVEL,),
        UnitRule.VALUE,
        own=_contents(CONTENT_LEVEL),
        asked=Request(
            "hold", "value held with {entry}", "tolerance_contents", refusal="a tolerance limit"
        ),
        shown=Shown("not exceeded, {entry}", 80, "hold", "percent", ends="at most", rank=10),
        group="holds",
        by={"sample": f"{_CDF}.tolerance:tolerance_limits"},
    ),
    Statistic(
        "lower_tolerance_limit",
        "lower tolerance limit",
        (LOWER_CONTENT,),
        UnitRule.VALUE,
        own=_contents(LOWER_CONTENT),
        asked=Request(
            "hold_above",
            "value held from below with {entry}",
            "lower_tolerance_contents",
            refusal="a tolerance limit",
        ),
        shown=Shown("not below, {entry}", 81, "hold_above", "percent", ends="at least", rank=11),
        group="holds",
        by={"sample": f"{_CDF}.tolerance:lower_tolerance_limits"},
    ),
    Statistic(
        "tolerance_interval",
        "tolerance interval",
        (INTERVAL_CONTENT,),
        UnitRule.VALUE,
        own=_contents(INTERVAL_CONTENT),
        asked=Request(
            "hold_between", "values held between with {entry}", "tolerance_interval_contents"
        ),
        shown=Shown(
            "tolerance interval, {entry}", 82, "hold_between", "percent", ends="between", rank=12
        ),
        group="holds",
        by={"sample": f"{_CDF}.tolerance:tolerance_intervals"},
    ),
    Statistic(
        "expected_shortfall",
        "mean beyond a quantile",
        (SHORTFALL_LEVEL,),
        UnitRule.VALUE,
        takes_all_values=True,
        own=EntryDimension(SHORTFALL_LEVEL),
        asked=Request(
            "expected_shortfall",
            "mean beyond the quantile {entry}",
            declared_by="uqpen.core.settings:probabilities",
            refusal="an expected shortfall",
        ),
        shown=Shown(
            "mean beyond the {entry}",
            50,
            "expected_shortfall",
            "quantile",
            rank=30,
            sentence="Beyond its {entry}, the mean of {output} is {estimate}.",
            is_compared=True,
        ),
        group=TAILS,
        by={"sample": f"{_CDF}.expected_shortfall:expected_shortfalls"},
        is_of_surrogates=True,
    ),
    Statistic(
        "return_level",
        "return level",
        (RETURN_PERIOD,),
        UnitRule.VALUE,
        takes_all_values=True,
        own=EntryDimension(RETURN_PERIOD),
        asked=Request(
            "return_periods",
            "value exceeded once in {entry} cases",
            declared_by="uqpen.core.settings:periods",
            refusal="a return level",
        ),
        shown=Shown(
            "exceeded once in {entry} cases",
            60,
            "return_levels",
            "number",
            rank=31,
            sentence="Once in {entry}\u00a0cases on average, {output} exceeds {estimate}.",
            is_compared=True,
        ),
        group=TAILS,
        by={"sample": f"{_CDF}.return_levels:return_levels"},
    ),
    Statistic(
        "tail_threshold",
        "threshold of the fitted tail",
        unit=UnitRule.VALUE,
        shown=Shown("threshold of the tail", 61),
    ),
    Statistic("tail_shape", "shape of the fitted tail", shown=Shown("shape of the tail", 62)),
    Statistic("tail_scale", "scale of the fitted tail", unit=UnitRule.DIFFERENCE),
    Statistic("tail_runs", "number of runs beyond the threshold of the fitted tail"),
    Statistic("tail_p_value", "p-value of the fit of the tail (Anderson-Darling)"),
    Statistic(
        "exceedance",
        "probability of exceeding a value",
        (THRESHOLD,),
        own=_thresholds(THRESHOLD),
        asked=Request("exceeds", field="thresholds"),
        shown=Shown(
            "P(> {entry})",
            70,
            "exceedance",
            rank=20,
            axis="probability",
            is_compared=True,
            has_verdict=True,
        ),
        group=EXCEEDANCE,
        by={
            "sample": f"{_CDF}.probabilities:exceedance_probabilities",
            "field": f"{_PLACES}:probabilities_at_places",
        },
        is_of_surrogates=True,
    ),
    Statistic(
        "below",
        "probability of lying below a value",
        (LOWER_THRESHOLD,),
        own=_thresholds(LOWER_THRESHOLD),
        asked=Request("below", field="lower_thresholds"),
        shown=Shown(
            "P(< {entry})",
            71,
            "below",
            rank=21,
            axis="probability",
            is_compared=True,
            has_verdict=True,
        ),
        group=EXCEEDANCE,
        by={"sample": f"{_CDF}.probabilities:below_probabilities"},
        is_of_surrogates=True,
    ),
    Statistic(
        "share",
        "probability of a category",
        (CATEGORY,),
        own=EntryDimension(CATEGORY, "text", {"category_label": "text"}),
        shown=Shown(
            "share {entry}",
            72,
            "shares",
            coordinate="category_label",
            axis="share",
            is_compared=True,
        ),
        group=SHARES,
        by={"sample": f"{_CDF}.probabilities:category_probabilities"},
    ),
    Statistic(
        "cdf",
        "distribution function, pointwise bounds",
        (RANK,),
        own=EntryDimension(RANK, is_listed=False),
        group="cdfs",
        by={"sample": f"{_CDF}.cdfs:cdf"},
        is_of_surrogates=True,
    ),
    Statistic("cdf_band", "distribution function, simultaneous bounds", (RANK,)),
    Statistic("cdf_value", "value of the output", (RANK,), UnitRule.VALUE, has_bounds=False),
    Statistic(
        "percentile",
        "percentile",
        (PERCENT,),
        UnitRule.VALUE,
        own=EntryDimension(PERCENT, is_listed=False),
        group="percentiles",
        by={"sample": f"{_CDF}.quantiles:percentiles"},
    ),
    Statistic(
        "reached",
        "probability that a curve reaches a place",
        shown=Shown("P(reached)", 10),
        group="reached",
        by={"field": f"{_PLACES}:reached"},
    ),
    Statistic(
        "mean_band",
        "mean, simultaneous bounds",
        unit=UnitRule.VALUE,
        shown=Shown("mean, all places at once", 31),
        group="bands",
        by={"field": f"{_FIELDS}.simultaneous_bands:mean_band"},
    ),
    Statistic(
        "quantile_band",
        "quantile, simultaneous bounds",
        (PROBABILITY,),
        UnitRule.VALUE,
        shown=Shown("{entry}, all places at once", 41, "quantile_bands", "quantile"),
        group="bands",
        by={"field": f"{_FIELDS}.simultaneous_bands:quantile_band"},
    ),
    Statistic(
        "tolerance_band",
        "tolerance band",
        (BAND_CONTENT,),
        UnitRule.VALUE,
        own=_contents(BAND_CONTENT),
        shown=Shown("tolerance band, {entry}", 83, "tolerance_bands", "percent"),
        group="bands",
        by={"field": f"{_FIELDS}.tolerance_band:tolerance_band"},
    ),
    Statistic(
        "central_region",
        "median curve and central region",
        unit=UnitRule.VALUE,
        group="ranked_curves",
        by={"field": f"{_FIELDS}.ranked_curves:ranked_curves"},
    ),
    Statistic("envelope", "median curve and range without outlying curves", unit=UnitRule.VALUE),
    Statistic(
        "band_depth",
        "modified band depth",
        (CURVE,),
        has_bounds=False,
        own=EntryDimension(CURVE, "count", is_listed=False),
    ),
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
        Statistic(
            "joint_probability",
            "probability of an event of several outputs",
            (EVENT,),
            own=EntryDimension(EVENT, "text", {"event_condition": "text"}, _accepted(EVENT)),
        ),
        Statistic(
            "event_first_order",
            "first-order Sobol' index of an event",
            (SENSITIVITY_EVENT, INPUT),
            note_is_of_estimate=True,
            own=EntryDimension(SENSITIVITY_EVENT, "text"),
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
            Statistic(
                name,
                title,
                (DESIGN_POINT,),
                note_is_of_estimate=True,
                own=EntryDimension(DESIGN_POINT, "count", {"design_point_run": "count"}),
            )
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

# Statistics by which the methods of a study are compared at equal budgets.
BENCHMARK_STATISTICS = tuple(CATALOGUE[name] for name in ("mean", "std", "quantile", "exceedance"))


def method_statistics(each: Statistic) -> Iterator[Statistic]:
    """Yield the estimates of a method by budget and repeat, and the statistics of their errors."""
    at = (BUDGET, *each.dims)
    yield replace(each, dims=(BUDGET, REPEAT, *each.dims), has_bounds=False)
    yield Statistic(
        f"{each.name}_error", f"root mean square of the relative errors of the {each.title}", at
    )
    yield Statistic(
        f"{each.name}_coverage",
        f"share of the intervals that held the reference, of the {each.title}",
        at,
        has_bounds=False,
    )
    yield Statistic(
        f"{each.name}_slope", f"slope of log error over log runs, of the {each.title}", each.dims
    )


def comparison_statistics(each: Statistic) -> Iterator[Statistic]:
    """Yield what is said of all methods at once: what errors are relative to, and the verdicts."""
    at = (VARIANT, BUDGET, *each.dims)
    title = f"what errors are relative to, of the {each.title}"
    yield Statistic(f"{each.name}_scale", title, each.dims, each.unit, has_bounds=False)
    for said, words in (
        ("winner", "method with the least error"),
        ("runner_up", "next method"),
        ("level", "methods that are level"),
        ("verdict", "verdict"),
        ("remark", "remark on the reference"),
    ):
        title = f"{words}, of the {each.title}"
        yield Statistic(f"{each.name}_{said}", title, at, has_bounds=False, kind="text")
    yield Statistic(
        f"{each.name}_lead", f"error of the next method over the least, of the {each.title}", at
    )


METHOD_STATISTICS = _by_name(list(chain(*map(method_statistics, BENCHMARK_STATISTICS))))
COMPARISON_STATISTICS = _by_name(list(chain(*map(comparison_statistics, BENCHMARK_STATISTICS))))

_ALL = (
    *CATALOGUE.values(),
    *FAILURE_STATISTICS.values(),
    *JOINT_STATISTICS.values(),
    *MODEL_FORM_STATISTICS.values(),
)

# The statistics whose entries a study requests, the same for all sources of an output: tables show
# them side by side.
REQUESTED = tuple(each for each in _ALL if each.asked.key)
REQUESTED_DIMENSIONS = frozenset(
    {*chain(*(each.dims for each in REQUESTED)), BAND_CONTENT, CATEGORY}
)

# The dimensions of statistics by their names: those that one of them describes, and those of many.
DIMENSIONS: Mapping[str, EntryDimension] = MappingProxyType(
    {
        each.name: each
        for each in (
            *(statistic.own for statistic in _ALL if statistic.own),
            EntryDimension(RUNS_SO_FAR, "count", is_listed=False),
            EntryDimension(INPUT, "text"),
            EntryDimension(PAIR, "text", {"pair_first": "text", "pair_second": "text"}),
            EntryDimension(STATUS, "text"),
        )
    }
)

# Those of a benchmark of methods as well. They are no names in use, as a field of a study may lie
# along dimensions of the same names.
COMPARISON_DIMENSIONS: Mapping[str, EntryDimension] = MappingProxyType(
    {
        **DIMENSIONS,
        BUDGET: EntryDimension(
            BUDGET, "count", optional={RUNS_OF_BUDGET: "count", REPLICATES_OF_BUDGET: "count"}
        ),
        REPEAT: EntryDimension(REPEAT, "count"),
        VARIANT: EntryDimension(VARIANT, "text"),
    }
)

# Tables and lists leave out what lies along these, unless it is asked for.
UNLISTED_DIMENSIONS = frozenset(
    name for name, dimension in DIMENSIONS.items() if not dimension.is_listed
)

# Columns of the long table of estimates; each dimension is a further one.
TABLE_COLUMNS = (
    "model", "source", "kind", "output", "statistic", "coordinates", "unit", *BOUNDS,
)  # fmt: skip

# Names that the datasets of an archive and its long table use themselves.
NAMES_IN_USE = RESERVED.union(
    TABLE_COLUMNS,
    (INTERVAL, INTERVAL_LABEL, NOTE),
    DIMENSIONS,
    *(dimension.companions for dimension in DIMENSIONS.values()),
    *(dimension.optional for dimension in DIMENSIONS.values()),
)

# The recipe by which this uqpen makes intervals: that of the statistic that was changed last.
INTERVAL_RECIPE = max(each.recipe for each in _ALL)
