"""Analysis of one design's runs: all statistics of its outputs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    CONDITIONAL,
    MISSING,
    POINT,
    REPEAT,
    RUN,
    RUNS_ABSENT,
    SAMPLING,
    STATUS,
    WEIGHT,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.lookup import resolve
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import first_repeats, status_counts
from uqpen.statistics import (
    ANALYSES,
    ANALYSES_OF_DESIGNS,
    ANALYSES_OF_REPEATS,
    FIELD_ANALYSES,
    FIELD_ANALYSES_OF_DESIGNS,
    WEIGHTED_ANALYSES,
    texts,
)
from uqpen.statistics.by_blocks.large_sample import LargeSample
from uqpen.statistics.distribution_function.probabilities import status_probabilities
from uqpen.statistics.estimate import LEVEL, unweighted
from uqpen.statistics.failure_analysis import failure_analysis
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.input_columns import RunInputs
from uqpen.statistics.noise import RepeatedSample
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import (
    absent_condition,
    each_sample,
    input_sample,
    runs_with_value,
    sample_of,
)
from uqpen.statistics.sample import Sample
from uqpen.statistics.user_defined import user_defined_statistics
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

Analysis = Callable[..., Iterable[tuple[str, xr.DataArray]]]
# Estimate arrays by the names of their statistics.
OutputStatistics = dict[str, xr.DataArray]


def analyze(
    runs: xr.Dataset | BlockedRuns,
    quantities: Sequence[QuantityOfInterest],
    *,
    only: Collection[str] | None = None,
    user_defined: Sequence[UserDefinedAnalysis] = (),
    in_memory: int = RUNS_IN_MEMORY,
) -> dict[str, OutputStatistics]:
    """Compute all statistics that the runs of a design allow.

    Parameters
    ----------
    runs : Dataset or BlockedRuns
        With ``status(run)``, and attributes on the sampling of the points. Of a handle only the
        columns are read that an analysis needs; a design that is made for a statistic needs all.
    quantities : sequence of QuantityOfInterest
        One for each output.
    only : collection of str, optional
        Keys of `ANALYSES`, where not all of them are wanted.
    user_defined : sequence of UserDefinedAnalysis
        User-defined analyses, which are applied to a sample after the built-in ones.
    in_memory : int
        A sample of more runs goes by blocks. An analysis that cannot go so takes as many of its
        runs, and its estimates say so.

    Returns
    -------
    dict of str to dict of str to DataArray
        By output, estimate arrays by statistic, in the order of the catalogue. The attributes of
        each say how many runs it used, and how many ended how.
    """
    with one_blas_thread():
        handle = LoadedDataset.of(runs)
        if goes_by_blocks(handle, in_memory):
            found = {q.output.name: OutputStatistics() for q in quantities}
            large, of_runs = large_sample(handle, in_memory), run_counts(handle)
            for name, statistics, used in large.statistics(quantities, only, user_defined):
                counts = output_run_counts(handle, of_runs, name, used) if used >= 0 else {}
                found[name] |= {key: _with_counts(each, counts) for key, each in statistics.items()}
        else:
            found = _analyze_whole(handle, quantities, only, user_defined)
        return {output: in_catalogue_order(statistics) for output, statistics in found.items()}


def all_analyses_but(left_out: Collection[str]) -> frozenset[str] | None:
    """Return the keys of all analyses but some, as `analyze` takes them; None for all of them."""
    if not left_out:
        return None
    of_designs = [*ANALYSES_OF_DESIGNS.values(), *FIELD_ANALYSES_OF_DESIGNS.values()]
    return frozenset().union(ANALYSES, FIELD_ANALYSES, *of_designs).difference(left_out)


def goes_by_blocks(runs: BlockedRuns, in_memory: int) -> bool:
    """Check for a sample of more runs than a number, which is not made of a design's own blocks."""
    sampling = Sampling(runs.attrs[SAMPLING])
    return runs.size > in_memory and sampling.is_sample and sampling is not Sampling.PICK_FREEZE


def large_sample(runs: BlockedRuns, in_memory: int) -> LargeSample:
    """Return a sample of many runs, a part of whose runs goes through memory."""
    return LargeSample(runs, in_memory, _analyze_whole)


