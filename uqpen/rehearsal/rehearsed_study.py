"""Study with a surrogate in place of its model, opened with its archive or from that alone."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from statistics import median

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, open_archive, read_group
from uqpen.benchmark.methods import BenchmarkStatistic, Estimates
from uqpen.core.arrays import FloatArray
from uqpen.core.blocks import LoadedDataset
from uqpen.core.errors import ArchiveError, ModelError, Problem, SettingsError, UnknownNameError
from uqpen.core.labels import (
    EQUAL,
    EXCEEDANCE,
    INPUT,
    MOMENTS,
    QUANTILES,
    RUN,
    RUNS,
    SAMPLING,
    STATED,
    STATUS,
)
from uqpen.core.lookup import choices
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, UnloadedDesign
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.execution import Progress
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import runs_with_value
from uqpen.statistics.sensitivity.sobol_indices import sobol_indices
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_indices import surrogate_indices
from uqpen.study.load import load_study
from uqpen.study.study import ONLY_MODEL, ValidatedStudy, Variant
from uqpen.surrogates.archived_surrogate import surrogate_paths
from uqpen.surrogates.diagnostics import refuted_outputs
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.verification.archived_study import restored_study, study_surrogate
from uqpen.workflow import run_design

# Sources of a rehearsal: the designs of a study, as they stand and at equal numbers of runs.

_DRAWN = (Sampling.INDEPENDENT, Sampling.STRATIFIED, Sampling.PICK_FREEZE)


@dataclass(frozen=True)
class RehearsedSource:
    """Source of estimates that is repeated with fresh random numbers."""

    name: str  # the name of its design in the study
    size: str  # `STATED` or `EQUAL`
    design: Design  # the design of its runs

    def estimates(self, study: ValidatedStudy, repeat: int) -> tuple[int, Estimates]:
        """Return the number of runs and the estimates of one repeat.

        Parameters
        ----------
        repeat : int
            The number of the repeat, which is the key of its random numbers.
        """
        stream = Stream(study.seed, "rehearsal", self.name, self.size, repeat)
        runs = run_once(study, self.design, stream)
        return runs.sizes[RUN], run_estimates(runs, study.quantities_of_interest)


def run_once(study: ValidatedStudy, design: Design, stream: Stream) -> xr.Dataset:
    """Return new runs of a design by the only model of a study, made in this process."""
    return run_design(study, design, stream, map=map, progress=Progress())[ONLY_MODEL]


def run_estimates(runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]) -> Estimates:
    """Return the estimates that a rehearsal is about, by output and statistic."""
    found = analyze(runs, quantities, only=(MOMENTS, QUANTILES, EXCEEDANCE))
    if Sampling(runs.attrs[SAMPLING]) is Sampling.PICK_FREEZE:
        handle = LoadedDataset.of(runs)
        with one_blas_thread():
            for quantity in quantities:
                name = quantity.output.name
                found[name] |= sobol_indices(runs_with_value(handle, name), quantity)
    return found


def study_sources(study: ValidatedStudy, runs: int | None = None) -> tuple[RehearsedSource, ...]:
    """Return the designs of a study whose points are drawn, and their forms of equal size.

    Parameters
    ----------
    study : ValidatedStudy
        Its other designs have the same points each time, or are no sample.
    runs : int, optional
        The largest number of runs of the forms of equal size; by default as `equal_runs`.
    """
    drawn = {name: each for name, each in study.designs.items() if is_drawn(each)}
    sources = [RehearsedSource(name, STATED, design) for name, design in drawn.items()]
    limit = runs or equal_runs(study)
    for name, design in drawn.items():
        replicated = design.replicate_count > 1
        scaled = design.scaled(study.joint, limit, replicated=replicated)
        sources += [RehearsedSource(name, EQUAL, scaled)] if scaled is not None else []
    return tuple(sources)


def equal_runs(study: ValidatedStudy) -> int:
    """Return a number of runs to compare designs at: a power of two, which is fair to all."""
    counts = [each.run_count(study.joint) for each in study.designs.values() if is_drawn(each)]
    return 1 << (int(median(counts)).bit_length() - 1) if counts else 0


def is_drawn(design: Design) -> bool:
    """Check that a design draws other points each time, so that it can be repeated."""
    return design.sampling in _DRAWN and not isinstance(design, UnloadedDesign)


@dataclass(frozen=True, eq=False)
class RehearsedStudy:
    """A study, and a surrogate in place of its model."""

    original: ValidatedStudy  # the study as it is
    model: str  # the name of the model
    surrogate: FittedSurrogate  # fitted to runs of that model
    runs: Mapping[str, xr.Dataset]  # the study's own runs of that model, by design
    # The outputs whose predictions its runs refute, each with the reason. They are not rehearsed:
    # where it is no model of the output, it says nothing of the study.
    refuted: Mapping[str, str] = field(default_factory=dict)

    @property
    def fitted(self) -> FittedSurrogate:
        """The part of the surrogate that predicts numbers; fields are not rehearsed."""
        return self.surrogate.without_fields

    @cached_property
    def study(self) -> ValidatedStudy:
        """The study with the surrogate as its only model.

        Raises
        ------
        SettingsError
            If no design draws its points, or the surrogate predicts no number of the study that
            runs do not refute.
        """
        study, variant = self.original, self.original.models[self.model]
        known = {output.name for output in self.fitted.outputs} - self.refuted.keys()
        quantities = tuple(
            quantity
            for quantity in study.model_quantities(variant.model)
            if quantity.output.name in known and quantity.output.is_number
        )
        if not quantities and self.refuted:
            reasons = "; ".join(f"{output}: {reason}" for output, reason in self.refuted.items())
            expected = "one that its runs do not refute"
            raise SettingsError(
                [Problem(("surrogates",), f"{self.fitted.name}, {reasons}", expected)]
            )
        if not quantities:
            found = f"{self.fitted.name}, which predicts no number"
            raise SettingsError([Problem(("surrogates",), found, "one of a scalar output")])
        if not any(map(is_drawn, study.designs.values())):
            found = f"{', '.join(study.designs)}, whose points are the same each time"
            expected = "a design that draws its points, such as monte-carlo"
            raise SettingsError([Problem(("designs",), found, expected)])
        models = {ONLY_MODEL: Variant(self.fitted, variant.given)}
        return replace(study, models=models, quantities_of_interest=quantities)

    def own_values(self, output: str) -> FloatArray:
        """Return the values of an output in the study's own runs at drawn points."""
        drawn = [name for name, each in self.original.designs.items() if is_drawn(each)]
        return np.concatenate([ok_values(self.runs[name], output) for name in drawn])


