"""Corrected estimates of one output, by the names of their statistics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import OF_EXCEEDANCE, OF_LOGARITHM
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.correction.corrected_cdf import CorrectedCdf
from uqpen.statistics.surrogate.correction.corrected_indices import (
    corrected_event_indices,
    corrected_indices,
)
from uqpen.statistics.surrogate.correction.corrected_moments import CorrectedMoments
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.disagreements import CorrectedProbability
from uqpen.statistics.surrogate.correction.indexed_variables import (
    FIRST_ORDER,
    TOTAL_ORDER,
    IndexedVariable,
)
from uqpen.statistics.threshold import Threshold

__all__ = ["FEWEST_ON_A_SIDE", "OutputCorrection", "is_index"]

# The beginning of their names, and their kind.
_INDICES = {
    f"{prefix}{kind}": (prefix, kind)
    for prefix in ("", OF_LOGARITHM, OF_EXCEEDANCE)
    for kind in (FIRST_ORDER, TOTAL_ORDER)
}

# With fewer runs on a side, an event has no interval of its variance.
FEWEST_ON_A_SIDE = 10


@dataclass(frozen=True)
class OutputCorrection:
    """Real runs of one output, with its statistics.

    Parameters
    ----------
    runs : CorrectionRuns
    indexed : mapping of str to tuple of IndexedVariable
        By the beginning of the names of their indices.
    quantity : QuantityOfInterest
    """

    runs: CorrectionRuns
    indexed: Mapping[str, tuple[IndexedVariable, ...]]
    quantity: QuantityOfInterest

    def problem(self, name: str) -> str:
        """Return why a statistic keeps the surrogate's own figures; empty if it is corrected."""
        is_known = name in CATALOGUE and CATALOGUE[name].is_corrected
        return "" if is_known else texts.NO_CORRECTION

    def own_problem(self, name: str, least: float) -> str:
        """Return why the surrogate's own figures of a statistic say too little; empty if not.

        Parameters
        ----------
        name : str
        least : float
            The least share of the variance of the runs that it has to explain: of the logarithm
            for what is of that, and else of the output.
        """
        of_logarithm = self.indexed.get(OF_LOGARITHM, ()) if name.startswith(OF_LOGARITHM) else ()
        q2 = next((each.runs.q2 for each in of_logarithm), self.runs.q2)
        if q2 >= least:
            return ""
        explained = texts.EXPLAINS_TOO_LITTLE.format(share=100 * max(q2, 0.0))
        return texts.TOO_LITTLE_ALONE.format(explained=explained)

    def estimates(self, name: str, along: FloatArray) -> list[Estimate]:
        """Return the corrected estimates of a statistic.

        Parameters
        ----------
        name : str
            One without a `problem`, and none of indices.
        along : ndarray
            The probabilities of quantiles, or the values of a distribution function.
        """
        return self._with_notes(self._estimates(name, along))

    def indices(self, name: str) -> list[list[Estimate] | str]:
        """Return the corrected indices of each variable that a name has, or why there are none."""
        prefix, kind = _INDICES[name]
        return [
            self._index_problem(each, kind) or self._with_notes(self._indices(each, kind))
            for each in self.indexed[prefix]
        ]

    def _with_notes(self, found: list[Estimate]) -> list[Estimate]:
        notes = [*self._notes()]
        return [
            each if each.label == "none" else each.with_note(each.note, *notes) for each in found
        ]

    def _notes(self) -> Iterator[str]:
        """Yield what holds of all intervals."""
        if self.runs.missing:
            yield texts.OF_ALL_ADMISSIBLE.format(missing=self.runs.missing)
        if self.runs.placed:
            yield texts.OF_PLACED_RUNS.format(placed=self.runs.placed)

    def _estimates(self, name: str, along: FloatArray) -> list[Estimate]:
        match name:
            case "mean":
                return [self._moments.mean()]
            case "std":
                return [self._moments.std()]
            case "half_spread":
                return [self._half_spread()]
            case "exceedance":
                return _probabilities(self.cdf.above(_values(self.quantity.thresholds)))
            case "below":
                return _probabilities(self.cdf.below(_values(self.quantity.lower_thresholds)))
            case "cdf":
                return _probabilities(self.cdf.at(along))
        return self._quantiles(along)

    @cached_property
    def cdf(self) -> CorrectedCdf:
        """The corrected distribution function."""
        return CorrectedCdf(self.runs)

    @cached_property
    def _moments(self) -> CorrectedMoments:
        return CorrectedMoments(self.runs)

    def _half_spread(self) -> Estimate:
        value, lower, upper = self.cdf.half_spread()
        if math.isnan(upper - lower):
            too_few = texts.TOO_FEW_RUNS.format(runs=self.runs.size)
            return Estimate.without_bounds(value, too_few)
        return Estimate(value, lower, upper, texts.CORRECTED_TWO_WOODRUFF, "conservative")

    def _quantiles(self, probabilities: FloatArray) -> list[Estimate]:
        ends = zip(*self.cdf.quantile(probabilities), strict=True)
        return [self._quantile(float(at), float(low), float(high)) for at, low, high in ends]

    def _quantile(self, value: float, lower: float, upper: float) -> Estimate:
        too_few = texts.TOO_FEW_RUNS.format(runs=self.runs.size)
        if math.isnan(lower) and math.isnan(upper):
            return Estimate.without_bounds(value, too_few)
        note = ""
        if math.isnan(lower) or math.isnan(upper):
            note = texts.NO_LOWER_BOUND if math.isnan(lower) else texts.NO_UPPER_BOUND
        method = texts.CORRECTED_WOODRUFF
        return Estimate(value, lower, upper, method, "discrete", note.format(too_few=too_few))

    def _index_problem(self, variable: IndexedVariable, kind: str) -> str:
        """Return why the indices of a variable keep the surrogate's own figures; empty if not."""
        if reason := variable.reasons.get(kind, ""):
            return reason
        if variable.is_event:
            values = variable.runs.values
            on_a_side = min((values == side).sum() for side in (0, 1))
            return "" if on_a_side >= FEWEST_ON_A_SIDE else texts.TOO_ONE_SIDED
        moments = self._moments_of(variable)
        has_variance = moments.variance.value > 0
        return moments.heavy_tail or ("" if has_variance else texts.NO_VARIANCE_LEFT)

    def _indices(self, variable: IndexedVariable, kind: str) -> list[Estimate]:
        runs, parts = variable.runs, variable.parts[kind]
        if variable.is_event:
            return list(corrected_event_indices(runs, parts))
        return list(corrected_indices(runs, parts, self._moments_of(variable).variance))

    def _moments_of(self, variable: IndexedVariable) -> CorrectedMoments:
        runs = variable.runs
        return self._moments if runs is self.runs else CorrectedMoments(runs)


def is_index(name: str) -> bool:
    """Check whether runs may correct a statistic as indices of one or of several variables."""
    return name in _INDICES


def _values(thresholds: Sequence[Threshold]) -> FloatArray:
    return np.array([each.value for each in thresholds])


def _probabilities(found: CorrectedProbability) -> list[Estimate]:
    """Return probabilities with their bounds as estimates."""
    ends = zip(found.value, found.lower, found.upper, strict=True)
    method = texts.CORRECTED_BONETT_PRICE
    return [
        Estimate(float(value), float(lower), float(upper), method, "discrete")
        for value, lower, upper in ends
    ]
