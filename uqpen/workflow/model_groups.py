"""Groups of an archive that belong to a model, or to the difference of two."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqpen.archive.estimates import pack
from uqpen.archive.groups import DESIGN_GROUPS
from uqpen.core.errors import TrajectoryError
from uqpen.core.labels import (
    AXIS_SCALE,
    CALIBRATIONS,
    CAVEAT,
    CITED,
    COST_SPENT,
    DIFFERENCES,
    LARGEST_CONTRIBUTION,
    MAGNITUDES,
    MEASURED,
    MODEL_FORM,
    REPEATS,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SOURCE_KIND,
    STATISTICS_GROUP,
    SURROGATES,
    TRAJECTORY,
    VALIDATION,
)
from uqpen.core.lookup import resolve
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.at_experiments import DesignAtExperiments, MeasuredDesign
from uqpen.designs.design import RUNS as KEPT_RUNS
from uqpen.designs.repeated import RepeatedDesign
from uqpen.execution import Progress
from uqpen.execution.omitted_runs import omit_runs
from uqpen.measurements.experiments import ValidationSettings
from uqpen.results.failed_runs import record_causes
from uqpen.statistics.analyze import (
    OutputStatistics,
    all_analyses_but,
    analyze,
    analyze_failures,
    analyze_repeats,
    in_catalogue_order,
)
from uqpen.statistics.model_form import model_differences, model_form_shares
from uqpen.statistics.published import Publication, published_estimates
from uqpen.statistics.stopped_runs import decision_attributes, mark_uncertified
from uqpen.study.identity import model_attributes
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.design_runs import Runs
from uqpen.workflow.noise_check import label_noise

if TYPE_CHECKING:
    from uqpen.statistics.validation import Validation

Groups = Iterator[tuple[str, xr.Dataset]]

# A design or a surrogate: attributes of its group, and its estimate arrays by output.
_Source = tuple[dict[str, str | int | float], Mapping[str, OutputStatistics]]


class AnalysisSteps:
    """Numbered steps of the analysis of a study, reported as they start."""

    def __init__(self, study: ValidatedStudy, progress: Progress) -> None:
        # A surrogate has two: its fit, and its estimates.
        of_a_model = len(study.designs) + 2 * len(study.surrogates) + 1
        self._total = len(study.models) * (of_a_model + 1) - 1
        self._progress, self._number = progress, 0
        self._has_several_models = study.has_several_models

    def start(self, name: str, model: str = "") -> None:
        """Report the start of a step, of one model where there are several."""
        self._number += 1
        of = f" of {model}" if model and self._has_several_models else ""
        self._progress.start_step(f"{name}{of}", self._number, self._total)


def model_groups(
    study: ValidatedStudy,
    model: str,
    whole: Mapping[str, Runs],
    runs: Mapping[str, Runs],
    steps: AnalysisSteps,
) -> Groups:
    """Yield the groups of one model: runs, failures, surrogates, statistics, its trajectory.

    The first has statistics from the runs of its stand-ins, too; so the runs are those of all
    models. `whole` are all of them, which surrogates and statistics of repeats take; `runs` are the
    first at each point, which statistics see that know no repeats.
    """
    variant, own = study.models[model], runs[model]
    sources: dict[str, _Source] = {}
    for design, every in whole[model].items():
        steps.start(f"statistics of {design}", model)
        sources[design] = _design_source(study, model, design, whole, runs)
        groups = dict(_design_groups(study, design, every, own[design]))
        yield from groups.items()
        yield from _validation_groups(study, model, design, runs, groups)
    for name in study.surrogates:
        from uqpen.workflow.surrogate_source import surrogate_source

        fitted, attributes, outputs = surrogate_source(
            study, model, name, whole[model], steps.start
        )
        sources[name] = attributes, label_noise(outputs, variant.model, own, is_of_surrogate=True)
        for node in fitted.subtree:
            path = f"/{SURROGATES}/{name}{node.path}".rstrip("/")
            yield path, node.to_dataset(inherit=False)
    # How the study wants each output to be shown.
    shown = {
        each.output.name: {
            **({CAVEAT: each.caveat} if each.caveat else {}),
            **({AXIS_SCALE: each.axis_scale} if each.is_logarithmic else {}),
        }
        for each in study.model_quantities(variant.model)
    }
    for name, (attributes, outputs) in sources.items():
        path = f"/{STATISTICS_GROUP}/{name}"
        yield path, xr.Dataset(attrs=attributes)
        for output, statistics in outputs.items():
            if statistics:
                yield f"{path}/{output}", pack(statistics).assign_attrs(shown.get(output, {}))
    for name, publication in study.published.items():
        yield from _publication_groups(
            publication, f"/{STATISTICS_GROUP}/{name}", own, study.confidence_level
        )
    steps.start("trajectory at the nominal inputs", model)
    trajectory = _trajectory(study, model)
    if trajectory is not None:
        yield f"/{TRAJECTORY}", trajectory
    if study.has_several_models:
        attributes = {**model_attributes(variant.model), **variant.relation}
        yield "/", xr.Dataset(attrs=attributes)


def _design_source(
    study: ValidatedStudy,
    model: str,
    design: str,
    whole: Mapping[str, Runs],
    runs: Mapping[str, Runs],
) -> _Source:
    """Return the statistics of a model from the runs of a design.

    `whole` are all runs of all models and designs, `runs` the first at each point.
    Those of the first model are from the runs of its stand-ins, too, if it has any.
    """
    own, every, costs = runs[model][design], whole[model][design], study.family_costs
    made = study.designs[design]
    has_stand_ins = len(costs) > 1 and model == next(iter(costs))
    attributes: dict[str, str | int | float] = {
        SOURCE_KIND: "design",
        RUNS_SPENT: every.sizes[RUN],
        **({REPEATS: made.repeats} if isinstance(made, RepeatedDesign) else {}),
        **decision_attributes(own),
    }
    # The cost of all models is known where they stand for the first.
    if has_stand_ins and len(costs) == len(study.models):
        spent = sum(cost * whole[name][design].sizes[RUN] for name, cost in costs.items())
        attributes[COST_SPENT] = float(spent)
    quantities = study.model_quantities(study.models[model].model)
    only = all_analyses_but(study.left_out)
    found = analyze(own, quantities, only=only, user_defined=study.analyses)
    for name, of_all in analyze_repeats(every, quantities, only=only).items():
        found[name] = in_catalogue_order(found[name] | of_all)
    if study.joint.boxes or study.joint.fitted:
        from uqpen.statistics.statistics_over_unknowns import statistics_over_unknowns

        with one_blas_thread():
            for name, over in statistics_over_unknowns(
                own, quantities, study.joint, only=only
            ).items():
                found[name] = in_catalogue_order(found[name] | over)
    if has_stand_ins:
        from uqpen.statistics.control_variates import control_variate_statistics

        family = {name: runs[name][design] for name in costs}
        with one_blas_thread():
            found = {
                name: found[name] | control_variate_statistics(family, quantity, found[name])
                for quantity in study.quantities_of_interest
                if (name := quantity.output.name)
            }
    labelled = label_noise(found, study.models[model].model, runs[model], is_of_surrogate=False)
    return attributes, mark_uncertified(labelled, own.attrs)


def _design_groups(
    study: ValidatedStudy, design: str, whole: xr.Dataset, runs: xr.Dataset
) -> Groups:
    """Yield the runs of a design, all or none, and the groups of their statistics as a whole.

    Statistics are of `runs`, the first at each point.
    """
    is_kept = study.designs[design].keep == KEPT_RUNS
    yield f"/{RUNS}/{design}", whole if is_kept else record_causes(omit_runs(whole), whole)
    for name, group in DESIGN_GROUPS.items():
        found = resolve(group.writer)(study, design, runs)
        below = {key: each for key, each in found.items() if isinstance(each, xr.Dataset)}
        if statistics := {key: found[key] for key in found if key not in below}:
            yield f"/{name}/{design}", pack(statistics)
        for key, dataset in below.items():
            yield f"/{name}/{design}/{key}", dataset


def failure_statistics(study: ValidatedStudy, design: str, runs: xr.Dataset) -> OutputStatistics:
    """Return the statistics of the failed runs of a design."""
    return analyze_failures(runs, study.confidence_level)


def joint_statistics(study: ValidatedStudy, design: str, runs: xr.Dataset) -> OutputStatistics:
    """Return the probabilities of the events of a study, and how they change with the inputs."""
    if not study.joint_events and runs.attrs[SAMPLING] != Sampling.TOWARDS_EVENT:
        return {}
    # Few studies have an event. A design for a rare event brings one of its own.
    from uqpen.statistics.event_sensitivity.event_sensitivities import event_sensitivities
    from uqpen.statistics.joint_probability import joint_probabilities

    events, level = study.joint_events, study.confidence_level
    found = joint_probabilities(runs, events, level)
    is_sample = runs.attrs[SAMPLING] in (Sampling.INDEPENDENT, Sampling.STRATIFIED)
    if "joint_probability" in found and study.joint.fitted and is_sample:
        from uqpen.statistics.statistics_over_unknowns import events_over_draws

        with one_blas_thread():
            found["fitted_joint_probability"] = events_over_draws(
                runs, found["joint_probability"], events, study.joint, level
            )
    found |= event_sensitivities(runs, events, study.joint, level)
    return mark_uncertified({"": found}, runs.attrs)[""]


def bound_statistics(study: ValidatedStudy, design: str, runs: xr.Dataset) -> OutputStatistics:
    """Return the bounds of the probabilities of events over the intervals of a study."""
    if runs.attrs[SAMPLING] == Sampling.OVER_BOX and study.joint_events:
        from uqpen.statistics.statistics_over_unknowns import event_bounds_over_boxes

        return event_bounds_over_boxes(
            runs, study.joint_events, study.joint, study.confidence_level
        )
    if runs.attrs[SAMPLING] != Sampling.TOWARDS_BOUNDS:
        return {}
    from uqpen.statistics.interval_bounds import event_bounds

    return event_bounds(runs, study.confidence_level)


def calibration_statistics(
    study: ValidatedStudy, design: str, runs: xr.Dataset
) -> dict[str, xr.DataArray | xr.Dataset]:
    """Return what runs that follow measurements say of the unknowns; none of other designs.

    Datasets are groups of draws, by their names.
    """
    made = study.designs[design]
    if not isinstance(made, MeasuredDesign):
        return {}
    from uqpen.designs.least_squares import LeastSquares
    from uqpen.statistics.calibration import fit_statistics
    from uqpen.statistics.posterior import posterior_statistics
    from uqpen.statistics.weighted_posterior import weighted_groups, weighted_statistics

    level, stream = study.confidence_level, Stream(study.seed, CALIBRATIONS, design)
    with one_blas_thread():
        if isinstance(made, LeastSquares):
            return dict(fit_statistics(made, study.joint, runs, level))
        of = (study.joint, made.experiments, runs, stream)
        if made.sampling is Sampling.WEIGHTED_POSTERIOR:
            return dict(chain(weighted_statistics(*of[1:3], level), weighted_groups(*of)))
        return dict(posterior_statistics(*of, level))


def _validation_groups(
    study: ValidatedStudy,
    model: str,
    design: str,
    runs: Mapping[str, Runs],
    groups: Mapping[str, xr.Dataset],
) -> Groups:
    """Yield what measurements say of a model, for each output and a design at experiments.

    Those of a posterior are the rows that it has not learnt from. `groups` has its draws.
    """
    made = study.designs[design]
    is_fit = isinstance(made, MeasuredDesign)
    if not isinstance(made, DesignAtExperiments | MeasuredDesign):
        return
    experiments = made.experiments.left_out if is_fit else made.experiments.without_discrepancy()
    if not experiments.count:
        return
    from uqpen.statistics.posterior import POSTERIOR_DRAWS, left_out_predictions
    from uqpen.statistics.validation import (
        score_difference,
        validation_statistics,
        validations_at_experiments,
    )

    (section,) = experiments.sections
    settings = study.validations.get(section.name, ValidationSettings())
    stream, level = Stream(study.seed, "validation", design), study.confidence_level

    def validations(name: str) -> Iterator[Validation]:
        of_design, sizes = runs[name][design], experiments.errors.scales
        if is_fit:
            draws = (groups.get(f"/{CALIBRATIONS}/{design}/{each}") for each in POSTERIOR_DRAWS)
            predicted, sizes = left_out_predictions(made.experiments, of_design, *draws)
        else:
            predicted = experiments.predicted(of_design)
        of = (predicted, sizes, study.joint, stream, level)
        return validations_at_experiments(experiments, settings, *of)

    first = next(iter(study.models))
    with one_blas_thread():
        rows = ((each, own) for each, own in experiments.rows if len(each.values))
        judged = [*validations(model)]
        pairs = zip(rows, judged, judged if model == first else validations(first), strict=True)
        for (each, own), found, of_first in pairs:
            statistics = dict(experiments.described_rows(own))
            if is_fit:  # they are experiments behind those with measurements
                statistics["experiment_number"] += made.experiments.count
            statistics |= dict(validation_statistics(found, each.output))
            if model != first:
                difference = score_difference(of_first, found)
                statistics["score_difference"] = difference.to_array(
                    units=each.output.unit,
                    long_name="difference of mean scores",
                    level=study.confidence_level,
                )
            packed = pack(statistics).assign_attrs({MEASURED: section.name})
            yield f"/{VALIDATION}/{design}/{each.output.name}", packed


def _publication_groups(publication: Publication, path: str, runs: Runs, level: float) -> Groups:
    """Yield the groups of a publication's estimates beside a model and its runs."""
    head = {SOURCE_KIND: "publication", CITED: publication.source}
    yield (
        path,
        xr.Dataset(attrs=head | ({MAGNITUDES: "responses"} if publication.magnitudes else {})),
    )
    statistics = published_estimates(publication, runs, level)
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
            of_answers = bool(study.swept or study.models[other].finer_than)
            found = model_differences(*pair, quantities, of_answers=of_answers)
            for output, statistics in found.items():
                path = f"/{DIFFERENCES}/{other}/{design}/{output}"
                marked = mark_uncertified({"": statistics}, pair[0].attrs)[""]
                yield path, pack(marked).assign_attrs({"minus": first})


