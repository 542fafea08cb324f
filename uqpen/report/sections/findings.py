"""Findings in sentences: drivers of an output, agreement, and what a reader has to mind."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.charts.marks import has_interval
from uqpen.core.catalogue import MEASURES
from uqpen.core.labels import (
    AGREEMENT,
    CODED_INPUTS,
    CONDITIONAL,
    CONTRADICTED_DISTRIBUTIONS,
    CONTRADICTION,
    DEPENDENCE,
    DISTANT_VALUES,
    DROPPED_ROWS,
    INTERVAL_LEVEL,
    REWEIGHTED,
    RUNS,
    SURROGATES,
    UNCERTAIN_FIT,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Alert
from uqpen.report.sections.failures import missing_count
from uqpen.report.sections.sentences import (
    QuotedStatistic,
    moments,
    no_break,
    other_design_estimates,
    output_name,
)
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import (
    count_text,
    estimate_text,
    grouped_number,
    number_text,
    percent_text,
)
from uqpen.results.input_measures import (
    Ranking,
    best_ranking,
    index_titles,
    input_label,
    input_ranking,
)
from uqpen.results.noise import is_little, noise_lines
from uqpen.results.table import assumes_short_tails, telling_note
from uqpen.results.texts import capitalized, join_names, plain_text
from uqpen.surrogates.diagnostics import refuted_outputs

# What drives an output.

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
    first, *others = ranking.estimates
    name = "the logarithm of " * ranking.is_of_logarithm + output_name(view, output)
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
        nearest = min(_FRACTIONS, key=lambda each: abs(each - share))
        part = f"about {_FRACTIONS[nearest]} of the variance of {name}"
        yield f"{start} {_share_text(view, ranking, part, text)}"
    if further := _next_inputs(view, ranking, others):
        yield f"Next: {further}."
    if measure.share != "alone" or index_titles(view.tree).is_dependent:
        return
    alone: Ranking | None = ranking
    table = measure.table
    if view.estimates(output, "noise_share"):
        # A total order of the whole output has the noise in it, which is no interaction.
        table = "shares of the mean"
        alone = best_ranking(view, output, MEASURES[table][0])
    of_total = next(each for each in MEASURES[table] if each.measure.share == "total")
    total = best_ranking(view, output, of_total)
    if total is None or alone is None:
        return
    shown = {
        name: _estimate_text(array)
        for name, array in total.estimates.items()
        if name in alone.estimates and _exceeds(array, alone.estimates[name])
    }
    if shown:
        inputs = ", ".join(f"{input_label(view, each)} ({text})" for each, text in shown.items())
        of_mean = " of the mean given the inputs" * (alone is not ranking)
        yield f"With its interactions{of_mean}: {inputs}."


def _share_text(view: ArchiveView, ranking: Ranking, part: str, text: str) -> str:
    if ranking.divides:
        return f"causes {part}: its Shapley effect is {text}."
    if index_titles(view.tree).is_dependent:
        return f"goes with {part} ({text}), which includes what dependent inputs share."
    return f"causes {part} by itself ({text})."


def _next_inputs(view: ArchiveView, ranking: Ranking, others: list[str]) -> str:
    measure = ranking.statistic.measure
    if not measure.share and "{estimate}" not in measure.sentence:
        return " and ".join(input_label(view, each) for each in others[:_NEXT])
    shown = [each for each in others if abs(float(ranking.estimates[each].values[0])) >= _LEAST]
    return " and ".join(
        f"{input_label(view, each)} ({_estimate_text(ranking.estimates[each])})"
        for each in shown[:_NEXT]
    )


def _exceeds(total: xr.DataArray, first: xr.DataArray) -> bool:
    """Return whether a total order is above a first order by more than their intervals."""
    beyond = float(total.values[0] - first.values[0]) > _INTERACTING
    if has_interval(total.values) and has_interval(first.values):
        return beyond and bool(total.values[1] > first.values[2])
    return beyond


def _estimate_text(array: xr.DataArray) -> str:
    return no_break(estimate_text(*array.values.tolist()))


# Agreement with other designs and with published estimates.

# Quantities that are compared.
_MOST_COMPARED = 3


def published_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield what agrees and what differs: a sentence on each output of each publication."""
    for publication in view.statistics.publications:
        texts = []
        for output in view.numeric_outputs:
            parts = []
            for quantity in moments(view, output):
                samples = dict.fromkeys((design, *quantity.view.sample_designs))
                found = [each for name in samples if (each := quantity.estimate(name)) is not None]
                bounded = [each for each in found if np.isfinite(each.values).all()]
                there, here = quantity.estimate(publication), next(iter((*bounded, *found)), None)
                if there is not None and here is not None:
                    parts.append(_comparison(quantity, there, here))
            parts += _responses(view, output, publication)
            parts += _largest_contribution(view, output, publication)
            if parts:
                texts.append(f"{capitalized(output_title(view, output))}: {'; '.join(parts)}.")
        if texts:
            citation = plain_text(view.statistics.citation(publication) or publication, 80)
            yield f"Against {citation}, its value first."
            yield from texts


