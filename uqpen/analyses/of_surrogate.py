"""What a surrogate tells of the model that it stands for.

From its coefficients where those are all that is needed; else by sampling it over admissible draws.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from uqpen.analyses.analyze import analyze
from uqpen.analyses.question import Question
from uqpen.analyses.surrogate_draws import FROM_COEFFICIENTS, SurrogateDraws
from uqpen.analyses.surrogate_indices import surrogate_indices
from uqpen.labels import CDFS, ESTIMATOR, EXCEEDANCE, MOMENTS, QUANTILES, SENSITIVITY
from uqpen.surrogates.closed_forms import mean, standard_deviation

__all__ = ["Reach", "SurrogateTold", "told_by_surrogate"]

_SAMPLED = (MOMENTS, QUANTILES, EXCEEDANCE, CDFS)


@dataclass(frozen=True)
class Reach:
    """How far the runs reach that an output's surrogate was fitted to.

    Parameters
    ----------
    lowest, highest : float
        Of the outputs in those runs, in SI units.
    variance_beyond : float
        The share of the surrogate's variance that comes from values outside.
    """

    lowest: float
    highest: float
    variance_beyond: float

    def holds(self, value: float) -> bool:
        """Whether a value of the output was reached."""
        return self.lowest <= value <= self.highest


@dataclass(frozen=True)
class SurrogateTold:
    """What a surrogate tells, before anything vouches for it.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Figures, group by group as designs have them.
    reaches : mapping of str to Reach
        By output.
    """

    groups: Mapping[str, xr.Dataset]
    reaches: Mapping[str, Reach]


def told_by_surrogate(
    draws: SurrogateDraws, questions: Sequence[Question], *, only: Collection[str] | None = None
) -> SurrogateTold:
    """All that a fitted surrogate tells.

    Parameters
    ----------
    draws : SurrogateDraws
        The surrogate under the law of its inputs.
    questions : sequence of Question
        Those to outputs that it has no expansion of are passed over.
    only : collection of str, optional
        The groups that are wanted, where not all are.
    """
    asked = [
        replace(question, hold=())
        for question in questions
        if question.output.name in draws.model.expansions
    ]
    if not asked:
        return SurrogateTold({}, {})
    reaches = {question.output.name: _reach(draws, question.output.name) for question in asked}
    return SurrogateTold(dict(_groups(draws, asked, only)), reaches)


def _groups(
    draws: SurrogateDraws, questions: Sequence[Question], only: Collection[str] | None
) -> Iterator[tuple[str, xr.Dataset]]:
    sampled = [group for group in _SAMPLED if only is None or group in only]
    for group, dataset in analyze(draws.runs, questions, only=sampled).items():
        marked = {
            name: array.assign_attrs({ESTIMATOR: draws.by_sampling})
            for name, array in dataset.data_vars.items()
        }
        if group == MOMENTS:
            marked |= dict(_closed_forms(draws, questions, dataset))
        yield group, dataset.assign(marked)
    if only is not None and SENSITIVITY not in only:
        return
    indices = {
        name: array for question in questions for name, array in surrogate_indices(draws, question)
    }
    yield SENSITIVITY, xr.Dataset(indices, attrs={"estimand": draws.estimand})


def _closed_forms(
    draws: SurrogateDraws, questions: Sequence[Question], moments: xr.Dataset
) -> Iterator[tuple[str, xr.DataArray]]:
    """The exact mean and standard deviation of each expansion where they are the output's."""
    for question in questions:
        name = question.output.name
        if draws.has_closed_form(name):
            expansion = draws.model.expansions[name]
            terms = expansion.indices, expansion.coefficients
            for statistic, value in (("mean", mean(*terms)), ("std", standard_deviation(*terms))):
                array = moments[f"{name}_{statistic}"]
                exact = array.copy(data=[value, math.nan, math.nan])
                yield f"{name}_{statistic}", exact.assign_attrs({ESTIMATOR: FROM_COEFFICIENTS})


def _reach(draws: SurrogateDraws, output: str) -> Reach:
    expansion = draws.model.expansions[output]
    values = draws.runs[output].values
    values = values[np.isfinite(values)]
    squares = (values - values.mean()) ** 2 if values.size else values
    outside = (values < expansion.smallest) | (values > expansion.largest)
    whole = float(squares.sum())
    beyond = float(squares[outside].sum()) / whole if whole > 0 else 0.0
    return Reach(expansion.smallest, expansion.largest, beyond)
