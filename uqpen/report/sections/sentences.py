"""Sentences on outputs and events, each complete by itself, and verdicts on the study's limits."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.charts.chart import Block
from uqpen.charts.marks import has_interval
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, MEAN, QUANTILE, REQUESTED, STD
from uqpen.core.labels import CATEGORY, INTERVAL_LEVEL, OUTCOME_OUTPUT, RUNS, SURROGATES
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import AcceptanceVerdict, Statistic, UnitRule
from uqpen.core.status import Status
from uqpen.execution import run_count, status_counts
from uqpen.models.outcomes import COMPLETED
from uqpen.report.blocks import Finding, Fold, Heading
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView, output_heading, output_title
from uqpen.results.calibrations import fit_statements, posterior_statements
from uqpen.results.digits import (
    count_text,
    estimate_texts,
    grouped_number,
    percent_text,
    percent_texts,
    tolerance_interval_texts,
)
from uqpen.results.found_bounds import found_bounds, interval_inputs
from uqpen.results.joint_probabilities import disagreements
from uqpen.results.source_statistics import described_statistics
from uqpen.results.surrogate_tables import equivalent_runs_text, is_corrected
from uqpen.results.table import (
    entry_label,
    entry_text,
    estimate_remark,
    output_names,
)
from uqpen.results.texts import capitalized, plain_text, typeset_quantity, unit_suffix
from uqpen.results.validations import validation_statements

# Quantities in sentences, with their estimates by design.


# A tolerance limit, by the ends that it states.
_LIMITS = {
    "at most": "limit for",
    "at least": "lower limit for",
    "between": "tolerance interval of",
}


@dataclass(frozen=True)
class QuotedStatistic:
    """A quantity of an output."""

    view: ArchiveView
    output: str
    statistic: Statistic
    entry: Any = None  # one of several: a probability, a threshold as written, a kind

    def estimate(self, design: str) -> xr.DataArray | None:
        """Return a design's estimate of it, along ``bound``; None where there is none."""
        array = self._entry(design)
        # A tolerance interval has ends alone.
        return array if array is not None and np.isfinite(array.values).any() else None

    def reason_without_estimate(self, design: str) -> str:
        """Return why a design has no estimate of it; empty if that is not known."""
        array = self._entry(design)
        return "" if array is None else estimate_remark(array)

    def _entry(self, design: str) -> xr.DataArray | None:
        """Return what a design has of it, which may be missing with a reason."""
        statistics = self.view.statistics
        if not self.statistic.dims:
            return statistics.get(design, self.output, self.statistic.name)
        return statistics.entries(design, self.output, self.statistic.name).get(self.entry)

    def leading_estimate(self, design: str) -> xr.DataArray | None:
        """Return the estimate that the page states: corrected by real runs, or else the design's.

        A study that fits a surrogate asks for its estimates. So that comes first which has an
        interval, whether or not it is narrower than the design's.
        """
        surrogate = self.leading_surrogate
        return self.estimate(design if surrogate is None else surrogate)

    @property
    def leading_surrogate(self) -> str | None:
        """The first surrogate with a corrected estimate of it; None where there is none."""
        surrogates = group_names(self.view.tree, SURROGATES)
        return next((each for each in surrogates if is_corrected(self.estimate(each))), None)

    def bounds(self, array: xr.DataArray) -> FloatArray:
        """Estimate, lower, upper in the unit that is shown; a probability as it is."""
        convert = self.view.conversion(self.output, self.statistic)
        return np.asarray(convert(array.values), dtype=np.float64)

    def texts(self, array: xr.DataArray, *others: float) -> tuple[str, ...]:
        """Estimate, lower, upper, and other values like those of `bounds`, each with its unit."""
        values = (*self.bounds(array), *others)
        if self.is_probability:
            return tuple(no_break(text) for text in percent_texts(*values))
        is_value = self.statistic.unit is UnitRule.VALUE
        is_logarithmic = is_value and self.view.is_logarithmic(self.output)
        texts = estimate_texts(*values, is_logarithmic=is_logarithmic)
        return tuple(no_break(f"{text}{self.unit_text}") for text in texts)

    def interval(self, array: xr.DataArray) -> str:
        """Return the text in brackets after an estimate: its interval, or why it has none."""
        _, lower, upper = self.texts(array)
        has_lower, has_upper = np.isfinite(self.bounds(array)[1:]).tolist()
        level = f"{_level(array)} interval"
        if equivalent := equivalent_runs_text(array):
            level += f", as from {no_break(equivalent)} plain runs"
        if has_lower and has_upper:
            return f"({lower} to {upper}, {level})"
        if has_lower or has_upper:
            end = f"at least {lower}" if has_lower else f"at most {upper}"
            return f"({end} by its one-sided {level}: {estimate_remark(array)})"
        return f"(without an interval: {estimate_remark(array)})"

    @property
    def heading(self) -> str:
        """Name of the quantity, to stand before a colon."""
        return f"{capitalized(output_name(self.view, self.output))}, {self.label}"

    @property
    def label(self) -> str:
        """Name of the statistic, behind that of its output."""
        if ends := self.statistic.shown.ends:
            return f"{_LIMITS[ends]} {no_break(percent_text(self.entry))} of cases"
        if not self.statistic.dims:
            return self.statistic.title
        entry = plain_text(self.entry) if isinstance(self.entry, str) else self.entry
        return entry_label(self.statistic, entry)

    @property
    def is_probability(self) -> bool:
        """True if it is shown in per cent; of user-defined statistics none is."""
        return self.statistic.unit is UnitRule.NONE and self.statistic.name in CATALOGUE

    @property
    def unit_text(self) -> str:
        """The text behind a number: a space and the unit; empty behind a plain number."""
        is_plain = self.statistic.unit is UnitRule.NONE
        return "" if is_plain else unit_suffix(self.view.unit(self.output))