def _comparison(quantity: QuotedStatistic, there: xr.DataArray, here: xr.DataArray) -> str:
    label = quantity.label
    published = float(quantity.bounds(there)[0])
    bounds = quantity.bounds(here).tolist()
    unit = quantity.unit_text
    own = no_break(f"{estimate_text(*bounds)}{unit}")
    stated = f"{no_break(f'{number_text(published)}{unit}')}, {own}"
    if not np.isfinite(bounds).all():
        return f"{label} uncertain ({stated} without an interval)"
    _, lower, upper = bounds
    # Both intervals count where the publication states the runs behind its figure.
    ends = quantity.bounds(there).tolist()
    own = upper - bounds[0] if published > bounds[0] else bounds[0] - lower
    other = (ends[2] - ends[1]) / 2 if np.isfinite(ends).all() else 0.0
    is_near = abs(published - bounds[0]) <= math.hypot(own, other)
    return f"{label} {'agrees' if is_near else 'differs'} ({stated})"


def _responses(view: ArchiveView, output: str, publication: str) -> Iterator[str]:
    """Yield how many published responses agree to their printed digit."""
    there = view.statistics.get(publication, output, "response")
    if there is None:
        return
    are_magnitudes = view.statistics.are_magnitudes(publication)
    printed = {name: there.sel(input=name).values.tolist() for name in there["input"].values}
    for design in view.designs:
        here = view.statistics.get(design, output, "response")
        if here is None:
            continue
        found = {name: float(here.sel(input=name).values[0]) for name in here["input"].values}
        pairs = [
            (abs(found[name]) if are_magnitudes else found[name], *ends)
            for name, ends in printed.items()
            if name in found and np.isfinite(ends).all()
        ]
        if pairs:
            same = sum(lower <= value <= upper for value, _, lower, upper in pairs)
            yield f"{same} of {len(pairs)} responses agree to the printed digit ({design})"


def _largest_contribution(view: ArchiveView, output: str, publication: str) -> Iterator[str]:
    named = view.statistics.largest_contribution(publication, output)
    ranking = input_ranking(view, output) if named else None
    if ranking is None:
        return
    here = next(iter(ranking.estimates))
    if here == named:
        yield f"the largest contribution is the same ({input_label(view, named)})"
        return
    own, other = (
        _estimate_text(ranking.estimates[name]) if name in ranking.estimates else "no estimate"
        for name in (here, named)
    )
    yield (
        f"the largest contribution differs ({input_label(view, named)}, which has {other} here; "
        f"{input_label(view, here)} has {own})"
    )


def agreement_sentences(quantities: Sequence[QuotedStatistic], design: str) -> Iterator[str]:
    """Yield whether other designs agree on the first quantities, if there are any.

    Two agree if their intervals overlap.
    """
    parts: list[str] = []
    apart: dict[str, list[str]] = {}
    by: set[str] = set()
    output = ""
    for quantity in quantities[:_MOST_COMPARED]:
        own, others = quantity.leading_estimate(design), other_design_estimates(quantity, design)
        if own is None or not others:
            continue
        label = quantity.label if quantity.output == output else quantity.heading
        output, by = quantity.output, by | set(others)
        parts.append(f"{label}: {_range_text(quantity, own, others)}")
        if far := [name for name, each in others.items() if not _overlap(own, each)]:
            apart[label] = far
    if parts:
        few = count_text(len(by), "other design")
        yield "Not in all." if apart else f"Yes, {few} within their intervals."
        yield f"{'; '.join(parts)}."
    for label, far in apart.items():
        yield f"{label}: the interval of {', '.join(far)} lies apart."


