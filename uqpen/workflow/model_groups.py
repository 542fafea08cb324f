"""Groups of an archive that belong to a model, or to the difference of two."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import xarray as xr

from uqpen.archive.estimates import pack
from uqpen.archive.groups import DESIGN_GROUPS
from uqpen.core.errors import TrajectoryError
from uqpen.core.labels import (
    AXIS_SCALE,
    CAVEAT,
    CITED,
    COST_SPENT,
    DIFFERENCES,
    LARGEST_CONTRIBUTION,
    MODEL_FORM,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SOURCE_KIND,
    STATISTICS_GROUP,
    SURROGATES,
    TRAJECTORY,
)
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.threads import one_blas_thread
from uqpen.designs.design import RUNS as KEPT_RUNS
from uqpen.designs.design import Design
from uqpen.execution import Progress
from uqpen.execution.omitted_runs import omit_runs
from uqpen.results.failed_runs import record_causes
from uqpen.statistics.analyze import (
    OutputStatistics,
    all_analyses_but,
    analyze,
    analyze_failures,
)
from uqpen.statistics.model_form import model_differences, model_form_shares
from uqpen.statistics.published import Publication, published_estimates
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.stopped_runs import decision_attributes, mark_uncertified
from uqpen.study.identity import model_identity
from uqpen.study.study import ValidatedStudy, Variant
from uqpen.workflow.design_runs import Runs

__all__ = [
    "AnalysisSteps",
    "Groups",
    "Source",
    "cost_attributes",
    "difference_groups",
    "failure_statistics",
    "joint_statistics",
    "model_form_groups",
    "model_groups",
    "use_stand_ins",
]

# Its fit, and its estimates.
_STEPS_OF_A_SURROGATE = 2


class AnalysisSteps:
    """Numbered steps of the analysis of a study.

    Parameters
    ----------
    study : ValidatedStudy
        The study whose runs are analysed.
    progress : Progress
        Receives a report at the start of each step.
    """

    def __init__(self, study: ValidatedStudy, progress: Progress) -> None:
        models, designs = len(study.models), len(study.designs)
        of_a_model = designs + _STEPS_OF_A_SURROGATE * len(study.surrogates) + 1
        self._total = models * of_a_model + (models - 1)
        self._progress = progress
        self._number = 0
        self._has_several_models = study.has_several_models

    def start(self, name: str, model: str = "") -> None:
        """Report the start of a step, of one model where there are several."""
        self._number += 1
        of = f" of {model}" if model and self._has_several_models else ""
        self._progress.start_step(f"{name}{of}", self._number, self._total)


Groups = Iterator[tuple[str, xr.Dataset]]


class Source(NamedTuple):
    """A design or a surrogate: attributes of its group, and its estimate arrays by output."""

    attributes: dict[str, str | int | float]
    outputs: Mapping[str, OutputStatistics]

    def groups(self, path: str, shown: Mapping[str, Mapping[str, str]]) -> Groups:
        """Yield its groups of an archive, below a path, with how each output is shown."""
        yield path, xr.Dataset(attrs=self.attributes)
        for output, statistics in self.outputs.items():
            if statistics:
                yield f"{path}/{output}", pack(statistics).assign_attrs(shown.get(output, {}))


def use_stand_ins(
    study: ValidatedStudy,
    model: str,
    design: str,
    runs: Mapping[str, Runs],
    found: dict[str, OutputStatistics],
) -> dict[str, OutputStatistics]:
    """Return the statistics of a model, of the first those with stand-ins where there are any.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    model, design : str
        The names of a model and of a design.
    runs : mapping of str to dict of str to Dataset
        All runs, by model and design.
    found : mapping of str to dict of str to DataArray
        By output, estimate arrays from the model's own runs.
    """
    family = {name: runs[name][design] for name in study.family_costs}
    if model != next(iter(family)) or len(family) < 2:
        return found
    from uqpen.statistics.control_variates import (
        control_variate_statistics,
    )

    with one_blas_thread():
        return {
            name: found[name] | control_variate_statistics(family, quantity, found[name])
            for quantity in study.quantities_of_interest
            if (name := quantity.output.name)
        }


def cost_attributes(
    study: ValidatedStudy, model: str, design: str, runs: Mapping[str, Runs]
) -> dict[str, float]:
    """Return the cost of a design's runs by all models, in runs of the first, for its statistics.

    It is known where all models of the study stand for the first. For others it is empty.
    """
    costs = study.family_costs
    if model not in costs or costs[model] < 1 or not 1 < len(costs) == len(study.models):
        return {}
    spent = sum(cost * runs[name][design].sizes[RUN] for name, cost in costs.items())
    return {COST_SPENT: float(spent)}


def model_groups(
    study: ValidatedStudy, model: str, runs: Mapping[str, Runs], steps: AnalysisSteps
) -> Groups:
    """Yield the groups of one model: runs, failures, surrogates, statistics, its trajectory.

    The first has statistics from the runs of its stand-ins, too; so `runs` are those of all models.
    """
    variant, own = study.models[model], runs[model]
    quantities = study.model_quantities(variant.model)
    sources: dict[str, Source] = {}
    for design, design_runs in own.items():
        steps.start(f"statistics of {design}", model)
        sources[design] = _design_source(study, model, design, runs)
        yield from _design_groups(study, design, design_runs)
    for name in study.surrogates:
        from uqpen.workflow.surrogate_source import surrogate_source

        fitted, sources[name] = surrogate_source(study, model, name, own, steps)
        for node in fitted.subtree:
            path = f"/{SURROGATES}/{name}{node.path}".rstrip("/")
            yield path, node.to_dataset(inherit=False)
    shown = {each.output.name: _display_attributes(each) for each in quantities}
    for name, source in sources.items():
        yield from source.groups(f"/{STATISTICS_GROUP}/{name}", shown)
    for name, publication in study.published.items():
        yield from _publication_groups(publication, f"/{STATISTICS_GROUP}/{name}")
    steps.start("trajectory at the nominal inputs", model)
    trajectory = _trajectory(study, variant)
    if trajectory is not None:
        yield f"/{TRAJECTORY}", trajectory
    if study.has_several_models:
        yield "/", xr.Dataset(attrs=model_identity(variant.model))


def _display_attributes(quantity: QuantityOfInterest) -> dict[str, str]:
    """Return how a study wants an output to be shown, as attributes of its statistics."""
    caveat = {CAVEAT: quantity.caveat} if quantity.caveat else {}
    return caveat | ({AXIS_SCALE: quantity.axis_scale} if quantity.is_logarithmic else {})


def _design_source(
    study: ValidatedStudy, model: str, design: str, runs: Mapping[str, Runs]
) -> Source:
    """Return the statistics of a model from the runs of a design."""
    own = runs[model][design]
    attributes: dict[str, str | int | float] = {
        SOURCE_KIND: "design",
        RUNS_SPENT: own.sizes[RUN],
        **decision_attributes(own),
        **cost_attributes(study, model, design, runs),
    }
    found = analyze(
        own,
        study.model_quantities(study.models[model].model),
        only=all_analyses_but(study.left_out),
        user_defined=study.analyses,
    )
    found = use_stand_ins(study, model, design, runs, found)
    return Source(attributes, mark_uncertified(found, own.attrs))


def _design_groups(study: ValidatedStudy, design: str, runs: xr.Dataset) -> Groups:
    """Yield the runs of a design, and the groups of their statistics as a whole."""
    yield f"/{RUNS}/{design}", _archived_runs(study.designs[design], runs)
    for name, group in DESIGN_GROUPS.items():
        if statistics := resolve(group.writer)(study, runs):
            yield f"/{name}/{design}", pack(statistics)


def failure_statistics(study: ValidatedStudy, runs: xr.Dataset) -> OutputStatistics:
    """Return the statistics of the failed runs of a design."""
    return analyze_failures(runs, study.confidence_level)


def _archived_runs(design: Design, runs: xr.Dataset) -> xr.Dataset:
    """Return what the archive has of the runs of a design: all of them, or no run."""
    return runs if design.keep == KEPT_RUNS else record_causes(omit_runs(runs), runs)


def joint_statistics(study: ValidatedStudy, runs: xr.Dataset) -> OutputStatistics:
    """Return the probabilities of the events of a study, and how they change with the inputs."""
    if not study.joint_events and runs.attrs[SAMPLING] != Sampling.TOWARDS_EVENT:
        return {}
    # Few studies have an event. A design for a rare event brings one of its own.
    from uqpen.statistics.event_sensitivity.event_sensitivities import event_sensitivities
    from uqpen.statistics.joint_probability import joint_probabilities

    events, level = study.joint_events, study.confidence_level
    found = joint_probabilities(runs, events, level)
    found |= event_sensitivities(runs, events, study.joint, level)
    return mark_uncertified({"": found}, runs.attrs)[""]


def _publication_groups(publication: Publication, path: str) -> Groups:
    """Yield the groups of a publication's estimates for a model."""
    yield path, xr.Dataset(attrs={SOURCE_KIND: "publication", CITED: publication.source})
    statistics = published_estimates(publication)
    for estimates in publication.estimates:
        name, largest = estimates.output.name, estimates.largest_contribution
        attributes = {LARGEST_CONTRIBUTION: largest} if largest else {}
        yield f"{path}/{name}", pack(statistics[name]).assign_attrs(attributes)


