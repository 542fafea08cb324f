"""Runs of the designs of a study, and one of each model at the nominal point to try it."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.core.arrays import Arrays
from uqpen.core.errors import TooManyFailedError
from uqpen.core.labels import SAMPLING
from uqpen.core.model import Results, RunWarning
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import Points, Round, points_of
from uqpen.designs.rounds import run_rounds
from uqpen.execution import EvaluationOptions, Evaluator, Map, Progress, evaluate, join_rounds
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.evaluator import recorded_map
from uqpen.execution.first_runs import FirstRuns
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.noise_check import trial_noise

# Runs by the name of a design, or of a model.
Runs = dict[str, xr.Dataset]


def _no_checkpoint(model: str, number: int) -> Checkpoint:
    return Checkpoint()


def run_design(
    study: ValidatedStudy,
    design: Design,
    stream: Stream,
    *,
    map: Map,
    progress: Progress,
    round_checkpoint: Callable[[str, int], Checkpoint] = _no_checkpoint,
    first_runs: Mapping[str, FirstRuns] | None = None,
) -> Runs:
    """Make the runs of one design by model; at common points, but where a round is of some models.

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
    first_runs : mapping of str to FirstRuns, optional
        By the name of a model, its first runs in the study.
    """
    units = study.display_units()
    quantities = {
        name: study.model_quantities(variant.model) for name, variant in study.models.items()
    }
    maker = map
    if (results := design.results) is not None:  # no worker makes them, no checkpoint keeps them
        maker, round_checkpoint, first_runs = recorded_map(results), _no_checkpoint, None

    seeds = {name: study.run_seeds(name) for name in study.models}

    def model_runs(name: str, points: Points, number: int) -> xr.Dataset:
        variant = study.models[name]
        try:
            return evaluate(
                Evaluator(variant.model, study.constraints),
                seeds[name].assigned(points.assign(variant.given)),
                units,
                EvaluationOptions(
                    map=maker,
                    label=name,
                    progress=progress,
                    checkpoint=round_checkpoint(name, number),
                    failures=study.failures,
                    first_runs=(first_runs or {}).get(name),
                ),
            )
        except TooManyFailedError as error:
            raise type(error)(f"by {name}, {error}" if name else str(error)) from None

    def round_runs(drawn: Points | Round, number: int) -> Runs:
        names = drawn.models if isinstance(drawn, Round) else study.models
        return {name: model_runs(name, points_of(drawn), number) for name in names}

    rounds = run_rounds(
        design,
        study.joint,
        stream,
        round_runs,
        lambda made: RunningEstimates(made, design.sampling, quantities, study.analyses),
        study.run_costs,
    )
    sampling = {SAMPLING: str(design.sampling_of(study.joint))}
    found = {}
    for model in study.models:
        # A round may be of some models only.
        own = {number: runs[model] for number, runs in enumerate(rounds) if model in runs}
        joined = join_rounds([*own.values()], [*own] if len(rounds) > 1 else None)
        found[model] = joined.assign_attrs(sampling)
    return found


@dataclass(frozen=True)
class TrialRun:
    """Run of a model at the nominal point."""

    inputs: Arrays  # (1,): the nominal point in SI units
    results: Results  # what the model has returned there
    folder: Path | None  # folder in which its files are kept
    warnings: tuple[str, ...]  # warnings of the model about it
    seconds: float  # its duration
    noise: str = ""  # what another run at the same inputs shows of noise; empty where it is equal

    @property
    def status(self) -> Status:
        """Status of the run."""
        return Status(int(self.results.status[0]))

    @property
    def reason(self) -> str:
        """Reason of a failed run; empty for another."""
        return self.results.reasons.get(0, "")


def trial_run(study: ValidatedStudy, name: str) -> TrialRun:
    """Run a model of a study, given its name, at the nominal point.

    Random inputs are at their medians.
    """
    variant = study.models[name]
    model = variant.model
    model.prepare()
    evaluator = Evaluator(model, study.constraints)
    nominal = {**study.joint.nominal(), **variant.given}
    at = {key: np.array([value]) for key, value in nominal.items()}
    columns = study.run_seeds(name).columns(at)
    began = time.monotonic()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = evaluator(columns)
    seconds = time.monotonic() - began
    noise = trial_noise(evaluator, columns, results)
    of_run = [each.message for each in caught if isinstance(each.message, RunWarning)]
    return TrialRun(
        columns,
        results,
        model.run_folder({key: values.item() for key, values in columns.items()}),
        tuple(dict.fromkeys(warning.of_one_run for warning in of_run)),
        seconds,
        noise,
    )