def _overlap(one: xr.DataArray, other: xr.DataArray) -> bool:
    """Return whether two intervals overlap, as far as they have ends."""
    (_, low, high), (_, lower, upper) = one.values.tolist(), other.values.tolist()
    return not (low > upper or lower > high)


def _range_text(
    quantity: QuotedStatistic, own: xr.DataArray, others: dict[str, xr.DataArray]
) -> str:
    """Return the smallest and the largest estimate, in the digits of the leading design's."""
    values = [float(quantity.bounds(array)[0]) for array in (own, *others.values())]
    *_, lowest, highest = quantity.texts(own, float(np.min(values)), float(np.max(values)))
    return lowest if lowest == highest else f"{lowest} to {highest}"


# Warnings about the numbers of a page: few alerts, each with a remedy.

# The kind of the last alert, which holds of all archives.
SCOPE = "Scope"
# Notes of estimates that are written out.
_MOST_NOTES = 2
# Share of inadmissible points that is worth an alert.
_MANY = 0.01
# Tenfolds of an output that ask for a logarithmic scale.
_TENFOLDS = 3


def alerts(
    view: ArchiveView, design: str, quantities: Sequence[QuotedStatistic]
) -> Iterator[Alert]:
    """Yield what to mind about quantities by a design, the gravest first."""
    yield from _point_alerts(view, design)
    if (found := [*noise_lines(view.tree)]) and not is_little(view.tree):
        yield Alert(
            "Noise",
            f"{plain_text(capitalized('. '.join(found)), 900)}.",
            "Indices by runs are of the whole output, figures of a surrogate alone of the mean "
            "given the inputs; their notes say so.",
        )
    if missing_count(view, design):
        yield Alert(
            "Failed runs",
            "If the failed runs differ from the others, these numbers are biased; of the intervals "
            "of the runs, only those of probabilities show it.",
            "Find out why they fail, and make these runs again.",
        )
    yield from _surrogate_alerts(view)
    estimates = [
        (quantity, estimate)
        for quantity in _with_moments(view, quantities)
        if (estimate := quantity.leading_estimate(design)) is not None
    ]
    yield from _precision_alert(view, design, estimates)
    yield from _scale_alerts(view, design, quantities)
    yield from _condition_alerts(view, design)
    yield from _dependence_alert(view, design)
    yield from _given_point_alerts(view, design)
    yield from _measured_alert(view, design)
    few_runs = any(assumes_short_tails(estimate) for _, estimate in estimates)
    yield _scope_alert(view, design, few_runs=few_runs)


def _surrogate_alerts(view: ArchiveView) -> Iterator[Alert]:
    for name in group_names(view.tree, SURROGATES):
        outputs: dict[str, list[str]] = {}
        surrogate = view.tree.children[SURROGATES].children[name]
        for output, reason in refuted_outputs(surrogate).items():
            outputs.setdefault(reason, []).append(output_name(view, output))
        for reason, those in outputs.items():
            yield Alert(
                "Refuted surrogate",
                f"{name}, {join_names(those)}: {plain_text(reason, 300)}. None of its estimates is "
                "stated.",
                "Take the estimates of the runs, or fit another kind, transform or more runs.",
            )


def _precision_alert(
    view: ArchiveView, design: str, estimates: Sequence[tuple[QuotedStatistic, xr.DataArray]]
) -> Iterator[Alert]:
    named: dict[str, dict[str, list[str]]] = {}
    for quantity, estimate in estimates:
        # That of a probability says how it counts failed runs, as the page does once.
        is_said = quantity.is_probability and missing_count(view, design) > 0
        if not is_said and (note := telling_note(estimate)):
            outputs_of = named.setdefault(note, {}).setdefault(quantity.label, [])
            outputs_of.append(output_name(view, quantity.output))
    if named:
        texts = [f"{_names_text(those)}: {note}" for note, those in named.items()]
        more = [f"{capitalized(count_text(len(texts) - _MOST_NOTES, 'more note'))} in the tables"]
        shown = texts[:_MOST_NOTES] + more * (len(texts) > _MOST_NOTES)
        yield Alert(
            "Precision",
            f"{'. '.join(shown)}.",
            "Quote quantiles, which need no assumption on extreme values, or make more runs.",
        )