def ok_values(runs: xr.Dataset, output: str) -> FloatArray:
    """Return the values of an output in the completed runs that have it."""
    values = runs[output].values[runs[STATUS].values == Status.OK].astype(np.float64)
    return np.asarray(values[~np.isnan(values)])


# True statistics of the model that a study is rehearsed on.

_REPLICATES = 16


def surrogate_truth(
    study: ValidatedStudy,
    fitted: FittedSurrogate,
    statistics: Sequence[BenchmarkStatistic],
    sample: xr.Dataset,
) -> list[FloatArray]:
    """Return the true statistics of a surrogate: from its closed forms, else from a large sample.

    Parameters
    ----------
    study : ValidatedStudy
        With the surrogate as its model.
    sample : Dataset
        Runs of `large_sample`.

    Returns
    -------
    list of ndarray, shape (entry, bound)
        In SI units; the bounds are those of the sample, and NaN where there is none.
    """
    stream = Stream(study.seed, "rehearsal", "truth")
    quantities = study.quantities_of_interest
    sampled = analyze(sample, quantities, only=(MOMENTS, QUANTILES, EXCEEDANCE))
    given = study.models[ONLY_MODEL].given
    draws = SurrogateDraws(fitted, study.joint, study.constraints, given, stream)
    with_indices = {each.quantity for each in statistics if each.dimension == INPUT}
    found = {
        quantity.output.name: {
            **sampled[quantity.output.name],
            **dict(surrogate_indices(draws, quantity) if quantity in with_indices else ()),
        }
        for quantity in quantities
    }
    truth = []
    for statistic in statistics:
        values = statistic.estimates(found)
        forms = draws.closed_forms_of_output(statistic.output)
        if forms is not None and statistic.name in ("mean", "std"):
            mean, std = forms.closed_form_moments(statistic.output)
            values = np.full(values.shape, mean if statistic.name == "mean" else std)
        truth.append(values)
    return truth


def large_sample(study: ValidatedStudy, draws: int) -> xr.Dataset:
    """Return runs of the only model of a study at a large sample of its inputs."""
    stream = Stream(study.seed, "rehearsal", "truth")
    return run_once(study, SobolSequence(draws, _REPLICATES), stream)


# Tail of an output beyond the training range of its surrogate, and what hangs on it.
#
# Beyond the range a surrogate extrapolates. Where an interval hangs on values there, a rehearsal
# shows how often it would hold for the surrogate, not for the model.

# By statistic, the power of the deviation from the mean in the influence of a run on it. The others
# are of the distribution function, on which all values beyond a limit have the same influence.
_POWERS = {"mean": 1, "std": 2, "first_order": 2, "total_order": 2}


