"""Every analysis of one design's runs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

import xarray as xr

from uqpen.core.labels import (
    CONDITIONAL,
    MISSING,
    RUN,
    SAMPLING,
    STATUS,
    STATUSES,
    Sampling,
    Status,
)
from uqpen.core.lookup import resolve
from uqpen.core.threads import one_blas_thread
from uqpen.execution import status_counts
from uqpen.statistics import ANALYSES, ANALYSES_OF_DESIGNS
from uqpen.statistics.distribution_function.probabilities import status_probabilities
from uqpen.statistics.failure_analysis import FAILURES, failure_analysis
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample, input_sample

__all__ = ["analyze"]

NamedArrays = Iterator[tuple[str, xr.DataArray]]


def analyze(
    runs: xr.Dataset,
    quantities: Sequence[QuantityOfInterest],
    *,
    only: Collection[str] | None = None,
) -> dict[str, xr.Dataset]:
    """All that the runs of a design can tell.

    Parameters
    ----------
    runs : Dataset
        With ``status(run)``, and attributes that say how the points were drawn.
    quantities : sequence of QuantityOfInterest
        One for each output.
    only : collection of str, optional
        The groups that are wanted, where not all are.

    Returns
    -------
    dict of str to Dataset
        By the name of the group; without those that have nothing to say. Each says in its
        attributes how many runs it used and how many were lost to what.
    """
    with one_blas_thread():
        return _analyzed(runs, quantities, only)


def _analyzed(
    runs: xr.Dataset, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
) -> dict[str, xr.Dataset]:
    """Return the groups of `analyze`."""
    sampling = Sampling(runs.attrs[SAMPLING])
    groups: dict[str, xr.Dataset] = {}
    if sampling.is_sample:
        drawn = input_sample(runs)
        samples = Sample.several_from_runs(drawn, [quantity.output.name for quantity in quantities])
        groups = _run_analyses(
            _select_analyses(ANALYSES, only),
            quantities,
            lambda quantity: samples[quantity.output.name],
            _run_counts(drawn),
        )
        if only is None or STATUSES in only:
            groups[STATUSES] = xr.Dataset(
                dict(status_probabilities(drawn)), attrs=_run_counts(drawn)
            )
    if (only is None or FAILURES in only) and (
        failures := dict(failure_analysis(Sample.from_runs(runs, STATUS)))
    ):
        groups[FAILURES] = xr.Dataset(failures, attrs=_run_counts(runs))
    design_analyses = _select_analyses(ANALYSES_OF_DESIGNS.get(sampling, {}), only)
    for group, answers in _run_analyses(
        design_analyses, quantities, lambda _: runs, _run_counts(runs)
    ).items():
        # What a design is made to tell, it tells better than its sample does.
        groups[group] = answers.merge(groups.get(group, xr.Dataset()), compat="override")
        groups[group].attrs = answers.attrs
    return groups


def _select_analyses(
    analyses: Mapping[str, Sequence[str]], only: Collection[str] | None
) -> Mapping[str, Sequence[str]]:
    return analyses if only is None else {k: v for k, v in analyses.items() if k in only}


def _run_analyses(
    analyses: Mapping[str, Sequence[str]],
    quantities: Sequence[QuantityOfInterest],
    evidence: Callable[[QuantityOfInterest], Any],
    attributes: Mapping[str, int | str],
) -> dict[str, xr.Dataset]:
    """The answers of analyses to all questions, group by group."""
    groups = {}
    for group, references in analyses.items():
        variables = {
            name: answer
            for reference in references
            for quantity in quantities
            for name, answer in resolve(reference)(evidence(quantity), quantity)
        }
        if variables:
            groups[group] = xr.Dataset(variables, attrs=attributes)
    return groups


def _run_counts(runs: xr.Dataset) -> dict[str, int | str]:
    """What a group of statistics says of the runs that it is of."""
    counts = status_counts(runs)
    failed = {status: count for status, count in counts.items() if count and status}
    attributes: dict[str, int | str] = {
        "runs": int(runs.sizes[RUN]),
        "runs_used": counts[Status.OK],
        **{f"runs_{status.meaning}": count for status, count in failed.items()},
    }
    if failed.pop(Status.INADMISSIBLE, 0):
        attributes[CONDITIONAL] = "admissible inputs"
    if failed:
        share = sum(failed.values()) / (sum(failed.values()) + counts[Status.OK])
        attributes[MISSING] = f"{100 * share:.3g} % of the admissible runs"
    return attributes
