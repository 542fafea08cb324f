"""Noise of a model that is seen: some runs are made again, and graded by how much they differ."""

from __future__ import annotations

import builtins
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.core.arrays import Arrays, IntArray
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import (
    BOUND,
    FAILED_RUN,
    NOISE,
    NOTE,
    OF_MEAN,
    REPEAT,
    ROLE,
    RUN,
    RUNS,
    STATUS,
    SURROGATE_ESTIMATE,
)
from uqpen.core.model import Model, Results, RunWarning
from uqpen.core.status import BY_MACHINE, Status
from uqpen.designs.repeated import RepeatedDesign
from uqpen.execution import EvaluationOptions, Evaluator, FailurePolicy, Map, Progress, evaluate
from uqpen.execution.batch import Batch
from uqpen.execution.evaluator import EvaluatorWork
from uqpen.execution.processes import processes
from uqpen.models.user_defined_model import UserModel
from uqpen.results.digits import count_text, grouped_number
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.repetition import (
    TOLERANCE,
    NoReports,
    difference_text,
    relative_difference,
    unequal,
)

# Most runs that are made again, and their largest share of a design's. Noise at one point in ten is
# seen by 29 with a probability of 95 %.
_MOST, _SHARE = 29, 20


class Grade(StrEnum):
    """Grade of the difference between runs at the same inputs."""

    EQUAL = "equal bits"
    ROUNDING = "rounding"
    """By so little that other threads or another order of sums may be the reason."""
    NOISE = "noise"

    @classmethod
    def of(cls, difference: float) -> Grade:
        """Return the grade of the largest difference, relative to the largest value."""
        if not difference:
            return cls.EQUAL
        return cls.ROUNDING if difference <= TOLERANCE else cls.NOISE


DECLARED = "declared"
"""The word in place of a grade for a model that is declared to have noise, and has no seed."""


@dataclass(frozen=True)
class NoiseCheck:
    """Result of making some runs of a model again, to see its noise."""

    text: str  # the word, a colon, and what was made again
    is_found: bool = False  # true if the model has noise that its study does not declare
    # Runs that were made twice, along ``run`` and ``repeat``, where the second may be another one.
    pairs: xr.Dataset | None = None

    @classmethod
    def of_archive(cls, group: xr.DataTree, design: str) -> NoiseCheck | None:
        """Return what the group of a model in an archive says; None if it says nothing."""
        if NOISE not in group.attrs or design not in group.children[RUNS].children:
            return None
        made_twice = group.children[NOISE].children if NOISE in group.children else {}
        pairs = made_twice[design].to_dataset(inherit=False) if design in made_twice else None
        is_found = NOISE in group.children[RUNS].children[design].attrs
        return cls(str(group.attrs[NOISE]), is_found, pairs)

    def mark(self, runs: xr.Dataset) -> xr.Dataset:
        """Return runs with an attribute that says that their model has noise, if it was found."""
        return runs.assign_attrs({NOISE: str(Grade.NOISE)}) if self.is_found else runs


def is_noisy(model: Model, runs: Mapping[str, xr.Dataset]) -> bool:
    """Check if a model has noise of its own: declared, or found in its runs by design."""
    return bool(model.noise.is_declared) or any(NOISE in each.attrs for each in runs.values())


def label_noise(
    found: Mapping[str, OutputStatistics],
    model: Model,
    runs: Mapping[str, xr.Dataset],
    *,
    is_of_surrogate: bool,
) -> Mapping[str, OutputStatistics]:
    """Return statistics with notes on what they are of, if the model has noise of its own.

    A surrogate learns the mean given the inputs, and what runs correct is of the whole output; a
    figure that they do not correct is the surrogate's own. Indices by runs are of the whole; their
    total order has the noise in it.
    """
    if not is_noisy(model, runs):
        return found
    return {
        output: {
            name: array if name.startswith(OF_MEAN) else _with_notes(name, array, is_of_surrogate)
            for name, array in statistics.items()
        }
        for output, statistics in found.items()
    }


def _with_notes(name: str, array: xr.DataArray, is_of_surrogate: bool) -> xr.DataArray:
    """Add to each estimate what it is of, where its name leaves that open."""
    if BOUND not in array.dims or NOTE not in array.coords:
        return array
    own = array.coords[NOTE]
    if not is_of_surrogate:
        notes = np.full(own.shape, _index_note(name), dtype=object)
    elif SURROGATE_ESTIMATE in array.coords:
        found = array.values[..., 0]
        is_own = found == array.coords[SURROGATE_ESTIMATE].values
        notes = np.where(is_own, texts.OF_THE_MEAN, texts.OF_THE_WHOLE).astype(object)
        notes[np.isnan(found)] = ""
    else:
        notes = np.full(own.shape, texts.OF_THE_MEAN, dtype=object)
    pairs = zip(notes.ravel().tolist(), map(str, np.ravel(own.values)), strict=True)
    values = np.array(["; ".join(filter(None, pair)) for pair in pairs], dtype=object)
    return array.assign_coords({NOTE: (own.dims, values.reshape(own.shape))})