def tail_record(
    rehearsed: RehearsedStudy,
    statistics: Sequence[BenchmarkStatistic],
    truth: FloatArray,
    sample: xr.Dataset,
) -> FloatArray:
    """Return the shares of all statistics, in draws of the surrogate and in the study's own runs.

    Returns
    -------
    ndarray, shape (2, entry)
    """
    columns, start = [], 0
    for statistic in statistics:
        stop = start + len(statistic.entries)
        ends = rehearsed.fitted.training_range(statistic.output)
        values = ok_values(sample, statistic.output), rehearsed.own_values(statistic.output)
        columns.append([tail_shares(statistic, truth[start:stop], each, ends) for each in values])
        start = stop
    return np.concatenate(columns, axis=1)


def tail_shares(
    statistic: BenchmarkStatistic,
    truth: FloatArray,
    values: FloatArray,
    ends: tuple[float, float],
) -> FloatArray:
    """Return the share of a statistic's sampling variance that comes from beyond a range.

    Parameters
    ----------
    values : ndarray, shape (run,)
        A sample of its output.
    ends : tuple of float
        The smallest and the largest value of the training runs.

    Returns
    -------
    ndarray, shape (entry,)
        For a quantile or a probability 1 if its limit is beyond the range, else 0.
    """
    lowest, highest = ends
    if statistic.name not in _POWERS:
        limits = _limits(statistic, truth, values)
        return ((limits < lowest) | (limits > highest)).astype(np.float64)
    deviations = values - values.mean()
    influence = deviations ** _POWERS[statistic.name]
    squares = (influence - influence.mean()) ** 2
    whole = squares.sum()
    beyond = (values < lowest) | (values > highest)
    share = squares[beyond].sum() / whole if whole > 0 else 0.0
    return np.full(truth.shape, share)


def _limits(statistic: BenchmarkStatistic, truth: FloatArray, values: FloatArray) -> FloatArray:
    """Return the values of the output at which a statistic reads its distribution function."""
    if statistic.name == "quantile":
        return truth
    quantity = statistic.quantity
    if statistic.name == "exceedance":
        return np.array([threshold.value for threshold in quantity.thresholds])
    if statistic.name == "below":
        return np.array([threshold.value for threshold in quantity.lower_thresholds])
    return np.full(truth.shape, np.median(values))


@contextlib.contextmanager
def open_rehearsed(
    file: Path,
    *,
    archive: Path | None = None,
    surrogate: str = "",
    folder: Path | None = None,
    trust: bool = False,
) -> Iterator[RehearsedStudy]:
    """Provide a study with its surrogate in place of its model.

    Parameters
    ----------
    file : Path
        A study file, or an archive.
    archive : Path, optional
        The archive of a study file, by default the one that ``uqpen study`` writes.
    surrogate : str
        As in `surrogate_paths`; may be empty for the only one.
    folder, trust
        As for `restored_study`, of an archive alone.

    Raises
    ------
    ArchiveError
        If the study has no archive yet, or has changed since.
    UnknownNameError
        If the archive has no such surrogate, or several and no name is given.
    ModelError
        If the inputs or designs follow from code that may not be executed.
    """
    if file.suffix == ".nc":
        tree = open_archive(file)
        label = _label(tree, file, surrogate)
        with restored_study(tree, folder, trust=trust) as restored:
            yield _rehearsed(restored.study, tree, label)
        return
    study = load_study(file)
    path = archive or Path("archives") / f"{study.name}.nc"
    if not path.exists():
        raise ArchiveError(f"{path}: is not there; to make it: uqpen study {file}")
    tree = open_archive(path)
    label = _label(tree, path, surrogate)
    if tree.attrs.get("study_sha256") != study.sha256:
        raise ArchiveError(
            f"{path}: is of another study than {file}; to make it: uqpen study {file}"
        )
    yield _rehearsed(study, tree, label)


def _label(tree: xr.DataTree, path: Path, surrogate: str) -> str:
    """Return the label of the surrogate that is meant."""
    paths = surrogate_paths(tree)
    if not paths:
        raise UnknownNameError(
            f"{path}: contains no surrogate to rehearse on; [surrogates] of a study has them"
        )
    if not surrogate and len(paths) > 1:
        raise UnknownNameError(f"--surrogate: expected one of {', '.join(paths)}")
    label = surrogate or next(iter(paths))
    if label not in paths:
        raise UnknownNameError(f'no surrogate "{label}"; {choices(label, paths)}')
    return label


def _rehearsed(study: ValidatedStudy, tree: xr.DataTree, label: str) -> RehearsedStudy:
    """Restore a surrogate, and put it in place of its model."""
    if unloaded := study.unloaded_members:
        raise ModelError(
            f"the study draws its points by code that the archive names: {', '.join(unloaded)}\n"
            "  if you trust whoever made it, say --trust"
        )
    model, group, fitted = study_surrogate(study, tree, label)
    model_tree = model_trees(tree)[model]
    designs = group_names(model_tree, RUNS)
    runs = {design: read_group(model_tree, RUNS, design) for design in designs}
    return RehearsedStudy(study, model, fitted, runs, refuted_outputs(group))