def _point_alerts(view: ArchiveView, design: str) -> Iterator[Alert]:
    """Yield what to mind about the points of a design as draws of the inputs."""
    attributes = read_group(view.tree, RUNS, design).attrs
    if CONTRADICTED_DISTRIBUTIONS in attributes:
        yield Alert(
            "Inputs",
            f"The points of {design} do not follow the stated inputs: Kolmogorov's distance of "
            f"{plain_text(str(attributes[CONTRADICTED_DISTRIBUTIONS]), 200)}.",
            "Compare the distributions and their units with the file.",
        )
    if REWEIGHTED in attributes:
        yield Alert(
            "Weights",
            f"{capitalized(plain_text(str(attributes[REWEIGHTED]), 300))}.",
            "Where an interval is missing, make fresh runs of this study.",
        )


def _with_moments(
    view: ArchiveView, quantities: Sequence[QuotedStatistic]
) -> Iterator[QuotedStatistic]:
    """Yield quantities, and then the moments of their outputs."""
    outputs = dict.fromkeys(each.output for each in quantities)
    further = [moment for output in outputs for moment in moments(view, output)]
    stated = {each.heading for each in quantities}
    yield from (*quantities, *(each for each in further if each.heading not in stated))


def _scale_alerts(
    view: ArchiveView, design: str, quantities: Sequence[QuotedStatistic]
) -> Iterator[Alert]:
    """Yield what to mind about the scale of outputs: one refused, or one that would serve."""
    outputs = [*dict.fromkeys(each.output for each in quantities)]
    for output in outputs:
        if note := view.linear_scale_note(output):
            yield Alert(
                "Scale",
                f"{capitalized(output_name(view, output))}: {note}.",
                "Find out why the model gives such values, or leave the scale out.",
            )
    wide = [output for output in outputs if _spans_tenfolds(view, output, design)]
    if wide:
        names = join_names([output_name(view, output) for output in wide])
        some = "these outputs" if len(wide) > 1 else "the output"
        yield Alert(
            "Scale",
            f"Nine tenths of the runs span more than {_TENFOLDS} tenfolds of {names}. On a linear "
            "scale most of them lie in one place.",
            f'Set scale = "log" for {some} in the study.',
        )


def _spans_tenfolds(view: ArchiveView, output: str, design: str) -> bool:
    """Check if runs of a positive output on a linear scale span some tenfolds."""
    values = view.shown_values(design, output)
    if view.statistics.wants_logarithm(output) or not values.size or values.min() <= 0:
        return False
    low, high = np.quantile(values, [0.05, 0.95])
    return bool(high > 10.0**_TENFOLDS * low)


def _names_text(outputs: Mapping[str, Sequence[str]]) -> str:
    """Return statistics with the outputs that they are of, as one name."""
    return capitalized("; ".join(f"{label} of {join_names(of)}" for label, of in outputs.items()))


def _condition_alerts(view: ArchiveView, design: str) -> Iterator[Alert]:
    """Yield what estimates are conditional on."""
    condition = view.statistics.run_accounts(design).get(CONDITIONAL)
    runs = view.design(design).runs
    count, every = status_counts(runs)[Status.INADMISSIBLE], run_count(runs)
    if condition and count >= _MANY * every:
        some = f"{grouped_number(count)} of the {grouped_number(every)} points of {design}"
        were = "was" if count == 1 else "were"
        yield Alert(
            "Inadmissible",
            f"{some} {were} inadmissible, so outside of what the model or the study allows. All "
            f"estimates are conditional on {condition!s}.",
            "If such inputs occur, the model does not cover them; if not, truncate the "
            "distributions.",
        )
    texts = [
        f"{output_name(view, name)} on {absence[CONDITIONAL]}"
        for name in view.numeric_outputs
        if (absence := view.statistics.absence(design, name))
    ]
    if texts:
        yield Alert(
            "Without a value",
            f"Some estimates are conditional: {'; '.join(texts)}.",
            "Quote the share of runs that have one beside them.",
        )


def _dependence_alert(view: ArchiveView, design: str) -> Iterator[Alert]:
    attributes = read_group(view.tree, RUNS, design).attrs
    if CONTRADICTION in attributes:
        yield Alert(
            "Dependence",
            "The inputs depend on each other, against what the study states: "
            f"{plain_text(str(attributes[CONTRADICTION]), 100)}. Surrogates of these runs have no "
            "estimates.",
            "State the dependence in [dependence]; estimates are then of these inputs.",
        )
    elif dependence := str(attributes.get(DEPENDENCE, "")):
        yield Alert(
            "Dependence",
            f"The inputs depend on each other: {dependence}. Their shares of a variance overlap.",
            "Compare inputs by Shapley effects, which divide what is shared.",
        )


