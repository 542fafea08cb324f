"""Statistics of a surrogate, each corrected by real runs as far as intervals are known to cover."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUND,
    EQUIVALENT_RUNS,
    ESTIMATOR,
    INPUT,
    INTERVAL_LEVEL,
    NOTE,
    RANK,
    STOPPING_STATISTICS,
    SURROGATE_ESTIMATE,
)
from uqpen.core.statistic_dimensions import PERCENT, PROBABILITY
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.stopped_runs import mark_uncertified
from uqpen.statistics.surrogate.correction.correction_evidence import CorrectionEvidence
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.output_correction import (
    OutputCorrection,
    is_index,
)

__all__ = ["correct_statistics", "narrower"]

# A surrogate that leaves more of the variance than it explains has no figure that no run corrects:
# half of a share of the variance can then be an error. Nor do the indices of the runs alone, which
# are of outputs that are smooth along an input, take its place: the output may be rougher than
# both can see, and with a useless surrogate of 100 runs they covered in 69 %.
_LEAST_Q2 = 0.5


@np.errstate(over="ignore", invalid="ignore")  # fourth powers may overflow: no interval then
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
        where there is none. What runs cannot correct keeps its figure, with the reason, where the
        surrogate explains at least half of the variance of the runs; else it has none.

    Notes
    -----
    An interval is that of the runs alone where this is `narrower`.
    """
    wanted = {quantity.output.name: quantity for quantity in quantities}
    corrected = {
        name: _corrected(statistics, wanted[name], evidence) for name, statistics in found.items()
    }
    if not evidence.has_own_number:
        return corrected
    return mark_uncertified(corrected, {STOPPING_STATISTICS: "[]"})


def _corrected(
    statistics: OutputStatistics, quantity: QuantityOfInterest, evidence: CorrectionEvidence
) -> OutputStatistics:
    """Return the statistics of one output."""
    output = quantity.output.name
    if reason := evidence.reasons.get(output, ""):
        return {name: _uncorrected(name, array, reason) for name, array in statistics.items()}
    correction = OutputCorrection(evidence.runs[output], evidence.indexed[output], quantity)
    plain = evidence.plain[output]
    found = {}
    for name, array in statistics.items():
        if RANK in array.dims:
            found[name] = _at_ranks(name, array, correction, plain.get(name))
        elif is_index(name):
            found[name] = _at_inputs(name, array, correction, plain.get(name))
        elif reason := correction.problem(name):
            found[name] = _uncorrected(name, array, reason, correction.own_problem(name, _LEAST_Q2))
        else:
            estimates = correction.estimates(name, _probabilities(array))
            estimates = _narrower_ones(estimates, plain.get(name), correction, is_index=False)
            own = array.values[..., 0]
            found[name] = _with_estimates(array, estimates, own, correction, plain.get(name))
    return found


def _probabilities(array: xr.DataArray) -> FloatArray:
    """Return the probabilities of quantiles; none of other statistics."""
    if PERCENT in array.dims:
        return np.asarray(array[PERCENT].values / 100)
    return np.asarray(array[PROBABILITY].values) if PROBABILITY in array.dims else np.empty(0)


def _at_ranks(
    name: str, array: xr.DataArray, correction: OutputCorrection, plain: xr.DataArray | None
) -> xr.DataArray:
    """Return a statistic of the distribution function, at its corrected quantiles."""
    values, _, _ = correction.cdf.quantile(array[RANK].values)
    if BOUND not in array.dims:
        return array.copy(data=values)
    estimates = correction.estimates("cdf", values)
    if correction.problem(name):
        estimates = [Estimate.without_bounds(each.value, texts.NO_BAND_KNOWN) for each in estimates]
    share = correction.cdf.surrogate_share(values)
    return _with_estimates(array, estimates, share, correction, plain)


def _at_inputs(
    name: str, array: xr.DataArray, correction: OutputCorrection, plain: xr.DataArray | None
) -> xr.DataArray:
    """Return the indices of one variable, or of several, each corrected if that is possible."""
    found = correction.indices(name)
    inputs, problem = array.sizes[INPUT], correction.own_problem(name, _LEAST_Q2)
    figures = _own_figures(array)
    estimates: list[Estimate] = []
    for start, indices in zip(range(0, len(figures), inputs), found, strict=True):
        reason = indices if isinstance(indices, str) else ""
        of_variable = figures[start : start + inputs]
        own = _own_estimates(name, of_variable, reason, problem if reason else "")
        if isinstance(indices, str):
            estimates += own
        else:
            estimates += [
                each.with_note(each.note, old.note) for each, old in zip(indices, own, strict=True)
            ]
    estimates = _narrower_ones(estimates, plain, correction, is_index=True)
    own_values = array.values[..., 0]
    if all(isinstance(each, str) for each in found):
        none = np.full(own_values.shape, math.nan)
        return _corrected_array(array, estimates, none if problem else own_values, none)
    return _with_estimates(array, estimates, own_values, correction, plain)


def _uncorrected(name: str, array: xr.DataArray, reason: str, problem: str = "") -> xr.DataArray:
    """Return the surrogate's own figures without bounds; what is no number keeps its reason.

    With a problem, there are none.
    """
    if BOUND not in array.dims:
        return array
    own = np.full(array.shape[:-1], math.nan) if problem else array.values[..., 0]
    found = _own_estimates(name, _own_figures(array), reason, problem)
    return _corrected_array(array, found, own, np.full(own.shape, math.nan))