def _index_note(name: str) -> str:
    """Return what an index by runs is of; empty for others."""
    if name.endswith("total_order"):
        return texts.REMAINING
    return texts.OF_THE_WHOLE if name.endswith(("first_order", "second_order")) else ""


def check_noise(
    study: ValidatedStudy, name: str, design: str, runs: xr.Dataset, map: Map, progress: Progress
) -> NoiseCheck | None:
    """Make some runs of a design again, after its last one, and see if they are the same.

    They lie evenly among the runs. None is made again of a model that is built in, or that is said
    to have no noise; nor of a noisy one whose runs the design repeats itself.

    Parameters
    ----------
    name, design : str
        The model, and the first design of the study.
    runs : Dataset
        Its runs of the design.
    """
    model = study.models[name].model
    if not _is_checked(model):
        return None
    if model.noise.is_unseeded and isinstance(study.designs[design], RepeatedDesign):
        return NoiseCheck(f"{DECLARED}: {design} makes several runs at each point")
    at = _chosen_runs(runs)
    if not at.size:
        return None
    first = runs.isel({RUN: at}).load()
    progress.start_step("making runs again, to see noise of the model")
    with tempfile.TemporaryDirectory(prefix="uqpen-") as folder:
        # The folders of runs that are kept stay as they are.
        own = Evaluator(model.with_folder(Path(folder)), study.constraints)
        again = _Again(own, study.failures.retry, map)
        second = again.made(first)
        difference, differing = _differences(model, runs, [first, *second])
        grade = Grade.of(difference)
        may_share = grade is Grade.NOISE and not model.noise.seed and isinstance(model, UserModel)
        # Where no other process makes runs, none can share anything.
        may_share &= map is not builtins.map
        shares_generator = may_share and again.shares_generator(first)
    made = f"{grouped_number(at.size)} of {count_text(runs.sizes[RUN], 'run')} of {design}"
    verb = "was" if at.size == 1 else "were"
    seeds = " with the same seeds" * bool(model.noise.seed)
    seen = "the same to the bit"
    if grade is not Grade.EQUAL:
        verb_of_them = "differs" if differing == 1 else "differ"
        reason = ", as by threads" * (grade is Grade.ROUNDING)
        seen = f"{differing} {verb_of_them}{difference_text(difference)}{reason}"
    is_unseeded, cause = model.noise.is_unseeded, _cause(model, grade)
    text = f"{DECLARED if is_unseeded else grade}: {made} {verb} made again{seeds}: {seen}{cause}"
    text += _SHARED * shares_generator
    if shares_generator or cause:
        progress.warn(f"{name or model.name}: {text}")
    is_kept = grade is Grade.NOISE or (is_unseeded and grade is Grade.ROUNDING)
    pairs = _pairs(model, first, second[0]) if is_kept else None
    return NoiseCheck(text, bool(cause) and not model.noise.seed, pairs)


def trial_noise(evaluator: Evaluator, inputs: Arrays, results: Results) -> str:
    """Make a trial run again; return what that shows of noise of the model, empty for none."""
    model = evaluator.model
    if model.noise.is_unseeded:
        return f"{DECLARED}: each run is another one"
    if not _is_checked(model) or np.isin(results.status, (Status.INADMISSIBLE, *BY_MACHINE)).any():
        return ""
    with tempfile.TemporaryDirectory(prefix="uqpen-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", RunWarning)  # of which the first run has warned
        again = replace(evaluator, model=model.with_folder(Path(folder)))(dict(inputs))
    of_outputs = (
        relative_difference(results.outputs[key], again.outputs[key]) for key in again.outputs
    )
    grade = Grade.of(max(relative_difference(results.status, again.status), *of_outputs))
    if grade is not Grade.NOISE:
        return "" if grade is Grade.EQUAL else f"{grade}: made again, it differs in last digits"
    return f"{grade}: made again, it is another one{_cause(model, grade)}"


def _is_checked(model: Model) -> bool:
    """Check for a model whose runs have to show if they can be repeated."""
    is_open = model.noise.is_declared is not False and not model.uncallable_reason
    return model.may_be_noisy and is_open


def _cause(model: Model, grade: Grade) -> str:
    """Return what is wrong where runs show noise; empty where the study declares it so."""
    if grade is not Grade.NOISE or model.noise.is_unseeded:
        return ""
    return _BESIDE_SEED if model.noise.seed else _UNDECLARED


_UNDECLARED = (
    ". The model gives another result each time: give its runs a seed, or declare noise = true"
)
_BESIDE_SEED = ". Something beside the seed drives the noise, so runs cannot be repeated"
_SHARED = (
    ". Its generator of random numbers is set when it is imported, so each process draws the same "
    "noise: the runs are no independent ones. Make the generator from a seed that is an input"
)


