"""Differences between models on common points, which share what the draw decides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.analyses.analyze import analyze
from uqpen.analyses.question import Question
from uqpen.evaluation import worst
from uqpen.labels import MOMENTS, QUANTILES, SAMPLING, STATUS, Sampling, Status

__all__ = ["differences"]

_TOLD = (MOMENTS, QUANTILES)


def differences(
    first: xr.Dataset, other: xr.Dataset, questions: Sequence[Question]
) -> dict[str, xr.Dataset]:
    """What another model's outputs differ by from those of the first.

    Two models at the same points differ far less than their runs scatter, so the difference is
    known better than either.

    Parameters
    ----------
    first, other : Dataset
        Runs of the two models, at the same points of one design.
    questions : sequence of Question
        One for each output of the other model.

    Returns
    -------
    dict of str to Dataset
        Moments and quantiles of other minus first, where both runs came back; nothing where the
        design is no sample of the law.
    """
    if not Sampling(first.attrs[SAMPLING]).is_sample:
        return {}
    asked = [
        replace(question, exceeds=(), hold=())
        for question in questions
        if question.output.name in first and not question.output.categories
    ]
    runs = worst([first, other])
    came_back = runs[STATUS].values == Status.OK
    for question in asked:
        name = question.output.name
        difference = np.where(came_back, other[name].values - first[name].values, np.nan)
        runs[name] = other[name].copy(data=difference)
    return analyze(runs, asked, only=_TOLD)