def _own_figures(array: xr.DataArray) -> list[tuple[float, str]]:
    """Return the surrogate's own figures of an estimate array, each with its note."""
    values, notes = array.values[..., 0], array.coords[NOTE].values
    return [*zip(values.ravel().tolist(), map(str, notes.ravel()), strict=True)]


def _own_estimates(
    name: str, figures: Sequence[tuple[float, str]], reason: str, problem: str
) -> list[Estimate]:
    """Return the surrogate's own figures as estimates without bounds; none with a problem."""
    keeps_note = name in CATALOGUE and CATALOGUE[name].note_is_of_estimate
    found = []
    for value, note in figures:
        if problem and not math.isnan(value):
            found.append(Estimate.without_bounds(math.nan, problem))
            continue
        reasons = (note,) if math.isnan(value) else (reason, note if keeps_note else "")
        found.append(Estimate.without_bounds(value, *reasons))
    return found


def narrower(found: Estimate, plain: Estimate, runs: CorrectionRuns, *, is_index: bool) -> Estimate:
    """Return a corrected estimate, with the interval of the runs alone where this is narrower.

    That interval has to hold the corrected estimate: else the two contradict each other, and the
    wider one stays. A surrogate that explains nothing has nothing to correct, so that the interval
    is that of the runs alone without a look at widths. Indices keep theirs if the surrogate
    explains less than half. So does all that missing runs or placed ones correct: the runs alone
    are then of another distribution, or fewer.

    Parameters
    ----------
    found, plain : Estimate
        The corrected one, and that of the runs alone.
    runs : CorrectionRuns
        Of the output.
    is_index : bool
        Whether they are of a sensitivity index.
    """
    width, plain_width = found.upper - found.lower, plain.upper - plain.lower
    is_other = bool(runs.missing or runs.placed) or math.isnan(plain_width)
    if is_other or "none" in (found.label, plain.label):
        return found
    is_narrower = math.isnan(width) or plain_width < width
    if is_index and is_narrower and runs.q2 < _LEAST_Q2:
        explained = texts.EXPLAINS_TOO_LITTLE.format(share=100 * max(runs.q2, 0.0))
        return found.with_note(found.note, texts.NARROWER_IF_SMOOTH, explained)
    if not is_narrower and (is_index or runs.q2 > 0):
        return found
    if not plain.lower <= found.value <= plain.upper:
        return found.with_note(found.note, texts.NARROWER_ELSEWHERE) if is_narrower else found
    notes = dict.fromkeys(("" if math.isnan(width) else found.note, plain.note))
    taken = replace(plain, value=found.value)
    return taken.with_note(*notes, texts.OF_RUNS_ALONE)


def _narrower_ones(
    estimates: Sequence[Estimate],
    plain: xr.DataArray | None,
    correction: OutputCorrection,
    *,
    is_index: bool,
) -> list[Estimate]:
    """Return estimates, each with the interval of the runs alone where this is narrower."""
    if plain is None or plain.size != 3 * len(estimates):
        return list(estimates)
    alone = EstimateVector.from_array(plain).each()
    pairs = zip(estimates, alone, strict=True)
    return [narrower(each, other, correction.runs, is_index=is_index) for each, other in pairs]


def _with_estimates(
    array: xr.DataArray,
    estimates: Sequence[Estimate],
    own: FloatArray,
    correction: OutputCorrection,
    plain: xr.DataArray | None,
) -> xr.DataArray:
    """Return corrected estimates as the estimate array of a statistic."""
    runs, placed = correction.runs.size, correction.runs.placed
    estimator = texts.CORRECTED_BY.format(estimator=array.attrs[ESTIMATOR], runs=runs)
    if placed:
        estimator += texts.PLACED_AMONG.format(placed=placed)
    found = array.assign_attrs({ESTIMATOR: estimator})
    return _corrected_array(found, estimates, own, _equivalent_runs(estimates, plain))


def _equivalent_runs(estimates: Sequence[Estimate], plain: xr.DataArray | None) -> FloatArray:
    """Return how many plain runs would give intervals as narrow, NaN where that is unknown."""
    width = np.array([estimate.upper - estimate.lower for estimate in estimates])
    if plain is None or plain.size != 3 * width.size:
        return np.full(width.shape, math.nan)
    _, lower, upper = plain.values.reshape(-1, 3).T
    with np.errstate(divide="ignore", invalid="ignore"):
        found = int(plain.attrs["runs_used"]) * ((upper - lower) / width) ** 2
    return np.where(np.isfinite(found), found, math.nan)


def _corrected_array(
    array: xr.DataArray, estimates: Sequence[Estimate], own: FloatArray, equivalent: FloatArray
) -> xr.DataArray:
    """Return an estimate array with other estimates, and what stands beside them."""
    dims = {str(dim): size for dim, size in array.sizes.items() if dim != BOUND}
    attributes = dict(array.attrs)
    level = attributes.pop(INTERVAL_LEVEL, LEVEL)
    kept = {
        str(key): each.variable for key, each in array.coords.items() if key not in INTERVAL_TEXTS
    }
    found = Estimate.array(
        estimates,
        dims,
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        coordinates=kept,
        level=level,
    )
    shape = tuple(dims.values())
    beside = {SURROGATE_ESTIMATE: own, EQUIVALENT_RUNS: equivalent}
    return found.assign_coords(
        {name: (tuple(dims), values.reshape(shape)) for name, values in beside.items()}
    ).assign_attrs(attributes)