def _given_point_alerts(view: ArchiveView, design: str) -> Iterator[Alert]:
    """Yield what to mind about points, rows and columns that a file gives."""
    if view.design(design).sampling is Sampling.GIVEN:
        yield Alert(
            "Points",
            f"The points of {design} are the user's own, and presumed to be a sample of the "
            "inputs.",
            "Check how they were chosen.",
        )
    attributes = read_group(view.tree, RUNS, design).attrs
    for key, kind, remedy in (
        (DROPPED_ROWS, "Rows", "If they differ from the others, so do the statistics."),
        (DISTANT_VALUES, "Values", "If they stand for none, name them in missing."),
        (CODED_INPUTS, "Codes", "The order of these codes has no part in any number."),
    ):
        if said := str(attributes.get(key, "")):
            yield Alert(kind, f"{said}.", remedy)
    agreement = str(attributes.get(AGREEMENT, ""))
    if agreement and CONTRADICTED_DISTRIBUTIONS not in attributes:
        yield Alert(
            "Inputs",
            f"The points of {design}, from a file, against the stated inputs: {agreement}.",
            "If they do not follow those distributions, the statistics are of other inputs.",
        )


def _measured_alert(view: ArchiveView, design: str) -> Iterator[Alert]:
    fitted = {name: view.attributes(name) for name in view.design(design).random_inputs}
    found = {name: each.get("fit_measurements") for name, each in fitted.items()}
    counts = {name: str(count) for name, count in found.items() if count is not None}
    if uncertain := [name for name in counts if UNCERTAIN_FIT in fitted[name]]:
        fits = ", ".join(f"{name} ({counts[name]})" for name in uncertain)
        yield Alert(
            "Uncertain inputs",
            f"Parameters follow from specimens (their number in brackets): {fits}. Each answer is "
            "of the next one; how well it is known is the interval over all parameters that fit as "
            "well. The family is taken as known.",
            "Measure more: the interval over the parameters gets no narrower with more runs.",
        )
    measured = {name: count for name, count in counts.items() if name not in uncertain}
    if measured:
        fits = ", ".join(f"{name} ({count})" for name, count in measured.items())
        yield Alert(
            "Measured inputs",
            "Distributions are fitted to measurements (their number in brackets): "
            f"{fits}. No interval includes the uncertainty of these fits.",
            "Measure more, or run the study with other fits, too.",
        )


def _scope_alert(view: ArchiveView, design: str, *, few_runs: bool) -> Alert:
    runs = view.design(design).runs
    completed = status_counts(runs)[Status.OK]
    # Said once: every mean of few runs rests on it, and no number of theirs tells which one fails.
    assumed = (
        " Intervals of means and standard deviations may be too narrow if extreme values are more "
        "frequent than in these runs."
    )
    rare = f" Events rarer than about 1 in {grouped_number(completed)} cannot be seen."
    is_uncertain = any(
        UNCERTAIN_FIT in view.attributes(name) for name in view.design(design).random_inputs
    )
    over_parameters = " and those over parameters that of the fits, too" * is_uncertain
    return Alert(
        SCOPE,
        f"Intervals cover the sampling error{over_parameters or ' alone'}, not that of the model "
        f"or of the assumed distributions. {_level_text(view, design)}, all together less often."
        + rare * (run_count(runs) > 1)
        + assumed * few_runs,
        "Compare the model with measurements, and try other distributions.",
    )


def _level_text(view: ArchiveView, design: str) -> str:
    """Return how often an interval is right, by the levels that the estimates have."""
    levels = {
        float(attributes[INTERVAL_LEVEL])
        for output in view.numeric_outputs
        for attributes in view.statistics.statistics(design, output).attributes()
        if INTERVAL_LEVEL in attributes
    }
    if levels and np.allclose(sorted(levels), 0.95):
        return "Each is right 19 times in 20"
    texts = " or ".join(percent_text(level) for level in sorted(levels))
    return f"Each is right with a probability of {texts}" if texts else "Each holds by itself"
