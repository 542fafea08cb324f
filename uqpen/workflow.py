"""Workflow: from a study to the tree of datasets of its archive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import xarray as xr

from uqpen.archive.estimates import pack
from uqpen.archive.files import FILES, files_group
from uqpen.archive.provenance import CONVENTIONS, SCHEMA, of_python_functions, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE
from uqpen.core.errors import TooManyFailedError, TrajectoryError
from uqpen.core.labels import (
    CITED,
    DIFFERENCES,
    FAILURES_GROUP,
    LARGEST_CONTRIBUTION,
    MODELS,
    NOT_ESTIMATED,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SOURCE_KIND,
    STATISTICS_GROUP,
    SURROGATES,
    TRAJECTORY,
)
from uqpen.core.model import Model
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.rounds import run_rounds
from uqpen.execution import Evaluator, Map, Progress, evaluate, join_rounds
from uqpen.execution.checkpoint import Checkpoint
from uqpen.models.user_code import error_text
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, analyze, analyze_failures
from uqpen.statistics.model_differences import model_differences
from uqpen.statistics.published import Publication, published_estimates
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import (
    SurrogateStatistics,
    surrogate_statistics,
)
from uqpen.study.study import ValidatedStudy, Variant
from uqpen.surrogates.fitting import fit_surrogate, is_built_in
from uqpen.surrogates.output_surrogate import unfitted
from uqpen.trust import ValidationRuns, validate_surrogate

__all__ = ["Checkpoints", "Progress", "analyse_runs", "root_attributes", "run", "run_design"]

Groups = Iterator[tuple[str, xr.Dataset]]
Checkpoints = Callable[[str, str, int], Checkpoint]
# Runs by the name of a design, or of a model.
Runs = dict[str, xr.Dataset]


def run(
    study: ValidatedStudy,
    *,
    map: Map = map,
    progress: Progress | None = None,
    checkpoints: Checkpoints = lambda design, model, number: Checkpoint(),
) -> xr.DataTree:
    """Make all the runs of a study and analyse them.

    Parameters
    ----------
    study : ValidatedStudy
        Result of `load_study`.
    map : callable
        Like the built-in; it makes the batches of runs. It cannot change a result.
    progress : Progress, optional
        Receives reports of progress.
    checkpoints : callable
        Returns the checkpoint of the runs of a design, a model and a round, given the names of the
        design and the model and the number of the round. It may contain runs already.

    Returns
    -------
    DataTree
        The archive's content: ``/runs/<design>``, ``/statistics/<source>/<output>`` and so on. In a
        study with several models, these groups are below ``/models/<name>``.
    """
    progress = progress or Progress()
    for variant in study.models.values():
        progress.start_preparation(variant.model.name)
        variant.model.prepare()
    runs = _run_designs(study, map, progress, checkpoints)
    progress.start_analysis()
    return analyse_runs(study, runs)


def analyse_runs(study: ValidatedStudy, runs: Mapping[str, Runs]) -> xr.DataTree:
    """Analyse runs, given by model and design, and return the content of an archive."""
    groups = {"/": xr.Dataset(attrs=root_attributes(study))}
    for name, variant in study.models.items():
        root = f"/{MODELS}/{name}" if study.has_several_models else ""
        for path, dataset in _model_groups(study, variant, runs[name]):
            groups[f"{root}{path}"] = dataset
    groups |= dict(_difference_groups(study, runs))
    if files := files_group(study.files(), study.folder):
        groups[f"/{FILES}"] = files
    return xr.DataTree.from_dict(groups)


def _run_designs(
    study: ValidatedStudy, map: Map, progress: Progress, checkpoints: Checkpoints
) -> dict[str, Runs]:
    """Make the runs of every design, by model, at common points."""
    runs_by_model: dict[str, Runs] = {name: {} for name in study.models}
    for name, design in study.designs.items():
        progress.start_design(name, design.run_count(study.joint) * len(study.models))
        stream = Stream(study.seed, "designs", name)
        round_checkpoint = partial(checkpoints, name)
        try:
            runs = run_design(
                study, design, stream, map=map, progress=progress, round_checkpoint=round_checkpoint
            )
        except TooManyFailedError as error:
            raise TooManyFailedError(f"{name}: {error}") from None
        for model in study.models:
            runs_by_model[model][name] = runs[model]
    return runs_by_model


def run_design(
    study: ValidatedStudy,
    design: Design,
    stream: Stream,
    *,
    map: Map,
    progress: Progress,
    round_checkpoint: Callable[[str, int], Checkpoint] = lambda model, number: Checkpoint(),
) -> Runs:
    """Make the runs of one design by model, at common points.

    Parameters
    ----------
    study : ValidatedStudy
        Provides the models and the inputs.
    design : Design
        The study's own, or another in its place.
    stream : Stream
        Source of the design's random numbers.
    map, progress
        As in `run`.
    round_checkpoint : callable
        Returns the checkpoint of a model's runs in a round, given the model's name and the number
        of the round.
    """

    def model_runs(name: str, points: xr.Dataset, number: int) -> xr.Dataset:
        variant = study.models[name]
        try:
            return evaluate(
                Evaluator(variant.model, study.constraints),
                points.assign(variant.given),
                _display_units(study),
                map=map,
                progress=progress,
                checkpoint=round_checkpoint(name, number),
                failures=study.failures,
            )
        except TooManyFailedError as error:
            raise TooManyFailedError(f"by {name}, {error}" if name else str(error)) from None

    quantities = {
        name: study.model_quantities(variant.model) for name, variant in study.models.items()
    }
    rounds = run_rounds(
        design,
        study.joint,
        stream,
        lambda points, number: {name: model_runs(name, points, number) for name in study.models},
        lambda made: RunningEstimates(made, design.sampling, quantities, study.analyses),
    )
    sampling = {SAMPLING: str(design.sampling)}
    return {
        model: join_rounds([runs[model] for runs in rounds]).assign_attrs(sampling)
        for model in study.models
    }


class _Source(NamedTuple):
    """A design or a surrogate: attributes of its group, and its estimate arrays by output."""

    attributes: dict[str, str | int]
    outputs: Mapping[str, OutputStatistics]
    # Fields, of which there are no statistics.
    fields: Sequence[str] = ()

    def groups(self, path: str) -> Groups:
        """Yield its groups of an archive, below a path."""
        yield path, xr.Dataset(attrs=self.attributes)
        for output, statistics in self.outputs.items():
            if statistics:
                yield f"{path}/{output}", pack(statistics)
            elif output in self.fields:
                yield f"{path}/{output}", xr.Dataset(attrs={NOT_ESTIMATED: texts.SCALARS_ONLY})


def _model_groups(study: ValidatedStudy, variant: Variant, runs: Runs) -> Groups:
    """Yield the groups of one model: runs, failures, surrogates, statistics, its trajectory."""
    quantities = study.model_quantities(variant.model)
    fields = [quantity.output.name for quantity in quantities if quantity.output.dims]
    sources: dict[str, _Source] = {}
    for design, design_runs in runs.items():
        attributes: dict[str, str | int] = {
            SOURCE_KIND: "design",
            RUNS_SPENT: design_runs.sizes[RUN],
        }
        outputs = analyze(design_runs, quantities, outside=study.analyses)
        sources[design] = _Source(attributes, outputs, fields)
        failures = analyze_failures(design_runs)
        yield f"/{RUNS}/{design}", design_runs
        if failures:
            yield f"/{FAILURES_GROUP}/{design}", pack(failures)
    for name in study.surrogates:
        fitted, sources[name] = _fit_surrogate(study, variant, name, runs, sources, quantities)
        for node in fitted.subtree:
            path = f"/{SURROGATES}/{name}{node.path}".rstrip("/")
            yield path, node.to_dataset(inherit=False)
    for name, source in sources.items():
        yield from source.groups(f"/{STATISTICS_GROUP}/{name}")
    for name, publication in study.published.items():
        yield from _publication_groups(publication, f"/{STATISTICS_GROUP}/{name}")
    trajectory = _trajectory(study, variant)
    if trajectory is not None:
        yield f"/{TRAJECTORY}", trajectory
    if study.has_several_models:
        yield "/", xr.Dataset(attrs=_model_identity(variant.model))


def _publication_groups(publication: Publication, path: str) -> Groups:
    """Yield the groups of a publication's estimates for a model."""
    yield path, xr.Dataset(attrs={SOURCE_KIND: "publication", CITED: publication.source})
    statistics = published_estimates(publication)
    for estimates in publication.estimates:
        name, largest = estimates.output.name, estimates.largest_contribution
        attributes = {LARGEST_CONTRIBUTION: largest} if largest else {}
        yield f"{path}/{name}", pack(statistics[name]).assign_attrs(attributes)


