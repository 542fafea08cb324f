"""Every analysis of one design's runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.analyses import ANALYSES
from uqpen.analyses.probabilities import statuses
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Sample
from uqpen.labels import CONDITIONAL, STATUS, STATUSES, Status
from uqpen.lookup import resolve

__all__ = ["analyze", "status_counts"]


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
    counted = status_counts(runs)
    attributes: dict[str, int | str] = {
        "runs": int(runs[STATUS].size),
        "runs_used": counted[Status.OK],
        **{f"runs_{status.meaning}": lost for status, lost in counted.items() if status},
    }
    if Status.INADMISSIBLE in counted:
        attributes[CONDITIONAL] = "the inputs being admissible"
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
    lost = dict(statuses(runs))
    if lost:
        groups[STATUSES] = xr.Dataset(lost, attrs=attributes)
    return groups


def status_counts(runs: xr.Dataset) -> dict[Status, int]:
    """How many runs ended with each status; statuses that none has are left out, but for ok."""
    counts = np.bincount(runs[STATUS].values.astype(np.int64), minlength=len(Status))
    return {
        status: int(counts[status]) for status in Status if counts[status] or status is Status.OK
    }
