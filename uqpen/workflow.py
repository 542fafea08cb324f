"""The main path: a study in, a tree of datasets out."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import xarray as xr

from uqpen.analyses.analyze import analyze
from uqpen.analyses.differences import differences
from uqpen.analyses.of_surrogate import told_by_surrogate
from uqpen.analyses.published import published
from uqpen.analyses.surrogate_draws import SurrogateDraws
from uqpen.archive.files import FILES, as_group
from uqpen.archive.provenance import CONVENTIONS, SCHEMA, of_python_functions, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE
from uqpen.comparison import Source, side_by_side
from uqpen.designs.design import Design, Rounds
from uqpen.errors import TooManyLostError, TrajectoryError
from uqpen.evaluation import Evaluator, Map, Progress, evaluate, join, worst
from uqpen.evaluation.keeper import Keeper
from uqpen.labels import (
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
from uqpen.model import Model
from uqpen.streams import Stream
from uqpen.study.study import Study, Variant
from uqpen.trust import Witness, judged

__all__ = ["Progress", "analysed", "root_attributes", "run", "runs_of_design"]

Groups = Iterator[tuple[str, xr.Dataset]]
Keepers = Callable[[str, str, int], Keeper]
# The runs of each design by its name, or of each model by its.
Runs = dict[str, xr.Dataset]


def run(
    study: Study,
    *,
    map: Map = map,
    progress: Progress | None = None,
    keepers: Keepers = lambda design, model, number: Keeper(),
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
    keepers : callable
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
        progress.preparing(variant.model.name)
        variant.model.prepare()
    runs = _runs(study, map, progress, keepers)
    progress.analysing()
    return analysed(study, runs)


def analysed(study: Study, runs: Mapping[str, Runs]) -> xr.DataTree:
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
        for path, dataset in _told(study, variant, runs[name]):
            groups[f"{root}{path}"] = dataset
    groups |= dict(_paired(study, runs))
    if files := as_group(study.files(), study.folder):
        groups[f"/{FILES}"] = files
    return xr.DataTree.from_dict(groups)


def _runs(study: Study, map: Map, progress: Progress, keepers: Keepers) -> dict[str, Runs]:
    """The runs of every design, by model, on common points."""
    made: dict[str, Runs] = {name: {} for name in study.models}
    for name, design in study.designs.items():
        progress.design(name, design.size(study.law) * len(study.models))
        stream = Stream(study.seed, "designs", name)
        keeper_of = partial(keepers, name)
        try:
            runs = runs_of_design(
                study, design, stream, map=map, progress=progress, keeper_of=keeper_of
            )
        except TooManyLostError as error:
            raise TooManyLostError(f"{name}: {error}") from None
        for model in study.models:
            made[model][name] = runs[model]
    return made


def runs_of_design(
    study: Study,
    design: Design,
    stream: Stream,
    *,
    map: Map,
    progress: Progress,
    keeper_of: Callable[[str, int], Keeper] = lambda model, number: Keeper(),
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
    keeper_of : callable
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
                keeper=keeper_of(name, number),
                failures=study.failures,
            )
        except TooManyLostError as error:
            raise TooManyLostError(f"by {name}, {error}" if name else str(error)) from None

    rounds = list(_rounds(design.rounds(study.law, stream), made))
    sampling = {SAMPLING: str(design.sampling)}
    return {
        model: join([runs[model] for runs in rounds]).assign_attrs(sampling)
        for model in study.models
    }


def _rounds(rounds: Rounds, made: Callable[[xr.Dataset, int], Runs]) -> Iterator[Runs]:
    """The runs of a design by model, round by round; each round may depend on the one before."""
    points = next(rounds)
    for number in itertools.count():
        runs = made(points, number)
        yield runs
        try:
            points = rounds.send(worst(list(runs.values())))
        except StopIteration:
            return


def _told(study: Study, variant: Variant, runs: Runs) -> Groups:
    """All that is told of one model: its runs, what they tell, its course."""
    questions = study.questions_to(variant.model)
    for design, made in runs.items():
        yield f"/{RUNS}/{design}", made
    sources = {
        design: Source("design", made.sizes[RUN], analyze(made, questions))
        for design, made in runs.items()
    }
    for name in study.surrogates:
        fitted, source = _surrogate(study, variant, name, runs, sources)
        yield f"/{SURROGATES}/{name}", fitted
        sources[name] = source
    for name, source in sources.items():
        for analysis, statistics in source.groups.items():
            yield f"/{analysis}/{name}", statistics
    yield f"/{COMPARISON}", side_by_side(sources)
    for name, publication in study.published.items():
        for group, figures in published(publication).items():
            yield f"/{group}/{name}", figures
    course = _trajectory(study, variant)
    if course is not None:
        yield f"/{TRAJECTORY}", course
    if study.has_several_models:
        yield "/", xr.Dataset(attrs=_identity(variant.model))


def _surrogate(
    study: Study, variant: Variant, name: str, runs: Runs, sources: Mapping[str, Source]
) -> tuple[xr.Dataset, Source]:
    """A surrogate fitted to its design, and what it tells as far as other designs vouch for it."""
    surrogate = study.surrogates[name]
    stream = Stream(study.seed, "surrogates", name)
    training = runs[surrogate.design]
    fitted = surrogate.fit(name, training, variant.model, study.law, stream)
    witnesses = study.witnesses(surrogate)
    checked = fitted.checked(runs[witnesses[0]]) if witnesses else fitted
    draws = SurrogateDraws(checked, study.law, study.constraints, variant.given, stream)
    told = told_by_surrogate(draws, study.questions_to(variant.model))
    groups = judged(
        told.groups,
        [Witness(witness, sources[witness].groups) for witness in witnesses],
        told.reaches,
    )
    spent = sum(sources[design].runs for design in [surrogate.design, *witnesses[:1]])
    made_of = {RUNS_SPENT: spent, "check": witnesses[0] if witnesses else "none"}
    return checked.to_dataset().assign_attrs(made_of), Source("surrogate", spent, groups)


def _paired(study: Study, runs: Mapping[str, Runs]) -> Groups:
    """What each model's outputs differ by from the first's, on common points."""
    first, *others = study.models
    for other in others:
        questions = study.questions_to(study.models[other].model)
        for design in study.designs:
            pair = runs[first][design], runs[other][design]
            for analysis, statistics in differences(*pair, questions).items():
                attributes = {"minus": first}
                path = f"/{DIFFERENCES}/{other}/{analysis}/{design}"
                yield path, statistics.assign_attrs(attributes)


def _trajectory(study: Study, variant: Variant) -> xr.Dataset | None:
    """The model's course at the nominal inputs, where it has one and all are given."""
    known = {variable.name for variable in variant.model.inputs}
    nominal = {
        name: value
        for name, value in {**study.law.nominal(), **variant.given}.items()
        if name in known
    }
    if next(variant.model.missing(nominal), None) is not None:
        return None
    try:
        course = variant.model.trajectory(nominal)
    except TrajectoryError as error:
        # The one run at the nominal inputs failed, which is data as any run's failure is.
        course = xr.Dataset(attrs={"reason": str(error)})
    if course is None:
        return None
    return course.assign_attrs({f"nominal_{name}": value for name, value in nominal.items()})


def _display_units(study: Study) -> dict[str, str]:
    """The unit to show each input and output in."""
    units = {entry.variable.name: entry.display_unit for entry in study.law.inputs}
    return units | {question.output.name: question.display_unit for question in study.questions}


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
        **({} if study.has_several_models else _identity(study.model)),
        **provenance(),
        **of_python_functions(),
    }


def _identity(model: Model) -> dict[str, str]:
    """What tells a model from another, as attributes of its group."""
    return {f"model_{key}": value for key, value in model.identity().items()}
