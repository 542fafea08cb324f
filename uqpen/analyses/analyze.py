"""Every analysis of one design's runs."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from uqpen.analyses import ANALYSES
from uqpen.analyses.probabilities import statuses
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Sample
from uqpen.evaluation import status_counts
from uqpen.labels import CONDITIONAL, MISSING, RUN, STATUSES, Status
from uqpen.lookup import resolve

__all__ = ["analyze"]


def analyze(runs: xr.Dataset, questions: Sequence[Question]) -> dict[str, xr.Dataset]:
    """All that the runs of a design can tell.

    Parameters
    ----------
    runs : Dataset
        With ``status(run)``, and attributes that say how the points were drawn.
    questions : sequence of Question
        One for each output.

    Returns
    -------
    dict of str to Dataset
        By the name of the analysis; without those that have nothing to say. Each says in its
        attributes how many runs it used and how many were lost to what.
    """
    samples = {
        question.output.name: Sample.of(runs, question.output.name) for question in questions
    }
    attributes = _accounts(runs)
    groups = {}
    for name, reference in ANALYSES.items():
        analysis = resolve(reference)
        variables = dict(
            pair
            for question in questions
            for pair in analysis(samples[question.output.name], question)
        )
        if variables:
            groups[name] = xr.Dataset(variables, attrs=attributes)
    groups[STATUSES] = xr.Dataset(dict(statuses(runs)), attrs=attributes)
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
