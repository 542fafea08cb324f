"""Every analysis of one design's runs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

import xarray as xr

from uqpen.analyses import ANALYSES, ANALYSES_OF_DESIGNS
from uqpen.analyses.probabilities import statuses
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Sample, sample_of_law
from uqpen.analyses.where_lost import LOSSES, where_lost
from uqpen.evaluation import status_counts
from uqpen.labels import CONDITIONAL, MISSING, RUN, SAMPLING, STATUS, STATUSES, Sampling, Status
from uqpen.lookup import resolve
from uqpen.threads import one_blas_thread

__all__ = ["analyze"]

Answers = Iterator[tuple[str, xr.DataArray]]


def analyze(
    runs: xr.Dataset, questions: Sequence[Question], *, only: Collection[str] | None = None
) -> dict[str, xr.Dataset]:
    """All that the runs of a design can tell.

    Parameters
    ----------
    runs : Dataset
        With ``status(run)``, and attributes that say how the points were drawn.
    questions : sequence of Question
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
        return _analyzed(runs, questions, only)


def _analyzed(
    runs: xr.Dataset, questions: Sequence[Question], only: Collection[str] | None
) -> dict[str, xr.Dataset]:
    """Return the groups of `analyze`."""
    sampling = Sampling(runs.attrs[SAMPLING])
    groups: dict[str, xr.Dataset] = {}
    if sampling.is_sample:
        drawn = sample_of_law(runs)
        samples = Sample.of_each(drawn, [question.output.name for question in questions])
        groups = _answered(
            _wanted(ANALYSES, only),
            questions,
            lambda question: samples[question.output.name],
            _accounts(drawn),
        )
        if only is None or STATUSES in only:
            groups[STATUSES] = xr.Dataset(dict(statuses(drawn)), attrs=_accounts(drawn))
    if (only is None or LOSSES in only) and (told := dict(where_lost(Sample.of(runs, STATUS)))):
        groups[LOSSES] = xr.Dataset(told, attrs=_accounts(runs))
    made_for = _wanted(ANALYSES_OF_DESIGNS.get(sampling, {}), only)
    for group, answers in _answered(made_for, questions, lambda _: runs, _accounts(runs)).items():
        # What a design is made to tell, it tells better than its sample does.
        groups[group] = answers.merge(groups.get(group, xr.Dataset()), compat="override")
        groups[group].attrs = answers.attrs
    return groups


def _wanted(
    analyses: Mapping[str, Sequence[str]], only: Collection[str] | None
) -> Mapping[str, Sequence[str]]:
    return analyses if only is None else {k: v for k, v in analyses.items() if k in only}


def _answered(
    analyses: Mapping[str, Sequence[str]],
    questions: Sequence[Question],
    evidence: Callable[[Question], Any],
    attributes: Mapping[str, int | str],
) -> dict[str, xr.Dataset]:
    """The answers of analyses to all questions, group by group."""
    groups = {}
    for group, references in analyses.items():
        variables = {
            name: answer
            for reference in references
            for question in questions
            for name, answer in resolve(reference)(evidence(question), question)
        }
        if variables:
            groups[group] = xr.Dataset(variables, attrs=attributes)
    return groups


def _accounts(runs: xr.Dataset) -> dict[str, int | str]:
    """What a group of statistics says of the runs that it is of."""
    counts = status_counts(runs)
    lost = {status: count for status, count in counts.items() if count and status}
    attributes: dict[str, int | str] = {
        "runs": int(runs.sizes[RUN]),
        "runs_used": counts[Status.OK],
        **{f"runs_{status.meaning}": count for status, count in lost.items()},
    }
    if lost.pop(Status.INADMISSIBLE, 0):
        attributes[CONDITIONAL] = "admissible inputs"
    if lost:
        share = sum(lost.values()) / (sum(lost.values()) + counts[Status.OK])
        attributes[MISSING] = f"{100 * share:.3g} % of the admissible runs"
    return attributes