def _analyze_whole(
    handle: BlockedRuns,
    quantities: Sequence[QuantityOfInterest],
    only: Collection[str] | None,
    user_defined: Sequence[UserDefinedAnalysis],
) -> dict[str, OutputStatistics]:
    """Compute the statistics of runs in memory."""
    sampling = Sampling(handle.attrs[SAMPLING])
    found: dict[str, OutputStatistics] = {q.output.name: {} for q in quantities}
    scalars = [quantity for quantity in quantities if not quantity.output.dims]
    fields = [quantity for quantity in quantities if quantity.output.dims]
    if sampling.is_sample:
        drawn = drawn_runs(handle)
        of_runs = run_counts(drawn)
        counts = {name: output_run_counts(drawn, of_runs, name) for name in found}
        # What is made of an output ends with its sample, before the next one is made, as the values
        # of one field may be most of the memory. What is made of the inputs is common to all.
        shared: list[RunInputs] = []
        for of_samples, chosen in ((ANALYSES, scalars), (FIELD_ANALYSES, fields)):
            analyses = _select(of_samples, only, is_weighted=WEIGHT in drawn.template.coords)
            samples = _samples(drawn, chosen)
            for quantity in chosen:
                name = quantity.output.name
                found[name] |= _of_sample(analyses, next(samples), quantity, counts[name], shared)
    # A design that is made for a statistic estimates it better than its sample does.
    for of_designs, chosen in (
        (ANALYSES_OF_DESIGNS, scalars),
        (FIELD_ANALYSES_OF_DESIGNS, fields),
    ):
        if chosen and (own := _select(of_designs.get(sampling, {}), only)):
            of_runs = run_counts(handle)
            for quantity in chosen:
                name = quantity.output.name
                whole = runs_with_value(handle, name)
                found[name] |= _of(own, whole, quantity, output_run_counts(handle, of_runs, name))
    if sampling.is_sample and user_defined:
        for quantity, sample in zip(scalars, _samples(drawn, scalars), strict=True):
            name = quantity.output.name
            added = user_defined_statistics(user_defined, sample, quantity, found[name])
            found[name] |= {key: array.assign_attrs(counts[name]) for key, array in added.items()}
    return found


def analyze_repeats(
    runs: xr.Dataset,
    quantities: Sequence[QuantityOfInterest],
    *,
    only: Collection[str] | None = None,
    in_memory: int = RUNS_IN_MEMORY,
) -> dict[str, OutputStatistics]:
    """Compute the statistics of numbers that take all runs at each point, if a point has several.

    A statistic that is not among them takes the first run at each point, as `analyze` does.

    Parameters
    ----------
    runs : Dataset
        All runs of a design.
    quantities : sequence of QuantityOfInterest
    only : collection of str, optional
        Groups of statistics, where not all of them are wanted.
    in_memory : int
        Of more runs there are none.

    Returns
    -------
    dict of str to dict of str to DataArray
        As `analyze` returns them.
    """
    sampling = Sampling(runs.attrs[SAMPLING])
    if (
        REPEAT not in runs.coords
        or not sampling.is_sample
        or sampling is Sampling.PICK_FREEZE
        or WEIGHT in runs.coords
        or runs.sizes[RUN] > in_memory
    ):
        return {}
    analyses, handle = _select(ANALYSES_OF_REPEATS, only), LoadedDataset(runs)
    of_runs, first = run_counts(handle), sample_of(first_repeats(runs), STATUS)
    points = replace(first, used=np.arange(len(first.replicates)))
    place = runs[POINT].values, runs[REPEAT].values
    found: dict[str, OutputStatistics] = {}
    with one_blas_thread():
        for quantity in quantities:
            if quantity.output.dims or quantity.output.categories:
                continue
            name = quantity.output.name
            sample = sample_of(runs, name)
            values = np.full((points.size, int(place[1].max(initial=0)) + 1), np.nan)
            values[tuple(each[sample.used] for each in place)] = sample.values
            own = replace(points, level=quantity.confidence_level)
            counts = output_run_counts(handle, of_runs, name)
            found[name] = _of(analyses, RepeatedSample.of(own, values), quantity, counts)
    return found


def analyze_failures(
    runs: xr.Dataset | BlockedRuns, level: float = LEVEL, *, in_memory: int = RUNS_IN_MEMORY
) -> OutputStatistics:
    """Compute the probability of each status of a run, and the association of inputs with failure.

    Parameters
    ----------
    runs : Dataset or BlockedRuns
        As `analyze` takes them.
    level : float
        Confidence level of the intervals.
    in_memory : int
        Of more runs, the associations are those of a part of as many.

    Returns
    -------
    dict of str to DataArray
        ``probability`` along ``status``, where the design is a sample; the arrays of
        `failure_analysis`, where runs failed.
    """
    found: OutputStatistics = {}
    handle = LoadedDataset.of(runs)
    if goes_by_blocks(handle, in_memory):
        large = large_sample(handle, in_memory)
        found = large.with_note(analyze_failures(large.part, level), texts.RANKS_IN_MEMORY)
        return {**found, "probability": large.status_probabilities(level, run_counts(handle))}
    counts = run_counts(handle)
    if Sampling(handle.attrs[SAMPLING]).is_sample:
        drawn = drawn_runs(handle)
        counts_of_sample = run_counts(drawn)
        found["probability"] = status_probabilities(drawn, level).assign_attrs(counts_of_sample)
    is_weighted = WEIGHT in handle.template.coords
    analysis = unweighted(failure_analysis) if is_weighted else failure_analysis
    for name, array in analysis(replace(sample_of(handle, STATUS), level=level)):
        found[name] = array.assign_attrs(counts)
    return found