def output_name(view: ArchiveView, output: str) -> str:
    """Return the name of an output in a sentence."""
    runs = read_group(view.tree, RUNS, view.designs[0])
    titles = [str(runs[name].attrs.get("long_name", name)) for name in output_names(runs)]
    title = str(runs[output].attrs.get("long_name", output))
    return plain_text(title if titles.count(title) == 1 else f"{title} ({output})")


def no_break(text: str) -> str:
    """Replace the spaces of a text by ones at which no line ends."""
    return text.replace(" ", "\u00a0")


def requested_statistics(view: ArchiveView, output: str, design: str) -> list[QuotedStatistic]:
    """Return the requested statistics of an output, in the order of their ranks.

    What has a verdict comes first. Of the tolerance limits of a kind, all but one come last.
    """
    every = []
    for statistic in (*REQUESTED, *described_statistics(view.statistics, output)):
        entries = _entries(view, output, design, statistic)
        for place, each in enumerate(entries):
            is_further = bool(statistic.shown.ends) and place > 0
            ranks = not _has_acceptance(each, design), is_further, statistic.shown.rank, place
            every.append((ranks, each))
    return [each for _, each in sorted(every, key=lambda ranked: ranked[0])]


def _has_acceptance(quantity: QuotedStatistic, design: str) -> bool:
    """Check if the study has acceptance limits of a probability, so that there is a verdict."""
    array = quantity.estimate(design)
    return array is not None and Acceptance.from_array(array) is not None


def default_statistic(view: ArchiveView, output: str, design: str) -> QuotedStatistic | None:
    """The median of an output, or else its mean."""
    every = usual_statistics(view, output)
    return next((each for each in every if each.estimate(design) is not None), None)


def usual_statistics(view: ArchiveView, output: str) -> tuple[QuotedStatistic, QuotedStatistic]:
    """The median of an output, and its mean."""
    median = QuotedStatistic(view, output, QUANTILE, 0.5)
    return median, moments(view, output)[0]


def moments(view: ArchiveView, output: str) -> tuple[QuotedStatistic, QuotedStatistic]:
    """The mean of an output, and its standard deviation."""
    return QuotedStatistic(view, output, MEAN), QuotedStatistic(view, output, STD)


