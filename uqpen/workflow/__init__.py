"""Workflow: from a study to the tree of datasets of its archive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import xarray as xr

from uqpen.archive.files import FILES, files_group
from uqpen.archive.groups import model_trees
from uqpen.core.arrays import Arrays
from uqpen.core.errors import TooManyFailedError
from uqpen.core.labels import MODELS, NOISE
from uqpen.core.model import Results
from uqpen.core.streams import Stream
from uqpen.execution import Evaluator, Map, Progress, first_repeats
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.first_runs import FirstRuns
from uqpen.models.source import BuiltInModel
from uqpen.study.identity import is_user_defined, level_attribute, root_attributes
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.design_runs import Runs, run_design
from uqpen.workflow.model_groups import (
    AnalysisSteps,
    difference_groups,
    model_form_groups,
    model_groups,
)
from uqpen.workflow.noise_check import NoiseCheck, check_noise, trial_noise

__all__ = ["Checkpoints", "Progress", "analyse_runs", "root_attributes", "run", "run_design"]

Checkpoints = Callable[[str, str, int], Checkpoint]


def run(
    study: ValidatedStudy,
    *,
    map: Map = map,
    progress: Progress | None = None,
    checkpoints: Checkpoints = lambda design, model, number: Checkpoint(),
    seen: Mapping[str, NoiseCheck] | None = None,
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
    seen : mapping of str to NoiseCheck, optional
        What an earlier archive says of the noise of models, by their names: none of their runs
        is made again to see it.

    Returns
    -------
    DataTree
        The archive's content: ``/runs/<design>``, ``/statistics/<source>/<output>`` and so on. In a
        study with several models, these groups are below ``/models/<name>``.
    """
    progress = progress or Progress()
    # Of user-defined models; runs of built-in ones cost nothing.
    first_runs = {
        name: FirstRuns(
            variant.model,
            study.failures,
            partial(_report_trial, progress, name),
            is_observed=is_user_defined(variant.model),
            repeat=partial(
                _repeat_trial, Evaluator(variant.model, study.constraints), progress, name
            ),
        )
        for name, variant in study.models.items()
        if not isinstance(variant.model, BuiltInModel)
    }
    progress.announce_designs({name: study.design_runs(name) for name in study.designs})
    for variant in study.models.values():
        progress.start_preparation(variant.model.name)
        variant.model.prepare()
    runs_by_model: dict[str, Runs] = {name: {} for name in study.models}
    checks: dict[str, NoiseCheck] = {}
    for name, design in study.designs.items():
        progress.start_design(name, study.design_runs(name))
        stream = Stream(study.seed, "designs", name)
        round_checkpoint = partial(checkpoints, name)
        try:
            runs = run_design(
                study,
                design,
                stream,
                map=map,
                progress=progress,
                round_checkpoint=round_checkpoint,
                first_runs=first_runs,
            )
        except TooManyFailedError as error:
            raise type(error)(f"{name}: {error}") from None
        for model in study.models:
            if name == next(iter(study.designs)):
                check = (seen or {}).get(model) or check_noise(
                    study, model, name, runs[model], map, progress
                )
                checks |= {model: check} if check else {}
            runs_by_model[model][name] = runs[model]
    for model, check in checks.items():
        runs_by_model[model] = {key: check.mark(each) for key, each in runs_by_model[model].items()}
    progress.start_analysis()
    tree = analyse_runs(study, runs_by_model, progress)
    for model, check in checks.items():
        node = model_trees(tree)[model]
        node.attrs[NOISE] = check.text
        if check.pairs is not None:
            node[f"{NOISE}/{next(iter(study.designs))}"] = xr.DataTree(check.pairs)
    return tree


def analyse_runs(
    study: ValidatedStudy, runs: Mapping[str, Runs], progress: Progress | None = None
) -> xr.DataTree:
    """Analyse runs, given by model and design, and return the content of an archive.

    `progress` receives a report of each step; no result depends on it.
    """
    groups = {"/": xr.Dataset(attrs={**root_attributes(study), **level_attribute(study)})}
    steps = AnalysisSteps(study, progress or Progress())
    # The one place at which repeats are left out.
    whole = runs
    runs = {
        model: {design: first_repeats(each) for design, each in of_model.items()}
        for model, of_model in runs.items()
    }
    for name in study.models:
        root = f"/{MODELS}/{name}" if study.has_several_models else ""
        for path, dataset in model_groups(study, name, whole, runs, steps):
            groups[f"{root}{path}"] = dataset
    groups |= dict(difference_groups(study, runs, steps))
    groups |= dict(model_form_groups(study, runs))
    if files := files_group(study.files(), study.folder):
        groups[f"/{FILES}"] = files
    return xr.DataTree.from_dict(groups)


def _repeat_trial(
    evaluator: Evaluator, progress: Progress, name: str, inputs: Arrays, results: Results
) -> None:
    """Make the trial run of a model again, and say what that shows before others follow."""
    if evaluator.model.noise.is_unseeded:
        return
    if noise := trial_noise(evaluator, inputs, results):
        _report_trial(progress, name, f"the trial run shows {noise}")


def _report_trial(progress: Progress, model: str, text: str) -> None:
    progress.report_trial(f"{model}: {text}" if model else text)
