"""Summary of a study: its model, inputs, outputs and designs as tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape

from uqpen.core.catalogue import REQUESTED
from uqpen.core.errors import counted
from uqpen.core.html import html_table
from uqpen.core.lookup import family_name, resolve
from uqpen.core.sampling import Sampling
from uqpen.core.settings import declared_settings
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.designs import DESIGNS
from uqpen.designs.at_experiments import DesignAtExperiments
from uqpen.designs.design import RUNS
from uqpen.designs.repeated import RepeatedDesign, each_point_once
from uqpen.distributions.joint_distribution import DerivedInput, FixedInput
from uqpen.models.data.data_model import DataModel
from uqpen.statistics.quantity_of_interest import (
    DEFAULT_QUANTILES,
    Acceptable,
    QuantityOfInterest,
)
from uqpen.study import SECTIONS
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.refinement import RefinedDesign

Rows = list[tuple[str, ...]]

# Runs that nobody makes by chance where each costs something.
_MANY_RUNS = 1000


def models_text(study: ValidatedStudy) -> str:
    """Return the names of a study's models."""
    if not study.has_several_models:
        return f"model {study.model.name}"
    if study.swept:
        return f"model {study.model.name} at {len(study.models)} values"
    named = (f"{name} ({variant.model.name})" for name, variant in study.models.items())
    return f"models {', '.join(named)}"


def input_rows(study: ValidatedStudy) -> Rows:
    """Return the name of each input with its value or its distribution."""
    rows: Rows = []
    nominal = study.joint.nominal()
    for entry in study.joint.inputs:
        unit = "" if entry.display_unit == DIMENSIONLESS else f" {entry.display_unit}"
        if isinstance(entry, FixedInput) and entry.variable.labels:
            text = entry.variable.labels[int(entry.value)]
        elif isinstance(entry, FixedInput):
            text = f"{scale(entry.display_unit).from_si(entry.value):.10g}{unit}"
        elif isinstance(entry, DerivedInput):
            value = scale(entry.display_unit).from_si(nominal[entry.variable.name])
            text = f"{entry.formula.text}, which is {value:.6g}{unit} at the medians of the others"
        else:
            text = entry.description
        rows.append((entry.variable.name, text))
    rows += _swept_rows(study)
    if isinstance(study.model, DataModel):
        stated = {entry.variable.name for entry in study.joint.inputs}
        for variable in study.model.inputs:
            if variable.name in stated:
                continue
            if variable.labels:
                rows.append((variable.name, f"{', '.join(variable.labels)} in {study.model.name}"))
                continue
            points = study.model.points[variable.name]
            values = scale(variable.preferred_unit).from_si(points)
            unit = "" if variable.preferred_unit == DIMENSIONLESS else f" {variable.preferred_unit}"
            text = f"{values.min():.4g} to {values.max():.4g}{unit} in {study.model.name}"
            rows.append((variable.name, text))
    return rows


def _swept_rows(study: ValidatedStudy) -> Iterator[tuple[str, str]]:
    """Yield the name of each swept input with its values."""
    for name in study.swept:
        variable = study.model.input(name)
        own = dict.fromkeys(each.given[name] for each in study.models.values())
        if variable.labels:
            texts = [variable.labels[int(value)] for value in own]
        else:
            shown = scale(variable.preferred_unit)
            texts = [f"{shown.from_si(value):.10g}" for value in own]
        unit = "" if variable.preferred_unit == DIMENSIONLESS else f" {variable.preferred_unit}"
        yield name, f"{', '.join(texts)}{unit}, at the same points"


def output_rows(study: ValidatedStudy) -> Rows:
    """Return the name of each output, and of each joint event, with what is estimated of it."""
    return [
        *(
            (quantity.output.name, "; ".join([*_derived(study, quantity), *_requested(quantity)]))
            for quantity in study.quantities_of_interest
        ),
        *((event.name, f"P({event.condition}){_accepted(event)}") for event in study.joint_events),
    ]