def other_design_estimates(quantity: QuotedStatistic, leading: str) -> dict[str, xr.DataArray]:
    """Return estimates of the same quantity by other designs, which drew their own points."""
    view = quantity.view
    others = (
        design
        for design in view.sample_designs
        if design != leading and view.design(design).sampling is not Sampling.GIVEN
    )
    found = {design: quantity.estimate(design) for design in others}
    return {
        design: estimate
        for design, estimate in found.items()
        if estimate is not None and np.isfinite(estimate.values[0])
    }


def _entries(
    view: ArchiveView, output: str, design: str, statistic: Statistic
) -> Iterator[QuotedStatistic]:
    """Yield the entries of a statistic that the study asks for."""
    if not statistic.dims:
        if view.statistics.get(design, output, statistic.name) is not None:
            yield QuotedStatistic(view, output, statistic)
        return
    for entry in view.statistics.entries(design, output, statistic.name):
        if entry not in statistic.asked.always:
            yield QuotedStatistic(view, output, statistic, entry)


# The outputs that a page is about, and which of its parts are open.

# Outputs whose parts are open, at the most.
_MOST = 3


def ordered_outputs(view: ArchiveView, design: str) -> list[str]:
    """All outputs, those with requested statistics first, and categorical ones last."""
    numbers = sorted(
        view.numeric_outputs, key=lambda output: not requested_statistics(view, output, design)
    )
    return [*numbers, *view.categorical_outputs]


def main_outputs(view: ArchiveView) -> list[str]:
    """Return the outputs that the study asks about; if it asks about none, the first."""
    every = [*view.numeric_outputs, *view.categorical_outputs]
    design = view.leading_design
    if design is None:
        return every[:1]
    asked = [each for each in view.numeric_outputs if requested_statistics(view, each, design)]
    return asked[:_MOST] or every[:1]


def output_blocks(
    view: ArchiveView, blocks: Mapping[str, Iterable[Block]], most: int = _MOST
) -> Iterator[Block]:
    """Yield the blocks of each output under its heading; those of all but the main ones folded.

    The first main ones are open, `most` of them.
    """
    filled = {output: found for output, each in blocks.items() if (found := tuple(each))}
    main = [output for output in main_outputs(view) if output in filled][:most]
    yield from headed_blocks(view, filled, main, "Other outputs")


def headed_blocks(
    view: ArchiveView, blocks: Mapping[str, tuple[Block, ...]], shown: Iterable[str], rest: str
) -> Iterator[Block]:
    """Yield blocks below the headings of their outputs; all but those of `shown` are folded."""
    headed = {each: (Heading(output_heading(view, each)), *found) for each, found in blocks.items()}
    for output in shown:
        yield from headed.pop(output)
    if headed:
        titles = ", ".join(output_title(view, output) for output in headed)
        yield Fold(f"{rest}: {plain_text(titles, 120)}", tuple(chain(*headed.values())))


# Sentences and verdicts.

# Requested statistics of an output that are stated, and categories in a sentence.
_MOST_STATED = 3
# Further ones of an output in the table below the sentences.
_MOST_FURTHER = 9
_MOST_CATEGORIES = 4


class OutputSentences(NamedTuple):
    """Sentences of the report about one output."""

    output: str
    verdicts: tuple[Finding, ...]  # on the limits of the study
    sentences: tuple[str, ...]
    quantities: tuple[QuotedStatistic, ...]  # that they state
    omitted: int = 0  # requested quantities that have no sentence
    further: tuple[Finding, ...] = ()  # requested quantities below the sentences