def difference_groups(
    study: ValidatedStudy, runs: Mapping[str, Runs], steps: AnalysisSteps
) -> Groups:
    """Yield the groups of each model's differences from the first, on common points."""
    first, *others = study.models
    for other in others:
        steps.start(f"differences of {other} from {first}")
        quantities = study.model_quantities(study.models[other].model)
        for design in study.designs:
            pair = runs[first][design], runs[other][design]
            for output, statistics in model_differences(*pair, quantities).items():
                path = f"/{DIFFERENCES}/{other}/{design}/{output}"
                marked = mark_uncertified({"": statistics}, pair[0].attrs)[""]
                yield path, pack(marked).assign_attrs({"minus": first})


def model_form_groups(study: ValidatedStudy, runs: Mapping[str, Runs]) -> Groups:
    """Yield the groups of the shares of model form; a stand-in is no model of its own."""
    alternatives = [name for name, each in study.models.items() if each.stand_in is None]
    for design in study.designs:
        of_design = {name: runs[name][design] for name in alternatives}
        if len(of_design) > 1:
            for output, statistics in model_form_shares(
                of_design, study.quantities_of_interest
            ).items():
                (first, *_) = of_design.values()
                marked = mark_uncertified({"": statistics}, first.attrs)[""]
                yield f"/{MODEL_FORM}/{design}/{output}", pack(marked)


def _trajectory(study: ValidatedStudy, variant: Variant) -> xr.Dataset | None:
    """Return the model's trajectory at the nominal inputs, if it has one and all are given."""
    known = {variable.name for variable in variant.model.inputs}
    given = {**study.joint.nominal(), **variant.given}
    nominal = {name: value for name, value in given.items() if name in known}
    if next(variant.model.missing_inputs(nominal), None) is not None:
        return None
    try:
        trajectory = variant.model.trajectory(nominal)
    except TrajectoryError as error:
        # The run at the nominal inputs failed, which is data as that of any run.
        trajectory = xr.Dataset(attrs={"reason": str(error)})
    attributes = {f"nominal_{name}": value for name, value in nominal.items()}
    return None if trajectory is None else trajectory.assign_attrs(attributes)
