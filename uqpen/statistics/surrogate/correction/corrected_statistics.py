"""Statistics of a surrogate, each corrected by real runs as far as intervals are known to cover."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUND,
    EQUIVALENT_RUNS,
    ESTIMATOR,
    INTERVAL_LEVEL,
    NOTE,
    RANK,
    STOPPING_STATISTICS,
    SURROGATE_ESTIMATE,
)
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.stopped_runs import mark_uncertified
from uqpen.statistics.surrogate.correction.corrected_indices import corrected_indices
from uqpen.statistics.surrogate.correction.corrected_moments import CorrectedMoments
from uqpen.statistics.surrogate.correction.correction_evidence import CorrectionEvidence
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.disagreements import CorrectedCdf, corrected_probability

__all__ = ["correct_statistics"]


def correct_statistics(
    found: Mapping[str, OutputStatistics],
    evidence: CorrectionEvidence,
    quantities: Sequence[QuantityOfInterest],
) -> dict[str, OutputStatistics]:
    """Correct the statistics of a surrogate by real runs.

    Parameters
    ----------
    found : mapping of str to mapping of str to DataArray
        By output, the surrogate's own estimate arrays.
    evidence : CorrectionEvidence
    quantities : sequence of QuantityOfInterest

    Returns
    -------
    dict of str to dict of str to DataArray
        Estimate arrays with the coordinates ``surrogate_estimate``, the surrogate's own figure,
        and ``equivalent_runs``, the number of plain runs whose interval would be as narrow; NaN
        where there is none. What runs cannot correct keeps its figure, with the reason.
    """
    wanted = {quantity.output.name: quantity for quantity in quantities}
    corrected = {}
    for name, statistics in found.items():
        output = _Output(wanted[name], statistics, evidence)
        corrected[name] = {key: output.corrected(key, array) for key, array in statistics.items()}
    if not evidence.has_own_number:
        return corrected
    return mark_uncertified(corrected, {STOPPING_STATISTICS: "[]"})


@dataclass(frozen=True)
class _Output:
    """The statistics of one output."""

    quantity: QuantityOfInterest
    statistics: OutputStatistics
    evidence: CorrectionEvidence

    def corrected(self, name: str, array: xr.DataArray) -> xr.DataArray:
        """Return one statistic, corrected if runs can do that."""
        reason = self.evidence.reasons.get(self.quantity.output.name, "")
        if name == "cdf_value":
            return array if reason else array.copy(data=self._cdf_values)
        if BOUND not in array.dims:
            return array
        raw = array.values[..., 0]
        correction = _CORRECTIONS.get(name)
        if reason or correction is None:
            estimates = _uncorrected(name, array, reason or texts.NO_CORRECTION)
        else:
            estimates = list(correction(self, name, array))
            estimator = texts.CORRECTED_BY.format(
                estimator=array.attrs[ESTIMATOR], runs=self.runs.size
            )
            array = array.assign_attrs({ESTIMATOR: estimator})
        if RANK in array.dims and not reason:
            raw = self._cdf.surrogate_share(self._cdf_values)
        return _corrected_array(array, estimates, raw, self._equivalent_runs(name, estimates))

    @property
    def runs(self) -> CorrectionRuns:
        """The runs that correct the output."""
        return self.evidence.runs[self.quantity.output.name]

    @cached_property
    def _moments(self) -> CorrectedMoments:
        return CorrectedMoments(self.runs)

    @cached_property
    def _cdf(self) -> CorrectedCdf:
        return CorrectedCdf(self.runs)

    @cached_property
    def _cdf_values(self) -> FloatArray:
        """The corrected quantiles at the ranks of a distribution function."""
        ranks = self.statistics["cdf_value"][RANK].values
        return self._cdf.quantile(ranks)[0]

    def mean(self) -> Iterator[Estimate]:
        """Yield the mean."""
        yield self._with_loss(self._moments.mean())

    def std(self) -> Iterator[Estimate]:
        """Yield the standard deviation."""
        yield self._with_loss(self._moments.std())

    def exceedance(self) -> Iterator[Estimate]:
        """Yield the probabilities of exceeding each threshold."""
        for threshold in self.quantity.thresholds:
            yield self._probability(lambda values, limit=threshold.value: values > limit)

    def below(self) -> Iterator[Estimate]:
        """Yield the probabilities of lying below each threshold."""
        for threshold in self.quantity.lower_thresholds:
            yield self._probability(lambda values, limit=threshold.value: values < limit)

    def _probability(self, happens: Callable[[FloatArray], BoolArray]) -> Estimate:
        runs = self.runs
        of = (runs.values, runs.predictions, runs.draws, runs.lost_predictions)
        found = corrected_probability(runs, *map(happens, of))
        ends = float(found.value), float(found.lower), float(found.upper)
        return self._with_loss(Estimate(*ends, texts.CORRECTED_BONETT_PRICE, "discrete"))

    def quantile(self) -> Iterator[Estimate]:
        """Yield the requested quantiles."""
        yield from self._quantiles(np.array(self.quantity.quantiles))

    def percentile(self) -> Iterator[Estimate]:
        """Yield the percentiles that every study has."""
        yield from self._quantiles(self.statistics["percentile"]["percent"].values / 100)

    def _quantiles(self, probabilities: FloatArray) -> Iterator[Estimate]:
        for value, lower, upper in zip(*self._cdf.quantile(probabilities), strict=True):
            too_few = texts.TOO_FEW_RUNS.format(runs=self.runs.size)
            if math.isnan(lower) and math.isnan(upper):
                yield Estimate.without_bounds(float(value), too_few)
                continue
            notes = [
                text.format(too_few=too_few)
                for end, text in ((lower, texts.NO_LOWER_BOUND), (upper, texts.NO_UPPER_BOUND))
                if math.isnan(end)
            ]
            ends = float(value), float(lower), float(upper)
            estimate = Estimate(*ends, texts.CORRECTED_WOODRUFF, "discrete")
            yield self._with_loss(estimate.with_note(*notes))

    def cdf(self) -> Iterator[Estimate]:
        """Yield the distribution function at its values, with pointwise bounds."""
        found = self._cdf.at(self._cdf_values)
        for ends in zip(found.value, found.lower, found.upper, strict=True):
            estimate = Estimate(*map(float, ends), texts.CORRECTED_BONETT_PRICE, "discrete")
            yield self._with_loss(estimate)

    def cdf_band(self) -> Iterator[Estimate]:
        """Yield the distribution function at its values without a simultaneous band."""
        for value in self._cdf.at(self._cdf_values).value:
            yield Estimate.without_bounds(float(value), texts.NO_CORRECTED_BAND)

    def indices(self, name: str, array: xr.DataArray) -> Iterator[Estimate]:
        """Yield the first-order or the total-order indices of the inputs."""
        parts = self.evidence.parts[self.quantity.output.name]
        of_order = parts.first if name == "first_order" else parts.total
        problem = parts.reason or self._moments.spread_problem
        if problem or of_order is None:
            yield from _uncorrected(name, array, problem)
            return
        for estimate in corrected_indices(self.runs, of_order, self._moments.variance):
            yield self._with_loss(estimate)

    def _with_loss(self, estimate: Estimate) -> Estimate:
        """Return an estimate with a note where runs are missing."""
        if not self.runs.lost:
            return estimate
        return estimate.with_note(
            estimate.note, texts.OF_ALL_ADMISSIBLE.format(lost=self.runs.lost)
        )

    def _equivalent_runs(self, name: str, estimates: Sequence[Estimate]) -> FloatArray:
        """Return how many plain runs would give intervals as narrow, NaN where that is unknown."""
        none = np.full(len(estimates), math.nan)
        plain = self.evidence.plain.get(self.quantity.output.name, {}).get(name)
        if plain is None or plain.size != 3 * len(estimates):
            return none
        _, lower, upper = plain.values.reshape(-1, 3).T
        width = np.array([estimate.upper - estimate.lower for estimate in estimates])
        with np.errstate(divide="ignore", invalid="ignore"):
            found = int(plain.attrs["runs_used"]) * ((upper - lower) / width) ** 2
        return np.where(np.isfinite(found), found, math.nan)


_CORRECTIONS: Mapping[str, Callable[[_Output, str, xr.DataArray], Iterator[Estimate]]] = {
    "mean": lambda output, *_: output.mean(),
    "std": lambda output, *_: output.std(),
    "exceedance": lambda output, *_: output.exceedance(),
    "below": lambda output, *_: output.below(),
    "quantile": lambda output, *_: output.quantile(),
    "percentile": lambda output, *_: output.percentile(),
    "cdf": lambda output, *_: output.cdf(),
    "cdf_band": lambda output, *_: output.cdf_band(),
    "first_order": _Output.indices,
    "total_order": _Output.indices,
}


def _uncorrected(name: str, array: xr.DataArray, reason: str) -> list[Estimate]:
    """Return the surrogate's own figures without bounds; what is no number keeps its reason."""
    keeps_note = name in CATALOGUE and CATALOGUE[name].note_is_of_estimate
    found = []
    for at in np.ndindex(array.shape[:-1]):
        value, note = float(array.values[at][0]), str(array.coords[NOTE].values[at])
        reasons = (note,) if math.isnan(value) else (reason, note if keeps_note else "")
        found.append(Estimate.without_bounds(value, *reasons))
    return found


def _corrected_array(
    array: xr.DataArray, estimates: Sequence[Estimate], raw: FloatArray, equivalent: FloatArray
) -> xr.DataArray:
    """Return estimates as the estimate array of a statistic, with what stands beside them."""
    dims = {str(dim): size for dim, size in array.sizes.items() if dim != BOUND}
    attributes = dict(array.attrs)
    level = attributes.pop(INTERVAL_LEVEL, LEVEL)
    own = {key: each.variable for key, each in array.coords.items() if key not in INTERVAL_TEXTS}
    found = Estimate.array(
        estimates,
        dims,
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        coordinates=own,
        level=level,
    )
    shape = tuple(dims.values())
    return found.assign_coords(
        {
            SURROGATE_ESTIMATE: (tuple(dims), raw.reshape(shape)),
            EQUIVALENT_RUNS: (tuple(dims), equivalent.reshape(shape)),
        }
    ).assign_attrs(attributes)