def output_sentences(view: ArchiveView, output: str, design: str) -> OutputSentences | None:
    """Return a sentence on an output by a design whose runs are a sample; None without one."""
    if output in view.categorical_outputs:
        found = sorted(
            _category_statistics(view, output, design), key=lambda each: -float(each[2].values[0])
        )
        shown = found[:_MOST_CATEGORIES]
        if not shown:
            return None
        parts = [
            f"{label} in {each.texts(array)[0]} of cases {each.interval(array)}"
            for label, each, array in shown
        ]
        start = capitalized(output_name(view, output))
        runs = run_count(view.design(design).runs)
        if runs > 1 and float(shown[0][2].values[0]) == 1:
            parts = parts[:1]
        omitted = len(found) - len(shown)
        return OutputSentences(output, (), (f"{start}: {'; '.join(parts)}.",), (), omitted)
    every = requested_statistics(view, output, design)
    missing = [each for each in every if each.leading_estimate(design) is None]
    known = [each for each in every if each not in missing]
    kept, below = known[:_MOST_STATED], [*known[_MOST_STATED:], *missing]
    common = default_statistic(view, output, design)
    if common is not None and len(kept) < _MOST_STATED:
        kept.append(common)
    of_kept = ((each, each.leading_estimate(design)) for each in kept)
    estimates = [(each, array) for each, array in of_kept if array is not None]
    if not estimates:
        return None
    limits = [each for each in estimates if each[0].statistic.shown.event]
    others = [each for each in estimates if not each[0].statistic.shown.event]
    return OutputSentences(
        output,
        tuple(_verdict(*each, design) for each in limits),
        tuple(_sentence(*each, design) for each in others),
        tuple(each for each, _ in estimates),
        max(0, len(below) - _MOST_FURTHER),
        tuple(_further(each, design) for each in below[:_MOST_FURTHER]),
    )