def _fit_surrogate(
    study: ValidatedStudy,
    variant: Variant,
    name: str,
    runs: Runs,
    sources: Mapping[str, _Source],
    quantities: Sequence[QuantityOfInterest],
) -> tuple[xr.DataTree, _Source]:
    """Fit a surrogate to its design, and compare its estimates with those of other designs."""
    surrogate = study.surrogates[name]
    validation_runs = study.validation_designs(surrogate)
    check = runs[validation_runs[0]] if validation_runs else None
    training = runs[surrogate.design]
    try:
        tree, statistics = _surrogate_results(study, variant, name, training, check, quantities)
    except (Exception, SystemExit) as error:
        if is_built_in(surrogate):
            raise
        # Runs of the model are not lost by a mistake in a surrogate of the user's own.
        reason = f"its predictions fail: {error_text(error)}"
        fitted = unfitted(surrogate, name, training, variant.model, study.joint, reason)
        tree, statistics = fitted.to_tree(), SurrogateStatistics({}, {})
    outputs = validate_surrogate(
        statistics.outputs,
        [ValidationRuns(validation, sources[validation].outputs) for validation in validation_runs],
        statistics.training_ranges,
    )
    used = [surrogate.design, *validation_runs[:1]]
    attributes: dict[str, str | int] = {
        RUNS_SPENT: sum(runs[design].sizes[RUN] for design in used),
        "check": validation_runs[0] if validation_runs else "none",
    }
    source = _Source({SOURCE_KIND: "surrogate", **attributes}, outputs)
    if name in study.surrogate_origins:
        tree.attrs["kind"] = study.surrogate_origins[name].kind
    tree.attrs |= attributes
    return tree, source