def design_rows(study: ValidatedStudy) -> Rows:
    """Return the name of each design with its kind and its number of runs."""
    rows: Rows = []
    for name, design in study.designs.items():
        once = each_point_once(design)
        at = once.experiments.name if isinstance(once, DesignAtExperiments) else ""
        once = once.drawn if isinstance(once, DesignAtExperiments) else once
        first = once.initial if isinstance(once, RefinedDesign) else once
        kind = family_name(DESIGNS, first) or type(first).__name__
        if isinstance(design, RefinedDesign):
            kind = f"{kind}, refined by {design.name}"
        if at:
            kind = f"{kind}, at the experiments of {at}"
        if isinstance(design, RepeatedDesign):
            kind = f"{kind}, {design.repeats} runs at each point"
        runs = f"{_at_most(design.ends_early)}{design.run_count(study.joint)}"
        rows.append((name, kind, runs))
    return rows


def runs_text(study: ValidatedStudy) -> str:
    """Return the number of all runs of a study."""
    ends_early = any(design.ends_early for design in study.designs.values())
    return f"{_at_most(ends_early)}{counted(study.runs, 'run')}"


def surrogate_rows(study: ValidatedStudy) -> Rows:
    """Return the name of each surrogate with its design and its check design."""
    return [
        (name, surrogate.design, surrogate.check or "nothing")
        for name, surrogate in study.surrogates.items()
    ]


def unfitted_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield the outputs that surrogates fit not at all, or not in every case, with the reasons."""
    companions = {each.output.name for each in study.model.derived if each.output.categories}
    outputs: dict[str, list[str]] = {}
    for output in study.model.all_outputs if study.surrogates else ():
        if output.name in companions:
            continue
        if output.categories:
            text = "no surrogate of {}: it has kinds, not numbers"
        elif output.absent:
            text = f"a surrogate of {{}} only if no run lacks it, as where {output.absent}"
        elif output.may_end:
            text = (
                "surrogates of {}, which may end: up to the place that all training curves reach, "
                f"or along {output.dims[0].title} scaled by the end of each, whichever predicts "
                "runs left out better"
            )
        else:
            continue
        outputs.setdefault(text, []).append(output.name)
    for text, found in outputs.items():
        yield text.format(", ".join(found))


def default_run_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield a warning of a design with most of the runs, whose number the study does not state.

    Runs of a vectorised model cost little, so that there is none of these.
    """
    stated = study.content.get("designs", {})
    for name, design in study.designs.items():
        runs = design.run_count(study.joint)
        counts = {
            declared.key or field.name: field.default
            for field, declared in declared_settings(design)
            if declared.kind == "count" and type(field.default) is int
        }
        is_default = bool(counts) and name in stated and counts.keys().isdisjoint(stated[name])
        if is_default and runs >= max(_MANY_RUNS, 0.9 * study.runs) and not study.model.vectorized:
            numbers = ", ".join(f"{key} = {value}" for key, value in counts.items())
            count = f"{_at_most(design.ends_early)}{runs}"
            yield f"warning: {name} makes {count} of the {study.runs} runs by default ({numbers})"


def unanswered_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield a warning of what a study asks for, where none of its runs are a sample."""
    designs = [each_point_once(design) for design in study.designs.values()]
    is_over_box = any(each.sampling_of(study.joint) is Sampling.OVER_BOX for each in designs)
    if study.surrogates or is_over_box or any(each.samples_inputs(study.joint) for each in designs):
        return
    found = []
    for quantity in study.quantities_of_interest:
        name = quantity.output.name
        given = [
            (each.sampling, p)
            for p in quantity.quantiles
            for each in designs
            if each.gives_quantile(name, p)
        ]
        has_limits = any(sampling is Sampling.TOWARDS_EVENT for sampling, _ in given)
        asked = [*_probabilities(quantity), *_further(quantity, with_limits=not has_limits)]
        # All studies have some quantiles, for which none has to ask.
        known = {*DEFAULT_QUANTILES, *(p for _, p in given)}
        asked += [f"quantile {p:g}" for p in quantity.quantiles if p not in known]
        found += [f"{', '.join(asked)} of {name}"] * bool(asked)
    if found:
        yield (
            f"warning: nothing answers {'; '.join(found)}: no design is a sample of the inputs, "
            "and one for bounds or for a rare event answers what it names itself"
        )


def section_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield what sections state in a line each: limits, treatment of failed runs, constraints."""
    if isinstance(study.model, DataModel):
        yield from filter(None, [study.model.dropped, study.model.coded])
        yield from (f"warning: {each}" for each in study.model.distant)
    for variant in study.models.values():
        yield from variant.model.remarks
    for section in sorted(SECTIONS.values(), key=lambda each: each.rank):
        if section.lines:
            yield from resolve(section.lines)(study)