def outcome_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield how often runs end with each outcome that the study declares."""
    if OUTCOME_OUTPUT not in view.categorical_outputs:
        return
    parts = [
        f"{label} in {each.texts(array)[0]} of cases {each.interval(array)}"
        for label, each, array in _category_statistics(view, OUTCOME_OUTPUT, design)
        if each.entry != COMPLETED
    ]
    if parts:
        more = len(parts) - _MOST_CATEGORIES
        shown = [*parts[:_MOST_CATEGORIES], *[count_text(more, "more outcome")] * (more > 0)]
        yield f"Outcome: {'; '.join(shown)}."


def _further(quantity: QuotedStatistic, design: str) -> Finding:
    """Return a requested quantity with its sentence, the verdict on its limit, or a reason."""
    array = quantity.leading_estimate(design)
    if array is None:
        reason = quantity.reason_without_estimate(design)
        return Finding(quantity.heading, f"No estimate: {plain_text(reason, 240)}.")
    if quantity.statistic.shown.event:
        return _verdict(quantity, array, design)
    return Finding(quantity.heading, _sentence(quantity, array, design))


def _verdict(quantity: QuotedStatistic, array: xr.DataArray, design: str) -> Finding:
    """Return how often an output lies beyond a limit, and whether the study accepts that."""
    name = capitalized(output_name(quantity.view, quantity.output))
    estimate, lower, upper = quantity.texts(array)
    runs = grouped_number(status_counts(quantity.view.design(design).runs)[Status.OK])
    level = _level(array)
    text = f"in {estimate} of cases {quantity.interval(array)}."
    counts_events = not is_corrected(array)
    if counts_events and array.values[0] == 0 and np.isfinite(array.values[2]):
        text = f"in none of {runs} completed runs: at most {upper} of cases ({level} interval)."
    elif counts_events and array.values[0] == 1 and np.isfinite(array.values[1]):
        text = f"in all {runs} completed runs: at least {lower} of cases ({level} interval)."
    threshold = no_break(typeset_quantity(plain_text(quantity.entry)))
    event = f"{name} {quantity.statistic.shown.event} {threshold}"
    over = over_parameters(quantity, design)
    return Finding(event, f"{capitalized(text)}{acceptance_sentence(array)}{over}")


def over_parameters(quantity: QuotedStatistic, design: str) -> str:
    """Return a sentence on the interval over uncertain parameters; empty where there are none.

    The answer itself is of the next one, and would mislead alone.
    """
    record = CATALOGUE.get(f"fitted_{quantity.statistic.name}")
    if record is None:
        return ""
    over = QuotedStatistic(quantity.view, quantity.output, record, quantity.entry)
    array = over.estimate(design)
    return "" if array is None else _over_parameters(array, over.texts(array))


def _over_parameters(array: xr.DataArray, shown: Iterable[str]) -> str:
    if not has_interval(array.values):
        return f" That is of the next one; over the parameters: {estimate_remark(array)}."
    _, lower, upper = shown
    return (
        f" That is of the next one; over all parameters that fit the specimens as well, it is "
        f"between {lower} and {upper} ({_level(array)} interval)."
    )


def acceptance_sentence(array: xr.DataArray) -> str:
    """Return a sentence on the limit of a probability that the study accepts; empty for none."""
    acceptance = Acceptance.from_array(array)
    if acceptance is None:
        return ""
    limit = f"limit of the study, {no_break(str(acceptance))},"
    if acceptance.verdict is AcceptanceVerdict.NOT_DECIDED:
        why = "contains it" if has_interval(array.values) else "is missing"
        return f" These runs do not decide whether the {limit} is met: the interval {why}."
    where = "within" if acceptance.verdict is AcceptanceVerdict.MET else "beyond"
    return f" The {limit} is {acceptance.verdict}: the whole interval lies {where} it."


def _sentence(quantity: QuotedStatistic, array: xr.DataArray, design: str) -> str:
    name, shown = output_name(quantity.view, quantity.output), quantity.statistic.shown
    if shown.ends == "between":
        return _tolerance_interval_sentence(quantity, array, capitalized(name))
    if shown.ends:
        return _tolerance_limit_sentence(quantity, array, capitalized(name), shown.ends)
    value = quantity.texts(array)[0]
    values = quantity.view.design(design).completed_values(quantity.output)
    if bool(values.size > 1 and np.ptp(values) <= 1e-12 * np.abs(values).max()):
        return f"{capitalized(name)} is {value} in every run."
    sentence = shown.sentence
    if quantity.statistic is QUANTILE and quantity.entry == 0.5:
        sentence = f"{sentence.rstrip('.')}: half of all cases lie below."
    # All in one pass, as the name of an output may have braces itself; so may words of an archive.
    words = {
        "{entry}": entry_text(shown, quantity.entry),
        "{label}": quantity.label,
        "{output}": name,
        "{estimate}": f"{value} {quantity.interval(array)}",
    }
    said = re.sub(r"\{\w+\}", lambda place: words.get(place[0], place[0]), sentence)
    return said + over_parameters(quantity, design)


def _tolerance_limit_sentence(
    quantity: QuotedStatistic, array: xr.DataArray, name: str, beyond: str
) -> str:
    value, lower, upper = quantity.texts(array)
    bound, end = (lower, 1) if beyond == "at least" else (upper, 2)
    share = _share_of_cases(quantity.entry)
    if np.isfinite(array.values[end]):
        return (
            f"{name} is {beyond} {bound} in {share}. Best estimate {value}; the {bound} allow for "
            f"the finite number of runs ({_level(array)} confidence)."
        )
    return (
        f"{name} is {beyond} {value} in {share}, by estimate alone. No bound is known: "
        f"{estimate_remark(array)}."
    )


def _tolerance_interval_sentence(quantity: QuotedStatistic, array: xr.DataArray, name: str) -> str:
    _, lower, upper = quantity.bounds(array)
    texts = tolerance_interval_texts(float(lower), float(upper))
    lower, upper = tuple(no_break(f"{text}{quantity.unit_text}") for text in texts)
    share = _share_of_cases(quantity.entry)
    return f"{name} is from {lower} to {upper} in {share} ({_level(array)} confidence)."


def _level(array: xr.DataArray) -> str:
    return no_break(percent_text(array.attrs.get(INTERVAL_LEVEL, np.nan)))


def _share_of_cases(content: float) -> str:
    """Return a share of all cases in whole numbers, which are read more easily."""
    for whole in (100, 1_000, 10_000):
        part = content * whole
        if abs(part - round(part)) < 1e-9:
            return no_break(f"{grouped_number(round(part))} of {grouped_number(whole)} cases")
    return f"{percent_text(content)} of cases"


def _category_statistics(
    view: ArchiveView, output: str, design: str
) -> Iterator[tuple[str, QuotedStatistic, xr.DataArray]]:
    shares = view.statistics.get(design, output, "share")
    if shares is not None:
        flags = shares[CATEGORY].values.tolist()
        labels = shares["category_label"].values.tolist()
        for flag, label in zip(flags, labels, strict=True):
            quantity = QuotedStatistic(view, output, CATALOGUE["share"], flag)
            if (array := quantity.estimate(design)) is not None:
                yield f"“{plain_text(str(label), 40)}”", quantity, array


def joint_findings(view: ArchiveView, design: str) -> Iterator[Finding]:
    """Yield how often each event occurs whose probability the study requests."""
    joint = view.statistics.joint_probability(design)
    fitted = view.statistics.joint_statistics(design).get("fitted_joint_probability")
    for place, array in enumerate(() if joint is None else joint):
        event, over = capitalized(plain_text(str(array["event_condition"].values))), ""
        if fitted is not None:
            shown = percent_texts(*fitted[place].values.tolist())
            over = _over_parameters(fitted[place], map(no_break, shown))
        yield Finding(event, f"In {_stated(array)}.{acceptance_sentence(array)}{over}")


def measurement_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield what measurements say of the model, and what they teach of unknown inputs."""
    statements = (validation_statements, fit_statements, posterior_statements)
    for head, text in chain.from_iterable(each(view.tree) for each in statements):
        yield Finding(capitalized(plain_text(head)), plain_text(text, 1000))


