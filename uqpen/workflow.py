"""The main path: a study in, a tree of datasets out."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import xarray as xr

from uqpen.archive.files import FILES, files_group
from uqpen.archive.provenance import CONVENTIONS, SCHEMA, of_python_functions, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE
from uqpen.comparison import Source, compare_sources
from uqpen.core.errors import TooManyFailedError, TrajectoryError
from uqpen.core.labels import (
    COMPARISON,
    DIFFERENCES,
    MODELS,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SURROGATES,
    TRAJECTORY,
)
from uqpen.core.model import Model
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.execution import Evaluator, Map, Progress, evaluate, join_rounds, worst_status_runs
from uqpen.execution.checkpoint import Checkpoint
from uqpen.statistics.analyze import analyze
from uqpen.statistics.model_differences import model_differences
from uqpen.statistics.published import published_estimates
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import Study, Variant
from uqpen.trust import ValidationRuns, validate_surrogate

__all__ = ["Progress", "analyse_runs", "root_attributes", "run", "run_design"]

Groups = Iterator[tuple[str, xr.Dataset]]
Checkpoints = Callable[[str, str, int], Checkpoint]
# The runs of each design by its name, or of each model by its.
Runs = dict[str, xr.Dataset]


def run(
    study: Study,
    *,
    map: Map = map,
    progress: Progress | None = None,
    checkpoints: Checkpoints = lambda design, model, number: Checkpoint(),
) -> xr.DataTree:
    """Make all the runs of a study and analyse them.

    Parameters
    ----------
    study : Study
        What `load_study` returns.
    map : callable
        Like the built-in: where batches of runs are made. It cannot change a result.
    progress : Progress, optional
        Told how far it is.
    checkpoints : callable
        From a design's name, a model's and the number of a round to who keeps those runs, and may
        have kept some of them before.

    Returns
    -------
    DataTree
        The archive's content: ``/runs/<design>``, ``/moments/<design>`` and so on; of a study with
        several models, all that under ``/models/<name>``.
    """
    progress = progress or Progress()
    for variant in study.models.values():
        progress.start_preparation(variant.model.name)
        variant.model.prepare()
    runs = _run_designs(study, map, progress, checkpoints)
    progress.start_analysis()
    return analyse_runs(study, runs)


def analyse_runs(study: Study, runs: Mapping[str, Runs]) -> xr.DataTree:
    """What an archive holds, of runs that have been made.

    Parameters
    ----------
    study : Study
        Whose runs they are.
    runs : mapping of str to mapping of str to Dataset
        By model, those of every design; an archive's do as well as fresh ones.
    """
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
    study: Study, map: Map, progress: Progress, checkpoints: Checkpoints
) -> dict[str, Runs]:
    """The runs of every design, by model, on common points."""
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
    study: Study,
    design: Design,
    stream: Stream,
    *,
    map: Map,
    progress: Progress,
    round_checkpoint: Callable[[str, int], Checkpoint] = lambda model, number: Checkpoint(),
) -> Runs:
    """The runs of one design by model, on common points.

    Parameters
    ----------
    study : Study
        Whose models and inputs they are.
    design : Design
        The study's own, or another in its place.
    stream : Stream
        Where the design's random numbers come from.
    map : callable
        Like the built-in: where batches of runs are made.
    progress : Progress
        Told how far it is.
    round_checkpoint : callable
        From a model's name and the number of a round to who keeps its runs.
    """

    def made(points: xr.Dataset, number: int) -> Runs:
        """The runs of a round, by model."""
        return {name: of_model(name, points, number) for name in study.models}

    def of_model(name: str, points: xr.Dataset, number: int) -> xr.Dataset:
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

    rounds = list(_run_rounds(design.rounds(study.joint, stream), made))
    sampling = {SAMPLING: str(design.sampling)}
    return {
        model: join_rounds([runs[model] for runs in rounds]).assign_attrs(sampling)
        for model in study.models
    }


def _run_rounds(rounds: Rounds, made: Callable[[xr.Dataset, int], Runs]) -> Iterator[Runs]:
    """The runs of a design by model, round by round; each round may depend on the one before."""
    points = next(rounds)
    for number in itertools.count():
        runs = made(points, number)
        yield runs
        try:
            points = rounds.send(worst_status_runs(list(runs.values())))
        except StopIteration:
            return


def _model_groups(study: Study, variant: Variant, runs: Runs) -> Groups:
    """All that is told of one model: its runs, what they tell, its course."""
    quantities = study.model_quantities(variant.model)
    for design, design_runs in runs.items():
        yield f"/{RUNS}/{design}", design_runs
    sources = {
        design: Source("design", design_runs.sizes[RUN], analyze(design_runs, quantities))
        for design, design_runs in runs.items()
    }
    for name in study.surrogates:
        fitted, source = _fit_surrogate(study, variant, name, runs, sources)
        yield f"/{SURROGATES}/{name}", fitted
        sources[name] = source
    for name, source in sources.items():
        for analysis, statistics in source.groups.items():
            yield f"/{analysis}/{name}", statistics
    yield f"/{COMPARISON}", compare_sources(sources)
    for name, publication in study.published.items():
        for group, estimates in published_estimates(publication).items():
            yield f"/{group}/{name}", estimates
    trajectory = _trajectory(study, variant)
    if trajectory is not None:
        yield f"/{TRAJECTORY}", trajectory
    if study.has_several_models:
        yield "/", xr.Dataset(attrs=_model_identity(variant.model))


def _fit_surrogate(
    study: Study, variant: Variant, name: str, runs: Runs, sources: Mapping[str, Source]
) -> tuple[xr.Dataset, Source]:
    """A surrogate fitted to its design, and what it tells as far as other designs vouch for it."""
    surrogate = study.surrogates[name]
    stream = Stream(study.seed, "surrogates", name)
    training = runs[surrogate.design]
    fitted = surrogate.fit(name, training, variant.model, study.joint, stream)
    validation_runs = study.validation_designs(surrogate)
    checked = fitted.with_check(runs[validation_runs[0]]) if validation_runs else fitted
    draws = SurrogateDraws(checked, study.joint, study.constraints, variant.given, stream)
    statistics = surrogate_statistics(draws, study.model_quantities(variant.model))
    groups = validate_surrogate(
        statistics.groups,
        [ValidationRuns(validation, sources[validation].groups) for validation in validation_runs],
        statistics.training_ranges,
    )
    spent = sum(sources[design].runs for design in [surrogate.design, *validation_runs[:1]])
    attributes = {RUNS_SPENT: spent, "check": validation_runs[0] if validation_runs else "none"}
    return checked.to_dataset().assign_attrs(attributes), Source("surrogate", spent, groups)


def _difference_groups(study: Study, runs: Mapping[str, Runs]) -> Groups:
    """What each model's outputs differ by from the first's, on common points."""
    first, *others = study.models
    for other in others:
        quantities = study.model_quantities(study.models[other].model)
        for design in study.designs:
            pair = runs[first][design], runs[other][design]
            for analysis, statistics in model_differences(*pair, quantities).items():
                attributes = {"minus": first}
                path = f"/{DIFFERENCES}/{other}/{analysis}/{design}"
                yield path, statistics.assign_attrs(attributes)


def _trajectory(study: Study, variant: Variant) -> xr.Dataset | None:
    """The model's course at the nominal inputs, where it has one and all are given."""
    known = {variable.name for variable in variant.model.inputs}
    nominal = {
        name: value
        for name, value in {**study.joint.nominal(), **variant.given}.items()
        if name in known
    }
    if next(variant.model.missing_inputs(nominal), None) is not None:
        return None
    try:
        trajectory = variant.model.trajectory(nominal)
    except TrajectoryError as error:
        # The one run at the nominal inputs failed, which is data as any run's failure is.
        trajectory = xr.Dataset(attrs={"reason": str(error)})
    if trajectory is None:
        return None
    return trajectory.assign_attrs({f"nominal_{name}": value for name, value in nominal.items()})


def _display_units(study: Study) -> dict[str, str]:
    """The unit to show each input and output in."""
    units = {entry.variable.name: entry.display_unit for entry in study.joint.inputs}
    return units | {
        quantity.output.name: quantity.display_unit for quantity in study.quantities_of_interest
    }


def root_attributes(study: Study) -> dict[str, str | int]:
    """What decides the numbers, at the root of the archive."""
    return {
        "title": study.title,
        "Conventions": CONVENTIONS,
        SCHEMA_ATTRIBUTE: SCHEMA,
        "study_name": study.name,
        "study_text": study.text,
        "study_sha256": study.sha256,
        # As text: a seed may be larger than any integer of NetCDF's.
        "seed": str(study.seed),
        **({} if study.has_several_models else _model_identity(study.model)),
        **provenance(),
        **of_python_functions(),
    }


def _model_identity(model: Model) -> dict[str, str]:
    """What tells a model from another, as attributes of its group."""
    return {f"model_{key}": value for key, value in model.identity().items()}