def drawn_runs(runs: BlockedRuns) -> BlockedRuns:
    """Return the runs of a design whose points are a sample of the joint distribution."""
    if Sampling(runs.attrs[SAMPLING]) is Sampling.PICK_FREEZE:
        return LoadedDataset(input_sample(runs.dataset()))
    return runs


def in_catalogue_order(statistics: Mapping[str, xr.DataArray]) -> OutputStatistics:
    """Return statistics in the order of the catalogue, those that it does not know at the end."""
    places = {name: place for place, name in enumerate(CATALOGUE)}
    return dict(sorted(statistics.items(), key=lambda item: places.get(item[0], len(places))))


def _samples(runs: BlockedRuns, quantities: Sequence[QuantityOfInterest]) -> Iterator[Sample]:
    """Yield the sample of each output, with the confidence level of its intervals."""
    levels = (quantity.confidence_level for quantity in quantities)
    made = each_sample(runs, [quantity.output.name for quantity in quantities])
    return map(lambda sample, level: replace(sample, level=level), made, levels)


def _select(
    analyses: Mapping[str, Sequence[str]],
    only: Collection[str] | None,
    *,
    is_weighted: bool = False,
) -> list[Analysis]:
    """Return the analyses that are wanted; those that do not know weights without their values."""
    return [
        unweighted(resolve(reference))
        if is_weighted and name not in WEIGHTED_ANALYSES
        else resolve(reference)
        for name, references in analyses.items()
        if only is None or name in only
        for reference in references
    ]


def _of_sample(
    analyses: Sequence[Analysis],
    sample: Sample,
    quantity: QuantityOfInterest,
    counts: Mapping[str, int | str],
    shared: list[RunInputs],
) -> OutputStatistics:
    """Return the statistics of a sample, and keep its inputs."""
    shared.append(sample.run_inputs)
    output = quantity.output
    evidence = FieldSample(sample, output) if output.dims else sample
    return _of(analyses, evidence, quantity, counts)


def _of(
    analyses: Sequence[Analysis],
    evidence: Any,
    quantity: QuantityOfInterest,
    counts: Mapping[str, int | str],
) -> OutputStatistics:
    return {
        name: _with_counts(array, counts)
        for analysis in analyses
        for name, array in analysis(evidence, quantity)
    }


def _with_counts(array: xr.DataArray, attributes: Mapping[str, int | str]) -> xr.DataArray:
    """Return a statistic that was just made, with the counts of its runs and all its conditions."""
    conditions = [each[CONDITIONAL] for each in (attributes, array.attrs) if CONDITIONAL in each]
    joined = {CONDITIONAL: " and ".join(map(str, conditions))} if conditions else {}
    array.attrs |= {**attributes, **joined}  # as `assign_attrs`, without its copy
    return array


def run_counts(runs: BlockedRuns) -> dict[str, int | str]:
    """Return the counts of the runs of a statistic, as attributes."""
    counts = status_counts(runs)
    failed = {status: count for status, count in counts.items() if count and status}
    attributes: dict[str, int | str] = {
        "runs": runs.size,
        "runs_used": counts[Status.OK],
        **{f"runs_{status.meaning}": count for status, count in failed.items()},
    }
    if failed.pop(Status.INADMISSIBLE, 0):
        attributes[CONDITIONAL] = texts.ADMISSIBLE_INPUTS
    if failed:
        share = sum(failed.values()) / (sum(failed.values()) + counts[Status.OK])
        attributes[MISSING] = texts.MISSING_SHARE.format(share=100 * share)
    return attributes


def output_run_counts(
    runs: BlockedRuns, counts: Mapping[str, int | str], name: str, used: int | None = None
) -> dict[str, int | str]:
    """Return the counts of the runs of an output's statistics, as attributes.

    They are those of `run_counts`, but for runs without a value; the others' number may be given.
    """
    missing = None if used is None else int(counts["runs_used"]) - used
    absent = absent_condition(runs, name, missing)
    if not absent:
        return {**counts}
    return {**counts, **absent, "runs_used": int(counts["runs_used"]) - int(absent[RUNS_ABSENT])}