def bound_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield what each design for bounds over intervals has found: two numbers, and the range."""
    for design in view.designs:
        for each in found_bounds(view.statistics, design):
            bounds = each.lower, each.upper
            remarks = [estimate_remark(bound).split("; ") for bound in bounds]
            # What is said of both stands behind them.
            every = sorted(
                dict.fromkeys(chain(*remarks)),
                key=lambda each: each in remarks[0] and each in remarks[1],
            )
            text = " ".join(f"{capitalized(each)}." for each in every)
            if each.range is not None:
                (lower, least, _), (upper, _, largest) = (
                    map(no_break, each.texts(bound)) for bound in bounds
                )
                over = plain_text(interval_inputs(view.tree, design))
                text = (
                    f"By {design}: from {lower} to {upper} over all values of {over}; both bounds "
                    f"lie between {least} and {largest} ({no_break(each.level)} interval). {text}"
                )
                if each.total is not None and has_interval(each.total.values):
                    _, low, high = map(no_break, each.texts(each.total))
                    text += (
                        f" Over all parameters that fit the specimens as well, it is between {low} "
                        f"and {high}: the total, which is no sum of both; "
                        f"{estimate_remark(each.total)}."
                    )
            yield Finding(capitalized(plain_text(each.title)), text)


def rare_event_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield the probability of the event of each design that was made for one, with its caveat."""
    for design in view.designs:
        joint = view.statistics.joint_probability(design)
        if joint is None or view.design(design).sampling is not Sampling.TOWARDS_EVENT:
            continue
        for array, finding in zip(joint, joint_findings(view, design), strict=True):
            remark = f" {capitalized(estimate_remark(array))}." * has_interval(array.values).item()
            yield finding._replace(text=f"By {design}: {finding.text}{remark}")
    arrays = view.statistics.joint_probabilities()
    of_events = {each for each in arrays if view.design(each).sampling is Sampling.TOWARDS_EVENT}
    for each in disagreements(arrays):
        if of_events & {each.first, each.second}:
            event = capitalized(plain_text(each.condition))
            yield Finding(event, f"{capitalized(plain_text(str(each)))}.")


def _stated(array: xr.DataArray) -> str:
    value, lower, upper = map(no_break, percent_texts(*array.values.tolist()))
    if not has_interval(array.values):
        return f"{value} of cases (without an interval: {estimate_remark(array)})"
    return f"{value} of cases ({lower} to {upper}, {_level(array)} interval)"


def decision_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield the verdict of each design on its claim, with its probability of being wrong."""
    for design in view.designs:
        if decision := view.statistics.decision(design):
            verdict = f"{capitalized(decision.verdict_text)} of {design}"
            yield Finding(plain_text(decision.claim), f"{verdict}: {decision.guarantee}.")