def model_form_groups(study: ValidatedStudy, runs: Mapping[str, Runs]) -> Groups:
    """Yield the groups of the shares of model form.

    A stand-in is no model of its own, and neither is the same model that is finer.
    """
    if study.swept:  # its values are no alternatives, of which one is right
        return
    alternatives = [name for name, each in study.models.items() if not each.relation]
    for design in study.designs:
        of_design = {name: runs[name][design] for name in alternatives}
        if len(of_design) > 1:
            for output, statistics in model_form_shares(
                of_design, study.quantities_of_interest
            ).items():
                (first, *_) = of_design.values()
                marked = mark_uncertified({"": statistics}, first.attrs)[""]
                yield f"/{MODEL_FORM}/{design}/{output}", pack(marked)


def _trajectory(study: ValidatedStudy, model: str) -> xr.Dataset | None:
    """Return the model's trajectory at the nominal inputs, if it has one and all are given."""
    variant = study.models[model]
    known = {variable.name for variable in variant.model.inputs}
    given = {**study.joint.nominal(), **variant.given}
    points = {key: np.array([value]) for key, value in given.items()}
    columns = study.run_seeds(model).columns(points)
    nominal = {name: values.item() for name, values in columns.items() if name in known}
    if next(variant.model.missing_inputs(nominal), None) is not None:
        return None
    try:
        trajectory = variant.model.trajectory(nominal)
    except TrajectoryError as error:
        # The run at the nominal inputs failed, which is data as that of any run.
        trajectory = xr.Dataset(attrs={"reason": str(error)})
    attributes = {f"nominal_{name}": value for name, value in nominal.items()}
    return None if trajectory is None else trajectory.assign_attrs(attributes)