def _surrogate_results(
    study: ValidatedStudy,
    variant: Variant,
    name: str,
    training: xr.Dataset,
    check: xr.Dataset | None,
    quantities: Sequence[QuantityOfInterest],
) -> tuple[xr.DataTree, SurrogateStatistics]:
    """Return the group of a fitted surrogate and its statistics, before their validation."""
    stream = Stream(study.seed, "surrogates", name)
    surrogate = study.surrogates[name]
    fitted = fit_surrogate(surrogate, name, training, variant.model, study.joint, stream)
    checked = fitted if check is None else fitted.with_check(check)
    draws = SurrogateDraws(checked, study.joint, study.constraints, variant.given, stream)
    statistics = surrogate_statistics(draws, quantities)
    return checked.to_tree(), statistics


def _difference_groups(study: ValidatedStudy, runs: Mapping[str, Runs]) -> Groups:
    """Yield the groups of each model's differences from the first, on common points."""
    first, *others = study.models
    for other in others:
        quantities = study.model_quantities(study.models[other].model)
        for design in study.designs:
            pair = runs[first][design], runs[other][design]
            for output, statistics in model_differences(*pair, quantities).items():
                path = f"/{DIFFERENCES}/{other}/{design}/{output}"
                yield path, pack(statistics).assign_attrs({"minus": first})


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


def _display_units(study: ValidatedStudy) -> dict[str, str]:
    """Return the display unit of each input and output."""
    units = {entry.variable.name: entry.display_unit for entry in study.joint.inputs}
    return units | {
        quantity.output.name: quantity.display_unit for quantity in study.quantities_of_interest
    }


def root_attributes(study: ValidatedStudy) -> dict[str, str | int]:
    """Return the attributes of an archive's root, which determine its numbers."""
    return {
        "title": study.title,
        "Conventions": CONVENTIONS,
        SCHEMA_ATTRIBUTE: SCHEMA,
        "study_name": study.name,
        "study_text": study.text,
        "study_sha256": study.sha256,
        # As text: a seed may be larger than any integer of NetCDF.
        "seed": str(study.seed),
        **({} if study.has_several_models else _model_identity(study.model)),
        **provenance(),
        **of_python_functions(),
    }


def _model_identity(model: Model) -> dict[str, str]:
    """Return the identity of a model as attributes of its group."""
    return {f"model_{key}": value for key, value in model.identity().items()}
