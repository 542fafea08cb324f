"""Catalogue of statistics: the meaning of each number of an archive.

A record gives the dimensions of a statistic, its unit, how a study asks for it, the functions that
estimate it, and its words and place where it is shown. All code that reads, estimates, writes,
checks or shows a statistic takes its record from here; nobody parses a name. A statistic that is
not in the catalogue is described by its own variable, and shown from that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain, islice
from types import MappingProxyType

from uqpen.core.labels import (
    BAND_CONTENT,
    BLANK_ROW,
    BOUNDED_EVENT,
    BOUNDS,
    BUDGET,
    BY_RUNS,
    CATEGORY,
    COMBINATION,
    CONTENT_LEVEL,
    CONVERGENCE,
    CURVE,
    DESIGN_POINT,
    EVENT,
    EXCEEDANCE,
    EXPERIMENT,
    INPUT,
    INPUT_SHARE,
    INTERVAL,
    INTERVAL_CONTENT,
    INTERVAL_LABEL,
    LOWER_CONTENT,
    LOWER_THRESHOLD,
    MEASURED_CONDITION,
    MEASURED_ROW,
    MINIMUM,
    MOMENTS,
    MORE_SPECIMENS,
    NOISE,
    NOTE,
    OF_CATEGORY,
    OF_EXCEEDANCE,
    OF_FIELD,
    OF_LOGARITHM,
    OF_MEAN,
    OTHER_UNKNOWN,
    OUTPUT_SHARE,
    PAIR,
    PERCENT,
    PROBABILITY,
    QUANTILES,
    RANK,
    REPEAT,
    REPLICATES_OF_BUDGET,
    RESERVED,
    RETURN_PERIOD,
    RUNS_OF_BUDGET,
    RUNS_SO_FAR,
    SENSITIVITY,
    SENSITIVITY_EVENT,
    SHARES,
    SHORTFALL_LEVEL,
    SPECIMENS,
    STATUS,
    TAILS,
    THRESHOLD,
    UNKNOWN,
    VARIANT,
)
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import (
    EntryDimension,
    Measure,
    Request,
    Shown,
    Statistic,
    UnitRule,
    derived,
    of_field,
)

# Where the functions that estimate statistics stand.
_CDF = "uqpen.statistics.distribution_function"
_MOMENTS = "uqpen.statistics.moments.sample_moments"
_FIELDS = "uqpen.statistics.fields"
_PLACES = f"{_FIELDS}.field_sample"
_RARE = "uqpen.statistics.rare_events.subset_probability"
_TAILS = "uqpen.statistics.tails"
_NOISE = "uqpen.statistics.noise"
_SENSITIVITY = "uqpen.statistics.sensitivity"
_RUNS_CORRECT = "uqpen.statistics.surrogate.corrected_statistics:OutputCorrection"
_STAND_INS = "uqpen.statistics.control_variates:ControlVariates"


def _contents(name: str) -> EntryDimension:
    """Return the dimension of the shares that tolerance limits hold."""
    return EntryDimension(name, companions={f"{name.removesuffix('_level')}_runs_needed": "count"})


def _thresholds(name: str) -> EntryDimension:
    """Return the dimension of the values that probabilities are of, as they were written."""
    return EntryDimension(name, "text", {f"{name}_value": "number"}, _accepted(name))


def _accepted(name: str) -> dict[str, str]:
    """Return the coordinates of the acceptance limits along a dimension."""
    return {f"{name}_at_most": "number", f"{name}_at_least": "number"}


_OF_VALUES = [
    Statistic(
        "mean",
        "mean",
        unit=UnitRule.VALUE,
        shown=Shown("mean", 30, is_compared=True),
        group=MOMENTS,
        by={
            "sample": f"{_MOMENTS}:sample_moments",
            "part": f"{_MOMENTS}:mean_estimate",
            "field": f"{_PLACES}:moments_at_places",
            Sampling.QUADRATURE: "uqpen.statistics.moments.sample_moments:quadrature_moments",
            "corrected": f"{_RUNS_CORRECT}.mean",
            "stand_ins": f"{_STAND_INS}.mean",
        },
        takes_weights=True,
        is_of_surrogates=True,
    ),
    Statistic(
        "lower_mean",
        "lower bound of the mean over the intervals",
        unit=UnitRule.VALUE,
        note_is_of_estimate=True,
        shown=Shown("mean, lower bound", 30, rank=21),
        group=MOMENTS,
        by={Sampling.TOWARDS_BOUNDS: "uqpen.statistics.interval_bounds:output_bounds"},
    ),
    Statistic(
        "upper_mean",
        "upper bound of the mean over the intervals",
        unit=UnitRule.VALUE,
        note_is_of_estimate=True,
        shown=Shown("mean, upper bound", 31),
    ),
    Statistic(
        "std",
        "standard deviation",
        unit=UnitRule.DIFFERENCE,
        shown=Shown("sd", 32, is_compared=True),
        by={
            "corrected": f"{_RUNS_CORRECT}.std",
            "stand_ins": f"{_STAND_INS}.std",
        },
    ),
    Statistic(
        "half_spread",
        "half the 16 % to 84 % range",
        unit=UnitRule.DIFFERENCE,
        shown=Shown("half 16–84 % range", 33),
        by={
            "corrected": f"{_RUNS_CORRECT}.half_spread",
        },
    ),
    Statistic("skewness", "skewness", shown=Shown("skewness", 34)),
    # Of a model with noise of its own. They follow from several runs at each point, which are also
    # those of the mean, the standard deviation and the first-order indices then.
    Statistic(
        "noise_share",
        "share of the noise in the variance",
        shown=Shown("noise share", 35),
        group=NOISE,
        by={"repeats": f"{_NOISE}:noise_statistics"},
    ),
    Statistic(
        "noise_std",
        "standard deviation of the noise",
        unit=UnitRule.DIFFERENCE,
        shown=Shown("sd of the noise", 36),
    ),
    Statistic(
        "mean_given_inputs_std",
        "standard deviation of the mean given the inputs",
        unit=UnitRule.DIFFERENCE,
        shown=Shown("sd of the mean given the inputs", 37),
    ),
    Statistic("kurtosis", "kurtosis", is_diagnosis=True),
    Statistic("effective_runs", "effective number of runs", is_diagnosis=True),
    Statistic(
        "effective_size",
        "effective sample size",
        is_diagnosis=True,
        shown=Shown("effective runs", 20),
    ),
    Statistic(
        "quantile",
        "quantile",
        (PROBABILITY,),
        UnitRule.VALUE,
        own=EntryDimension(PROBABILITY),
        asked=Request("quantiles", always=(0.05, 0.5, 0.95)),
        shown=Shown("{entry}", 40, "quantiles", "probability", rank=22, is_compared=True),
        group=QUANTILES,
        by={
            "sample": f"{_CDF}.quantiles:quantile_estimates",
            "part": f"{_CDF}.quantiles:requested_quantiles",
            "field": f"{_PLACES}:quantiles_at_places",
            Sampling.TOWARDS_EVENT: f"{_RARE}:rare_quantiles",
            "corrected": f"{_RUNS_CORRECT}.quantiles",
            "stand_ins": f"{_STAND_INS}.quantiles",
        },
        takes_weights=True,
        is_of_surrogates=True,
    ),
    *(
        Statistic(
            f"{end}_quantile",
            f"{end} bound of the quantile over the intervals",
            (PROBABILITY,),
            unit=UnitRule.VALUE,
            note_is_of_estimate=True,
            shown=Shown(f"{{entry}}, {end} bound", 41, f"{end}_quantiles", "probability"),
        )
        for end in ("lower", "upper")
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
            "probability",
            rank=30,
            sentence="Beyond its {entry}, the mean of {output} is {estimate}.",
            is_compared=True,
        ),
        group=TAILS,
        by={"sample": f"{_CDF}.quantiles:expected_shortfalls"},
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
        by={"sample": f"{_TAILS}:return_levels"},
    ),
    Statistic(
        "tail_threshold",
        "threshold of the fitted tail",
        unit=UnitRule.VALUE,
        is_diagnosis=True,
        shown=Shown("threshold of the tail", 61),
    ),
    Statistic(
        "tail_shape",
        "shape of the fitted tail",
        is_diagnosis=True,
        shown=Shown("shape of the tail", 62),
    ),
    Statistic(
        "tail_scale", "scale of the fitted tail", unit=UnitRule.DIFFERENCE, is_diagnosis=True
    ),
    Statistic(
        "tail_runs", "number of runs beyond the threshold of the fitted tail", is_diagnosis=True
    ),
    Statistic(
        "tail_p_value", "p-value of the fit of the tail (Anderson-Darling)", is_diagnosis=True
    ),
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
            event="above",
        ),
        group=EXCEEDANCE,
        by={
            "sample": f"{_CDF}.probabilities:exceedance_probabilities",
            "part": f"{_CDF}.probabilities:requested_exceedances",
            "field": f"{_PLACES}:probabilities_at_places",
            "corrected": f"{_RUNS_CORRECT}.exceedance",
            "stand_ins": f"{_STAND_INS}.exceedance",
        },
        takes_weights=True,
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
            event="below",
        ),
        group=EXCEEDANCE,
        by={
            "sample": f"{_CDF}.probabilities:below_probabilities",
            "part": f"{_CDF}.probabilities:requested_below",
            "corrected": f"{_RUNS_CORRECT}.below",
            "stand_ins": f"{_STAND_INS}.below",
        },
        takes_weights=True,
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
        by={
            "sample": f"{_CDF}.probabilities:category_probabilities",
            "part": f"{_CDF}.probabilities:category_shares",
        },
        takes_weights=True,
    ),
    Statistic(
        "cdf",
        "distribution function, pointwise bounds",
        (RANK,),
        own=EntryDimension(RANK, is_listed=False),
        group="cdfs",
        by={
            "sample": f"{_CDF}.cdfs:cdf",
            "corrected": f"{_RUNS_CORRECT}.at_ranks",
        },
        takes_weights=True,
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
        by={
            "sample": f"{_CDF}.quantiles:percentiles",
            "corrected": f"{_RUNS_CORRECT}.quantiles",
            "stand_ins": f"{_STAND_INS}.quantiles",
        },
        takes_weights=True,
    ),
    Statistic(
        "reached",
        "probability that a curve reaches a place",
        shown=Shown("P(reached)", 10),
        group="reached",
        by={"field": f"{_PLACES}:reached"},
        takes_weights=True,
    ),
    Statistic(
        "mean_band",
        "mean, simultaneous bounds",
        unit=UnitRule.VALUE,
        shown=Shown("mean, all places at once", 31),
        group="bands",
        by={"field": f"{_FIELDS}.simultaneous_bands:mean_band"},
        takes_weights=True,
    ),
    Statistic(
        "quantile_band",
        "quantile, simultaneous bounds",
        (PROBABILITY,),
        UnitRule.VALUE,
        shown=Shown("{entry}, all places at once", 41, "quantile_bands", "probability"),
        group="bands",
        by={"field": f"{_FIELDS}.simultaneous_bands:quantile_band"},
        takes_weights=True,
    ),
    Statistic(
        "tolerance_band",
        "tolerance band",
        (BAND_CONTENT,),
        UnitRule.VALUE,
        own=_contents(BAND_CONTENT),
        shown=Shown("tolerance band, {entry}", 83, "tolerance_bands", "percent"),
        group="bands",
        by={"field": f"{_FIELDS}.simultaneous_bands:tolerance_band"},
        takes_weights=True,
    ),
    Statistic(
        "central_region",
        "median curve and central region",
        unit=UnitRule.VALUE,
        group="ranked_curves",
        by={"field": f"{_FIELDS}.ranked_curves:ranked_curves"},
        takes_weights=True,
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
]


def _of_inputs(
    name: str,
    title: str,
    measure: Measure,
    by: Mapping[str, str] | None = None,
    unit: UnitRule = UnitRule.NONE,
    group: str = SENSITIVITY,
) -> Statistic:
    """Return the record of a measure that each input has."""
    record = Statistic(name, title, (INPUT,), unit, note_is_of_estimate=True, measure=measure)
    return replace(record, group=group, by=by or {})


# Differences of single runs, which cost nothing: they are there also without `SENSITIVITY`.
_RESPONSES = "responses"

# The parts of the inputs in a variance.
_INDICES = [
    _of_inputs(
        "first_order",
        "first-order Sobol' index",
        Measure("first order", "shares", 1, share="alone", reason="the largest first order"),
        {
            "sample": f"{_SENSITIVITY}.given_data:first_order",
            "field": f"{_SENSITIVITY}.given_data:first_order_at_places",
            "repeats": f"{_NOISE}:first_order_with_noise",
            Sampling.PICK_FREEZE: f"{_SENSITIVITY}.sobol_indices:sobol_indices",
            of_field(Sampling.PICK_FREEZE): f"{_SENSITIVITY}.sobol_indices:sobol_indices_at_places",
        },
    ),
    _of_inputs(
        "total_order",
        "total-order Sobol' index",
        Measure("total order", "shares", 2, "square", share="total"),
    ),
    _of_inputs(
        "shapley",
        "Shapley effect",
        Measure("Shapley effect", "shares", 3, "diamond", "divided", "the largest Shapley effects"),
    ),
]


def _indices_of(
    prefix: str, title: str, table: str, *along: str, json: str = ""
) -> Iterator[Statistic]:
    """Yield the parts in the variance of something else than the output."""
    for each in _INDICES:
        measure = replace(each.measure, table=table, json=json)
        yield derived(each, prefix, title, along, measure=measure)


# What answers over unknowns of the inputs' distributions follow from, and how each is called. Those
# of a mean over intervals have records of their own, as a design may search for them.
_KNOWN_OVER_UNKNOWNS = ("mean", "quantile", "exceedance", "below", "share", "cdf")
_OVER_UNKNOWNS = {
    "plug_in_": ("{title} at the fitted parameters", "{label}, parameters as fitted"),
    "fitted_": ("{title} over parameters that fit as well", "{label}, over parameters"),
    "lower_": ("lower bound of the {title} over the intervals", "{label}, lower bound"),
    "upper_": ("upper bound of the {title} over the intervals", "{label}, upper bound"),
    "total_": ("{title} over intervals and parameters that fit as well", "{label}, over both"),
}


def _over_unknowns() -> Iterator[Statistic]:
    """Yield the records of answers over unknowns, each beside the statistic that it is of."""
    known = {each.name: each for each in _OF_VALUES}
    for name in _KNOWN_OVER_UNKNOWNS:
        for prefix, (title, label) in _OVER_UNKNOWNS.items():
            # A curve has a band alone.
            if f"{prefix}{name}" not in {*known, "plug_in_cdf", "total_cdf"}:
                of = known[name].shown
                shown = replace(
                    of,
                    label=label.replace("{label}", of.label) if of.label else "",
                    json=f"{prefix}{of.json}" if of.json else "",
                    rank=99,
                    is_compared=False,
                    event="",
                )
                yield derived(known[name], prefix, title, shown=shown, note_is_of_estimate=True)


_STATISTICS = [
    *_OF_VALUES,
    *_over_unknowns(),
    *(
        derived(
            each, MORE_SPECIMENS, "{title} over parameters that fit more specimens", (SPECIMENS,)
        )
        for each in _OF_VALUES
        if each.name in ("mean", "quantile", "exceedance", "below")
    ),
    # Of two models at common points. A quantile of differences is no difference of quantiles.
    Statistic(
        "difference_of_std", "difference of two standard deviations", (), UnitRule.DIFFERENCE
    ),
    Statistic(
        "difference_of_quantile",
        "difference of two quantiles",
        (PROBABILITY,),
        UnitRule.DIFFERENCE,
    ),
    *(
        derived(
            each,
            BY_RUNS,
            "{title}, by the runs so far",
            (RUNS_SO_FAR,),
            group=CONVERGENCE,
            by={"sample": "uqpen.statistics.convergence:convergence"},
        )
        for each in _OF_VALUES
        if "part" in each.by
    ),
    *_INDICES,
    Statistic(
        "second_order",
        "second-order Sobol' index",
        (PAIR,),
        note_is_of_estimate=True,
        measure=Measure("second order", "pairs", 4, json="sensitivity_of_pairs"),
    ),
    # Of a whole field: along its places, each input has one. Nobody estimates its Shapley effects.
    *islice(_indices_of(OF_FIELD, "generalized {title}", "shares of the field"), 2),
    *_indices_of(OF_LOGARITHM, "{title} of the logarithm", "shares of the logarithm"),
    # Nobody estimates the Shapley effects of the mean given the inputs.
    *islice(_indices_of(OF_MEAN, "{title} of the mean given the inputs", "shares of the mean"), 2),
    Statistic(
        "noise_std_along",
        "standard deviation of the noise in a part of an input's values",
        (INPUT_SHARE, INPUT),
        UnitRule.DIFFERENCE,
        group=SENSITIVITY,
        by={"repeats": f"{_NOISE}:noise_along_inputs"},
        own=EntryDimension(INPUT_SHARE, is_listed=False),
        measure=Measure("sd of the noise", "noise", 90, json="noise_along_inputs"),
    ),
    *_indices_of(
        OF_EXCEEDANCE,
        "{title} of exceeding a value",
        "thresholds",
        THRESHOLD,
        json="sensitivity_of_exceedance",
    ),
    *_indices_of(
        OF_CATEGORY, "{title} of a category", "categories", CATEGORY, json="sensitivity_of_shares"
    ),
    _of_inputs(
        "pearson",
        "Pearson correlation",
        Measure("Pearson", "associations", 41),
        {"sample": f"{_SENSITIVITY}.correlations:correlations"},
    ),
    _of_inputs(
        "spearman",
        "Spearman rank correlation",
        Measure(
            "Spearman",
            "associations",
            40,
            reason="the strongest rank correlations",
            sentence="{input} has the strongest rank correlation with {output} ({estimate}).",
        ),
    ),
    _of_inputs("partial", "partial correlation", Measure("partial", "associations", 43)),
    _of_inputs(
        "partial_rank", "partial rank correlation", Measure("partial, ranks", "associations", 42)
    ),
    _of_inputs(
        "delta",
        "moment-independent delta",
        Measure("delta", "associations", 44),
        {"sample": f"{_SENSITIVITY}.delta:delta"},
    ),
    # Of SALib. They are measures of their own, never in a column with Sobol' indices.
    _of_inputs(
        "salib_rbd_fast",
        "first-order index by SALib's RBD-FAST",
        Measure("RBD-FAST", "salib", 80, chart="first-order index by RBD-FAST", axis="index"),
    ),
    _of_inputs(
        "salib_pawn",
        "PAWN index by SALib",
        Measure("PAWN", "salib", 81, chart="PAWN index", axis="distance of distributions"),
    ),
    _of_inputs(
        "salib_pawn_floor",
        "PAWN index of a permuted input",
        Measure("PAWN, permuted", "salib", 82, "triangle-up"),
    ),
    _of_inputs(
        "salib_delta",
        "moment-independent delta by SALib",
        Measure("delta by SALib", "salib", 83, chart="delta", axis="delta"),
    ),
    _of_inputs(
        "salib_hdmr",
        "first-order share by SALib's enhanced HDMR",
        Measure("HDMR", "salib", 84, chart="share by enhanced HDMR", axis="share"),
    ),
    Statistic(
        "salib_hdmr_unexplained",
        "share of the variance that SALib's enhanced HDMR leaves",
        note_is_of_estimate=True,
        group=SENSITIVITY,
        shown=Shown("left by HDMR", 90),
    ),
    Statistic(
        "salib_rsa",
        "distance of an input's distribution in a part of the values, by SALib",
        (OUTPUT_SHARE, INPUT),
        note_is_of_estimate=True,
        group=SENSITIVITY,
        own=EntryDimension(OUTPUT_SHARE, is_listed=False),
        measure=Measure("RSA", "parts", 89, json="sensitivity_of_parts"),
    ),
    _of_inputs(
        "salib_fast_first",
        "first-order index by FAST",
        Measure("FAST, first order", "salib", 85, chart="first-order index by FAST", axis="index"),
        {Sampling.SEARCH_CURVES: f"{_SENSITIVITY}.salib_analyses:search_curves"},
    ),
    _of_inputs(
        "salib_fast_total",
        "total index by FAST",
        Measure("FAST, total", "salib", 86, chart="total index by FAST", axis="index"),
    ),
    _of_inputs(
        "salib_dgsm",
        "derivative-based measure (DGSM)",
        Measure("DGSM", "salib", 87, chart="derivative-based measure", axis="ν σ² / Var y"),
        {Sampling.FINITE_DIFFERENCES: f"{_SENSITIVITY}.salib_analyses:derivatives"},
    ),
    _of_inputs(
        "salib_ff",
        "half of the change between two levels",
        Measure("two levels", "levels", 88, chart="half change between two levels", axis="effect"),
        {Sampling.TWO_LEVELS: f"{_SENSITIVITY}.salib_analyses:two_levels"},
        UnitRule.DIFFERENCE,
    ),
    # Of moves of one input at a time. Effects of both signs cancel in their mean.
    _of_inputs(
        "mu",
        "mean elementary effect",
        Measure("mean effect", "effects", 21, ""),
        {
            Sampling.TRAJECTORIES: f"{_SENSITIVITY}.single_steps:elementary_effects",
            of_field(Sampling.TRAJECTORIES): f"{_SENSITIVITY}.single_steps:effects_at_places",
        },
        UnitRule.DIFFERENCE,
    ),
    _of_inputs(
        "mu_star",
        "mean absolute elementary effect",
        Measure(
            "mean |effect|",
            "effects",
            20,
            reason="the largest mean elementary effects",
            sentence="{input} changes {output} most (by its mean elementary effect).",
            axis="effect",
        ),
        unit=UnitRule.DIFFERENCE,
    ),
    _of_inputs(
        "sigma",
        "standard deviation of the elementary effects",
        Measure("sd of effects", "effects", 22, "triangle-up", axis="effect"),
        unit=UnitRule.DIFFERENCE,
    ),
    _of_inputs(
        "response",
        "relative response",
        Measure(
            "response [%]",
            "responses",
            30,
            chart="response",
            axis="|response|",
            relative_to=("output", "input"),
        ),
        {
            Sampling.ONE_AT_A_TIME: f"{_SENSITIVITY}.single_steps:relative_responses",
            of_field(Sampling.ONE_AT_A_TIME): f"{_SENSITIVITY}.single_steps:responses_at_places",
        },
        group=_RESPONSES,
    ),
    _of_inputs(
        "contribution",
        "contribution to the relative uncertainty",
        Measure(
            "× uncertainty [%]",
            "responses",
            31,
            reason="the largest response times uncertainty",
            sentence="{input} changes {output} most "
            "(by its response at the nominal point times its uncertainty).",
            chart="response × uncertainty",
            axis="|response × uncertainty|",
            relative_to=("output",),
        ),
        group=_RESPONSES,
    ),
    _of_inputs(
        "change_per_std",
        "change per standard deviation of an input",
        Measure(
            "change per sd",
            "changes",
            32,
            chart="change per standard deviation of an input",
            axis="|change| per standard deviation",
        ),
        unit=UnitRule.DIFFERENCE,
        group=_RESPONSES,
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

# Those that every numeric output has, for what states them first.
MEAN, STD, QUANTILE = CATALOGUE["mean"], CATALOGUE["std"], CATALOGUE["quantile"]
REACHED = CATALOGUE["reached"]

# Statistics of a design's runs as a whole, of no output in particular.
FAILURE_STATISTICS = _by_name(_FAILURE_STATISTICS)

# How an event's probability changes with the inputs' distributions.
_EVENT_SENSITIVITIES = {
    "mean_sensitivity": ("change of an event's probability with a mean", "mean, by one sd"),
    "std_sensitivity": (
        "change of an event's probability with a standard deviation",
        "sd, by itself",
    ),
    "mean_elasticity": ("elasticity of an event's probability to a mean", "elasticity, mean"),
    "std_elasticity": (
        "elasticity of an event's probability to a standard deviation",
        "elasticity, sd",
    ),
    "sensitivity_effective_runs": ("effective number of runs with an event", "effective runs"),
}
_OF_DESIGN_POINTS = {
    "reliability_index": ("distance of a design point from the median", "reliability index"),
    "first_order_probability": (
        "probability beyond the plane at a design point",
        "probability, first order",
    ),
    "second_order_probability": (
        "probability beyond the paraboloid at a design point",
        "probability, second order",
    ),
}

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
            "fitted_joint_probability",
            "probability of an event over parameters that fit as well",
            (EVENT,),
            note_is_of_estimate=True,
        ),
        Statistic(
            "event_first_order",
            "first-order Sobol' index of an event",
            (SENSITIVITY_EVENT, INPUT),
            note_is_of_estimate=True,
            own=EntryDimension(SENSITIVITY_EVENT, "text"),
            measure=Measure("first order", "event", 65),
        ),
        *(
            Statistic(
                name,
                title,
                (SENSITIVITY_EVENT, INPUT),
                note_is_of_estimate=True,
                measure=Measure(label, "event", rank),
            )
            for rank, (name, (title, label)) in enumerate(_EVENT_SENSITIVITIES.items(), 60)
        ),
        *(
            Statistic(
                name,
                title,
                (DESIGN_POINT,),
                note_is_of_estimate=True,
                own=EntryDimension(DESIGN_POINT, "count", {"design_point_run": "count"}),
                measure=Measure(label, "design points", rank),
            )
            for rank, (name, (title, label)) in enumerate(_OF_DESIGN_POINTS.items(), 70)
        ),
        Statistic(
            "importance_factor",
            "share of an input in the direction to a design point",
            (DESIGN_POINT, INPUT),
            note_is_of_estimate=True,
            measure=Measure("importance", "design points", 73),
        ),
    ]
)

# Bounds over intervals: of means beside other statistics of the output, of events by themselves.
BOUND_STATISTICS = _by_name(
    [
        Statistic(
            f"{end}_probability",
            f"{end} bound of the probability of an event",
            (BOUNDED_EVENT,),
            note_is_of_estimate=True,
            own=EntryDimension(BOUNDED_EVENT, "text"),
            shown=Shown(f"P({{entry}}), {end} bound"),
        )
        for end in ("lower", "upper")
    ]
)

# Statistics of a search for least squares, in SI units.
_OF_FIT = {
    "sum_of_squares": "sum of squares of the residuals, in their standard deviations",
    "degrees_of_freedom": "number of residuals beyond that of the unknowns",
    "fit_p_value": "probability of a larger sum of squares, if model and stated errors are right",
    "residual_std": "standard deviation of a residual",
    "residual_correlation": "lag-1 correlation of the residuals",
    "largest_residual": "largest residual, in its standard deviation",
    "next_step": "length of the next step, in standard errors",
    "model_noise": "noise of the model, in standard deviations of a residual",
    "difference_step": "first step of difference quotients, in standard deviations of the priors",
}
# What is known of each measured value, in SI units.
_DESCRIBED_ROWS = [
    Statistic("experiment_number", "number of the experiment", (MEASURED_ROW,), has_bounds=False),
    Statistic("file_row", "number of the row in its file", (MEASURED_ROW,), has_bounds=False),
    Statistic(
        "row_hash",
        "hash of a measured value with its conditions",
        (MEASURED_ROW,),
        has_bounds=False,
        kind="text",
    ),
    Statistic(
        "bound_side",
        "1 of a bound from below, -1 of one from above, 0 of a value",
        (MEASURED_ROW,),
        has_bounds=False,
    ),
    Statistic(
        "condition",
        "condition or place of a measured value",
        (MEASURED_ROW, MEASURED_CONDITION),
        has_bounds=False,
        own=EntryDimension(MEASURED_CONDITION, "text"),
    ),
]
# Statistics of a posterior.
_OF_UNKNOWNS_POSTERIOR = {
    "learnt": "part of its prior's standard deviation that an unknown has lost",
    "rhat": "rank-normalised R-hat of the replicates",
    "effective_draws": "number of independent draws whose mean would scatter as the replicates'",
}
_OF_POSTERIOR = {
    "sampled_well": "1 where the replicates agree and the means are known well, else 0",
    "confirmed": "1 where weighted runs confirm the posterior by a surrogate, else 0",
    "effective_number": "number of independent draws that the weighted ones are worth",
    "variance_scale": "factor that z scores gave the variance of the surrogate",
    "prior_failed_share": "share of failed runs over the prior",
    "posterior_failed_share": "share of failed runs around the posterior",
    "start_correlation": "rank correlation of draws with where their last level began",
}
CALIBRATION_STATISTICS = _by_name(
    [
        *_DESCRIBED_ROWS,
        Statistic(
            "measured_output",
            "output of a measured value",
            (MEASURED_ROW,),
            has_bounds=False,
            kind="text",
            own=EntryDimension(MEASURED_ROW, "count"),
        ),
        Statistic("measured", "measured value", (MEASURED_ROW,), has_bounds=False),
        Statistic(
            "measured_std",
            "standard deviation of a measured value about the model",
            (MEASURED_ROW,),
            has_bounds=False,
        ),
        Statistic(
            "fitted", "result of the model at the minimum", (MEASURED_ROW,), has_bounds=False
        ),
        Statistic(
            "predicted_mean",
            "mean of the model over the posterior",
            (MEASURED_ROW,),
            has_bounds=False,
        ),
        Statistic(
            "predicted_std",
            "standard deviation of the model over the posterior",
            (MEASURED_ROW,),
            has_bounds=False,
        ),
        Statistic(
            "prediction",
            "what a posterior predicts at conditions of which nothing was measured",
            (BLANK_ROW,),
            note_is_of_estimate=True,
            own=EntryDimension(BLANK_ROW, "count"),
        ),
        Statistic(
            "prediction_std", "standard deviation of the same", (BLANK_ROW,), has_bounds=False
        ),
        Statistic(
            "prediction_output",
            "output that is predicted",
            (BLANK_ROW,),
            has_bounds=False,
            kind="text",
        ),
        Statistic(
            "prediction_row", "number of its row in the file", (BLANK_ROW,), has_bounds=False
        ),
        Statistic(
            "prediction_condition",
            "condition or place of a prediction",
            (BLANK_ROW, MEASURED_CONDITION),
            has_bounds=False,
        ),
        *(Statistic(name, title, has_bounds=False) for name, title in _OF_FIT.items()),
        Statistic(
            "unknown_value",
            "value of an unknown",
            (UNKNOWN,),
            note_is_of_estimate=True,
            own=EntryDimension(UNKNOWN, "text"),
        ),
        Statistic("profile_value", "value of an unknown, by its profile likelihood", (UNKNOWN,)),
        Statistic("standard_error", "standard error of an unknown", (UNKNOWN,), has_bounds=False),
        Statistic(
            "prior_std", "standard deviation of an unknown's prior", (UNKNOWN,), has_bounds=False
        ),
        Statistic(
            "correlation",
            "correlation of the estimates of two unknowns",
            (UNKNOWN, OTHER_UNKNOWN),
            has_bounds=False,
            own=EntryDimension(OTHER_UNKNOWN, "text"),
        ),
        Statistic(
            "combination_error",
            "standard error of a combination of unknowns, in standard deviations of the priors",
            (COMBINATION,),
            has_bounds=False,
            own=EntryDimension(COMBINATION, "count"),
        ),
        Statistic(
            "combination_weight",
            "weight of an unknown in a combination, in standard deviations of the priors",
            (COMBINATION, UNKNOWN),
            has_bounds=False,
        ),
        Statistic(
            "minimum_sum_of_squares",
            "sum of squares at a minimum",
            (MINIMUM,),
            has_bounds=False,
            own=EntryDimension(MINIMUM, "count"),
        ),
        Statistic("minimum_value", "unknown at a minimum", (MINIMUM, UNKNOWN), has_bounds=False),
        Statistic(
            "posterior_mean", "mean of an unknown's posterior", (UNKNOWN,), note_is_of_estimate=True
        ),
        Statistic("posterior_std", "standard deviation of an unknown's posterior", (UNKNOWN,)),
        Statistic(
            "posterior_quantile", "quantile of an unknown's posterior", (UNKNOWN, PROBABILITY)
        ),
        Statistic("surrogate_mean", "mean of its posterior by the surrogate alone", (UNKNOWN,)),
        Statistic("surrogate_std", "standard deviation of the same", (UNKNOWN,)),
        *(
            Statistic(name, title, (UNKNOWN,), has_bounds=False)
            for name, title in _OF_UNKNOWNS_POSTERIOR.items()
        ),
        Statistic(
            "experiment_failed_share",
            "share of failed runs of an experiment around the posterior",
            (EXPERIMENT,),
            has_bounds=False,
            own=EntryDimension(EXPERIMENT, "count"),
        ),
        Statistic("log_evidence", "logarithm of the evidence"),
        Statistic(
            "unit_like",
            "variable in whose unit an unknown is shown",
            (UNKNOWN,),
            has_bounds=False,
            kind="text",
        ),
        *(Statistic(name, title, has_bounds=False) for name, title in _OF_POSTERIOR.items()),
    ]
)

# A model compared with measurements: of each measured value, then of all of them.
_OF_MEASURED_ROWS = {
    "measured": ("measured value", UnitRule.VALUE),
    "measured_std": ("standard deviation of the error of measurement", UnitRule.DIFFERENCE),
    "predicted_mean": ("mean of the model", UnitRule.VALUE),
    "predicted_std": ("standard deviation of the model by its inputs", UnitRule.DIFFERENCE),
    "validation_uncertainty": ("standard uncertainty of the comparison error", UnitRule.DIFFERENCE),
    "z_score": ("comparison error by its standard uncertainty", UnitRule.NONE),
    "pit": ("probability integral transform of the measured value", UnitRule.NONE),
    "inside": ("1 where the measured value is inside the band of the draws", UnitRule.NONE),
    "used_before": ("1 where inputs were fitted to the measured value", UnitRule.NONE),
    "crps": ("continuous ranked probability score", UnitRule.DIFFERENCE),
}
_OF_VALIDATION = {
    "draws": "number of draws with a completed run at each measured value",
    "failed_draws": "number of draws without one",
    "joint_statistic": "squared Mahalanobis distance of all comparison errors from 0",
    "ks_statistic": "Kolmogorov's distance of the PIT values from the uniform distribution",
    "area_null": "mean area metric of a model without error",
    "area_null_quantile": "area metric that a model without error stays below at the level",
    "residual_chi_squared": "sum of squares of the residuals of values used before",
    "residual_p_value": "probability of a larger sum of squares of these residuals",
}
_ESTIMATES_OF_VALIDATION = {
    "joint_p_value": "share of the draws that lie farther out than all measured values together",
    "share_inside": "share of the measured values inside the band of the draws",
    "share_p_value": "share of the draws whose share inside differs more from the level",
    "ks_p_value": "share of the draws whose PIT values are farther from uniform",
    "area": "area metric: area between the distribution of the PIT values and the uniform one",
    "area_p_value": "share of the draws with a larger area metric",
}
VALIDATION_STATISTICS = _by_name(
    [
        *_DESCRIBED_ROWS,
        *(
            Statistic(name, title, (MEASURED_ROW,), unit, has_bounds=False)
            for name, (title, unit) in _OF_MEASURED_ROWS.items()
        ),
        Statistic(
            "comparison_error",
            "comparison error: mean of the model minus measured value",
            (MEASURED_ROW,),
            UnitRule.DIFFERENCE,
            note_is_of_estimate=True,
            own=EntryDimension(MEASURED_ROW, "count"),
        ),
        Statistic(
            "detectable_error",
            "error of the model at one measured value that the joint test finds in 80 %",
            (MEASURED_ROW,),
            UnitRule.DIFFERENCE,
        ),
        Statistic("row_verdict", "verdict on each", (MEASURED_ROW,), has_bounds=False, kind="text"),
        *(Statistic(name, title, has_bounds=False) for name, title in _OF_VALIDATION.items()),
        *(
            Statistic(name, title, note_is_of_estimate=True)
            for name, title in _ESTIMATES_OF_VALIDATION.items()
        ),
        Statistic(
            "detectable_common_error",
            "error of the model, the same at all, that the joint test finds in 80 %",
            unit=UnitRule.DIFFERENCE,
        ),
        Statistic(
            "mean_crps", "mean continuous ranked probability score", unit=UnitRule.DIFFERENCE
        ),
        Statistic(
            "score_difference",
            "mean score of the first model minus that of this one",
            unit=UnitRule.DIFFERENCE,
        ),
        Statistic("verdict", "verdict on all", has_bounds=False, kind="text"),
    ]
)

# Shares of the variance over several models, which count the same.
_MODEL_FORM_SHARES = [
    Statistic(name, title, shown=Shown(label))
    for name, title, label in (
        ("model_form_share", "share of the variance between models", "model form"),
        ("parameter_share", "share of the variance between inputs", "inputs"),
        (
            "interaction_share",
            "share of the variance of models and inputs together",
            "both together",
        ),
    )
]
MODEL_FORM_STATISTICS = _by_name(
    [
        *_MODEL_FORM_SHARES,
        *(
            derived(each, OF_EXCEEDANCE, "{title}, of exceeding a value", (THRESHOLD,))
            for each in _MODEL_FORM_SHARES
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
    *BOUND_STATISTICS.values(),
    *CALIBRATION_STATISTICS.values(),
    *VALIDATION_STATISTICS.values(),
    *MODEL_FORM_STATISTICS.values(),
)

# The statistics whose entries a study requests, the same for all sources of an output: tables show
# them side by side.
REQUESTED = tuple(each for each in _ALL if each.asked.key)
REQUESTED_DIMENSIONS = frozenset(
    {*chain(*(each.dims for each in REQUESTED)), BAND_CONTENT, CATEGORY}
)


def _by_table() -> Mapping[str, tuple[Statistic, ...]]:
    found: dict[str, dict[int, Statistic]] = {}
    for each in _ALL:
        if each.measure.table:
            found.setdefault(each.measure.table, {})[each.measure.rank] = each
    return MappingProxyType(
        {table: tuple(each for _, each in sorted(of.items())) for table, of in found.items()}
    )


# The measures of the inputs' part, by the tables that they are columns of.
MEASURES = _by_table()

# The dimensions of statistics by their names: those that one of them describes, and those of many.
DIMENSIONS: Mapping[str, EntryDimension] = MappingProxyType(
    {
        each.name: each
        for each in (
            *(statistic.own for statistic in _ALL if statistic.own),
            EntryDimension(RUNS_SO_FAR, "count", is_listed=False),
            EntryDimension(SPECIMENS, "text", is_listed=False),
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
