"""Elementary effects: changes of an output with one input, at random points of the inputs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import BLOCK_NUMBER, CONDITIONAL, MOVED_BY, MOVED_INPUT, POSITION, STATUS
from uqpen.core.status import Status
from uqpen.designs.moves import moved_input_numbers
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.input_measures import input_array

__all__ = ["effects_by_input", "elementary_effects", "mean_effect"]


# With fewer effects the coverage in simulations was 89 % to 100 %, else 93 % to 98 %.
_FEWEST_EFFECTS = 10
# With fewer effects that differ from all the others, a coverage of 84 % occurred.
_FEWEST_DISTINCT = 5

# Differences of outputs are exact to this, relative to the largest.
_ROUNDING = 1e-12


def elementary_effects(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Mean, mean absolute value and standard deviation of each input's elementary effects.

    An effect is the change of the output divided by the change of the input's probability. A
    change of 1 in probability spans the whole distribution of the input. An effect is computed
    from a pair of runs, so a failed run removes at most the two effects of the steps next to it.

    Yields
    ------
    name : str
        ``mu``: mean; ``mu_star``: mean of the absolute effects; ``sigma``: standard deviation.
    estimate : DataArray
        Along ``input`` and ``bound``.

    References
    ----------
    Campolongo, F., Cariboni, J. & Saltelli, A. (2007). Environ. Model. Softw. 22, 1509-1518.
    """
    if quantity.output.categories:
        return
    name, title = quantity.output.name, quantity.output.title
    effects, level = effects_by_input(runs, name), quantity.confidence_level
    missing = texts.ABSENT_EFFECTS if CONDITIONAL in runs.attrs else texts.MISSING_EFFECTS
    measures: tuple[tuple[str, Callable[[FloatArray], Estimate], str], ...] = (
        ("mu", partial(mean_effect, level=level), "mean elementary effect"),
        (
            "mu_star",
            lambda found: mean_effect(np.abs(found), level),
            "mean absolute elementary effect",
        ),
        ("sigma", _sigma, "standard deviation of the elementary effects"),
    )
    for measure, estimator, long_name in measures:
        estimates = [
            _note_missing_effects(estimator(found[np.isfinite(found)]), found, missing)
            for found in effects.values()
        ]
        long_name = f"{long_name} on {title}, for the whole of an input's probability"
        units = quantity.output.unit
        yield measure, input_array(estimates, [*effects], long_name, units=units, level=level)


def effects_by_input(runs: xr.Dataset, name: str) -> dict[str, FloatArray]:
    """Return every input's effects; NaN where one of the two runs failed."""
    order = np.lexsort((runs[POSITION].values, runs[BLOCK_NUMBER].values))
    values = np.where(runs[STATUS].values == Status.OK, runs[name].values, np.nan)[order]
    moved = runs[MOVED_INPUT].values[order]
    by = runs[MOVED_BY].values[order]
    # The first run of a trajectory comes after a run of another.
    steps = np.flatnonzero(moved >= 0)
    effects = (values[steps] - values[steps - 1]) / by[steps]
    return {
        entry: effects[moved[steps] == number]
        for entry, number in moved_input_numbers(runs).items()
    }


def mean_effect(effects: FloatArray, level: float = LEVEL) -> Estimate:
    """Estimate the mean of an input's effects, or of their absolute values, one a trajectory."""
    if not effects.size:
        return Estimate.without_bounds(math.nan, texts.NO_EFFECT)
    mean = float(effects.mean())
    if effects.size == 1:
        return Estimate.without_bounds(mean, texts.SINGLE_EFFECT)
    largest = float(np.abs(effects).max())
    # Effects that differ by less than the 12th digit differ by rounding only.
    _, counts = np.unique(np.round(effects / (largest or 1.0), 12), return_counts=True)
    distinct = effects.size - int(counts.max())
    if not distinct:
        return Estimate.without_bounds(mean, texts.NO_SCATTER_OF_EFFECTS)
    half = student_quantile(effects.size - 1, level) * _deviation(effects)
    half /= math.sqrt(effects.size)
    estimate = Estimate(mean, mean - half, mean + half, texts.STUDENT_OVER_TRAJECTORIES, "nominal")
    if effects.size < _FEWEST_EFFECTS:
        return estimate.with_note(texts.ONLY_EFFECTS.format(effects=effects.size))
    if distinct < _FEWEST_DISTINCT:
        few = texts.FEW_DIFFER.format(distinct=distinct, effects=effects.size)
        return estimate.with_note(few)
    return estimate


def _sigma(effects: FloatArray) -> Estimate:
    if effects.size < 2:
        return Estimate.without_bounds(math.nan, texts.TOO_FEW_EFFECTS)
    std = _deviation(effects)
    # The standard deviation of equal effects can differ from 0 by rounding.
    is_rounding = std <= _ROUNDING * float(np.abs(effects).max())
    return Estimate.without_bounds(0.0 if is_rounding else std, texts.NO_INTERVAL)


def _note_missing_effects(estimate: Estimate, effects: FloatArray, text: str) -> Estimate:
    """Return the estimate with a note of the number of missing effects, by its text."""
    failed = int(np.isnan(effects).sum())
    if not failed:
        return estimate
    return estimate.with_note(estimate.note, text.format(failed=failed, effects=effects.size))


def _deviation(effects: FloatArray) -> float:
    """Standard deviation of effects, scaled so that their squares do not overflow."""
    largest = float(np.abs(effects).max()) or 1.0
    # A power of two, so that no digit changes.
    is_extreme = not 1e-100 < largest < 1e100
    unit = 2.0 ** (math.frexp(largest)[1] - 1) if is_extreme else 1.0
    return float((effects / unit).std(ddof=1)) * unit