def _chosen_runs(runs: xr.Dataset) -> IntArray:
    """Return the positions of runs that are made again, evenly among those that the model made."""
    status = runs[STATUS].values
    made = np.flatnonzero(~np.isin(status, (Status.INADMISSIBLE, *BY_MACHINE)))
    number = min(_MOST, -(-len(status) // _SHARE), made.size)
    return made[(2 * np.arange(number) + 1) * made.size // (2 * max(number, 1))]


class _Again:
    """Runs of a model that are made again, and kept nowhere."""

    def __init__(self, evaluator: Evaluator, retry: int, map: Map) -> None:
        self._evaluator, self._model = evaluator, evaluator.model
        self._retry, self._map = retry, map
        self._inputs = set(self._model.run_inputs)

    def made(self, runs: xr.Dataset) -> list[xr.Dataset]:
        """Make runs again; twice, in one batch, where the model takes many at a time.

        Noise that is drawn by the place in a batch is the same in the same place of the next one.
        """
        self._model.prepare()
        points = runs[[key for key in runs.data_vars if key in self._inputs]]
        points = points.drop_vars([key for key in points.coords if key != RUN])
        times, size = 2 if self._model.vectorized else 1, runs.sizes[RUN]
        again = points.isel({RUN: np.tile(np.arange(size), times)})
        policy = FailurePolicy(self._retry, stop_after=0, trial=False)
        options = EvaluationOptions(map=self._map, progress=NoReports(), failures=policy)
        numbered = again.assign_coords({RUN: np.arange(size * times)})
        made = evaluate(self._evaluator, numbered, {}, options)
        return [made.isel({RUN: slice(n * size, (n + 1) * size)}) for n in range(times)]

    def shares_generator(self, runs: xr.Dataset) -> bool:
        """Check if two new processes draw the same noise, though each draws another every time."""
        columns = {
            str(key): np.broadcast_to(runs.variables[key].values[..., :1], 1)
            for key in runs.data_vars
            if key in self._inputs
        }
        found = []
        for _ in range(2):
            with processes(1) as pool:
                batches = (Batch(number, columns) for number in (0, 1))
                made = sorted(pool(EvaluatorWork(self._evaluator), batches), key=lambda e: e.start)
            found.append([each.results for each in made])
        (one, two), (other, _) = found
        return not _are_unequal(one, other) and _are_unequal(one, two)


def _are_unequal(one: Results, other: Results) -> bool:
    columns = ({**each.outputs, STATUS: each.status} for each in (one, other))
    pairs = zip(*(map(np.asarray, each.values()) for each in columns), strict=True)
    return any(unequal(*pair).any() for pair in pairs)


def _differences(model: Model, runs: xr.Dataset, every: Sequence[xr.Dataset]) -> tuple[float, int]:
    """Return how much runs differ that were made several times, and how many differ at all.

    The difference is relative to the largest value of an output, and infinite for other statuses.
    """
    own = ~np.any([np.isin(each[STATUS].values, BY_MACHINE) for each in every], axis=0)
    differs, difference = np.zeros(own.sum(), dtype=np.bool_), 0.0
    for name in (STATUS, *(output.name for output in model.all_outputs)):
        scale = 0.0 if name == STATUS else _largest(runs.variables[name])
        for one, other in pairwise(each.variables[name].values[own] for each in every):
            difference = max(difference, relative_difference(one, other, scale))
            differs |= unequal(one, other).reshape(len(one), -1).any(axis=1)
    return difference, int(differs.sum())


def _largest(values: xr.Variable) -> float:
    """Return the largest absolute value among all runs of a design."""
    largest = 0.0
    for start, stop in block_ranges(values.shape[0]):
        part = np.asarray(values[start:stop].values, dtype=np.float64)
        largest = max(largest, float(np.abs(part[np.isfinite(part)]).max(initial=0.0)))
    return largest


def _pairs(model: Model, first: xr.Dataset, second: xr.Dataset) -> xr.Dataset:
    """Return runs that were made twice, along ``run`` and ``repeat``."""
    found = {}
    for name in (STATUS, *(output.name for output in model.all_outputs)):
        one, other = first.variables[name], second.variables[name].values
        attributes = {key: value for key, value in one.attrs.items() if key != ROLE}
        values = np.stack([one.values, other], axis=1)
        found[name] = ((RUN, REPEAT, *one.dims[1:]), values, attributes)
    number = {"units": "1", "long_name": "number of the run at its inputs"}
    coordinates = {name: first.variables[name] for name in first.coords if name in first.dims}
    coordinates = {name: each for name, each in coordinates.items() if name != FAILED_RUN}
    return xr.Dataset(found, {**coordinates, REPEAT: (REPEAT, np.arange(2), number)})