def run_limit_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield the limits of a run of each model, and what is declared of its noise."""
    for name, variant in study.models.items():
        limits = variant.model.run_limits
        allowed = [] if limits.seconds is None else [f"{limits.seconds:g} s"]
        allowed += [] if limits.bytes is None else [f"{limits.bytes / 1e6:.10g} MB of memory"]
        if allowed:
            of = f" of {name}" * study.has_several_models
            yield f"each run{of} may take {' and '.join(allowed)}"
        noise, model = variant.model.noise, name or "the model"
        if noise.is_unseeded:
            yield f"{model} has noise and no seed: no run can be repeated"
        elif noise.seed:
            yield f"{model} has noise; {noise.seed} is the seed of each run"


def failure_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield what is done about failed runs."""
    if study.failures.retry:
        yield f"a failed run is repeated at most {study.failures.retry} times"
    if study.failures.at_most < 1:
        share = f"{100 * study.failures.at_most:.10g} %"
        yield f"the study stops if more than {share} of a design's runs fail"


def design_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield what designs say of themselves, and those whose runs the archive does not keep."""
    for name, design in study.designs.items():
        yield from (f"{name}: {each}" for each in design.remarks(study.joint))
        if design.keep != RUNS:
            yield f"the archive has the statistics of {name}, and not its runs"


def constraint_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield the constraints on the points."""
    for constraint in study.constraints:
        yield f"only where {constraint.text}"


def study_html(study: ValidatedStudy) -> str:
    """Return a summary of a study as HTML."""
    parts = [
        f"<p><b>{escape(study.title)}</b><br>{escape(models_text(study))}, seed {study.seed}</p>"
    ]
    for head, rows in (
        (("input", "value or distribution"), input_rows(study)),
        (("output", "statistics"), output_rows(study)),
        (("design", "kind", "runs"), design_rows(study)),
        (("surrogate", "fitted to", "checked by"), surrogate_rows(study)),
    ):
        if rows:
            parts.append(html_table(head, rows))
    return "\n".join(parts)


def _at_most(ends_early: bool) -> str:
    return "at most " if ends_early else ""


def _derived(study: ValidatedStudy, quantity: QuantityOfInterest) -> list[str]:
    """Return what a derived output is, such as "largest infected along time"."""
    names = [each.output.name for each in study.model.derived]
    return [quantity.output.title] if quantity.output.name in names else []


def _requested(quantity: QuantityOfInterest) -> list[str]:
    if quantity.output.dims:
        along = ", ".join(f"{each.name} ({len(each.values)})" for each in quantity.output.dims)
        statistics = f"mean, standard deviation, quantiles {_listed(quantity.quantiles)}"
        return [f"at each place along {along}: {statistics}", *_probabilities(quantity)]
    if quantity.output.categories:
        return ["shares of " + ", ".join(category.label for category in quantity.output.categories)]
    return [
        f"moments, cdf, quantiles {_listed(quantity.quantiles)}",
        *_probabilities(quantity),
        *_further(quantity),
    ]


def _further(quantity: QuantityOfInterest, *, with_limits: bool = True) -> Iterator[str]:
    """Yield the requested statistics with words of their own, perhaps without tolerance limits."""
    for statistic in REQUESTED:
        if statistic.asked.summary and (with_limits or not statistic.shown.ends):
            for entry in quantity.requested(statistic):
                yield statistic.asked.summary.replace("{entry}", f"{entry:.10g}")


def _listed(probabilities: Iterable[float]) -> str:
    return ", ".join(f"{p:g}" for p in probabilities)


def _probabilities(quantity: QuantityOfInterest) -> list[str]:
    """Return the requested probabilities of lying beyond a value."""
    return [
        *(f"P(> {each.text}){_accepted(each)}" for each in quantity.thresholds),
        *(f"P(< {each.text}){_accepted(each)}" for each in quantity.lower_thresholds),
    ]


def _accepted(request: Acceptable) -> str:
    """Return the acceptance limits of a probability, to stand behind it; empty for none."""
    limits = (("at least", request.accepted.at_least), ("at most", request.accepted.at_most))
    return "".join(f", {words} {limit:g}" for words, limit in limits if limit is not None)
