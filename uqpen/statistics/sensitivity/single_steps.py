"""Effects of single steps of an input: elementary effects, and responses at the nominal point."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    BLOCK_NUMBER,
    CONDITIONAL,
    MOVED_BY,
    MOVED_INPUT,
    MOVED_UNCERTAINTY,
    POSITION,
    RELATIVE_TO_SPREAD,
    RUN,
    STATUS,
)
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.designs.one_at_a_time import moved_input_numbers
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate, NamedArrays
from uqpen.statistics.fields.field_sample import joined_places
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.input_measures import input_array

# Elementary effects: changes of an output with one input, at random points of the inputs.

# With fewer effects the coverage in simulations was 89 % to 100 %, else 93 % to 98 %.
_FEWEST_EFFECTS = 10
# With fewer effects that differ from all the others, a coverage of 84 % occurred.
_FEWEST_DISTINCT = 5

# Differences of outputs are exact to this, relative to the largest.
_ROUNDING = 1e-12


def elementary_effects(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
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
    measures: dict[str, tuple[Callable[[FloatArray], Estimate], str]] = {
        "mu": (partial(mean_effect, level=level), "mean elementary effect"),
        "mu_star": (
            lambda found: mean_effect(np.abs(found), level),
            "mean absolute elementary effect",
        ),
        "sigma": (_sigma, "standard deviation of the elementary effects"),
    }
    for measure, (estimator, meaning) in measures.items():
        estimates = []
        for found in effects.values():
            failed = int(np.isnan(found).sum())
            note = missing.format(failed=failed, effects=found.size) if failed else ""
            estimates.append(estimator(found[np.isfinite(found)]).with_note(note))
        long_name = f"{meaning} on {title}, for the whole of an input's probability"
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


def _deviation(effects: FloatArray) -> float:
    """Standard deviation of effects, scaled so that their squares do not overflow."""
    largest = float(np.abs(effects).max()) or 1.0
    # A power of two, so that no digit changes.
    is_extreme = not 1e-100 < largest < 1e100
    unit = 2.0 ** (math.frexp(largest)[1] - 1) if is_extreme else 1.0
    return float((effects / unit).std(ddof=1)) * unit


# Responses: by how much an output changes with each input, at the nominal point.

# Difference of the derivatives of the steps up and down, relative to the larger one, above which a
# note states it.
_CURVED = 0.1


def relative_responses(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Relative derivatives of an output, and contributions of the inputs to its uncertainty.

    Yields
    ------
    name : str
        ``response``: relative change of the output divided by that of the input, by the
        differences of the design; ``contribution``: absolute response times the input's standard
        deviation divided by its nominal value; ``change_per_std``: change of the output with one
        standard deviation of the input, for an output that is shown in a unit with an offset.
    estimate : DataArray
        Along ``input`` and ``bound``, without bounds.

    Notes
    -----
    Relative changes are of SI values. In a unit with an offset, such as degC, they are of the
    kelvin, and a note says so. A change per standard deviation depends on no zero. It is the
    uncertainty component of the Guide to the Expression of Uncertainty in Measurement
    (JCGM 100:2008, 5.1.3), with its sign. For an output in another unit it follows from the
    contribution.
    """
    if quantity.output.categories:
        return
    output, title = quantity.output, quantity.output.title
    steps = {
        entry: _Steps.from_runs(runs, output.name, entry, number)
        for entry, number in moved_input_numbers(runs).items()
    }
    of_output = _offset_note("output", output.unit, quantity.display_unit)
    responses, contributions = [], []
    for entry, each in steps.items():
        response = each.response()
        units = runs[entry].attrs
        si = str(units.get("units", DIMENSIONLESS))
        of_input = _offset_note("input", si, str(units.get("display_units", si)))
        responses.append(_relative(response, of_output, of_input))
        contribution = Estimate.without_bounds(abs(response.value) * each.std, response.note)
        if not each.std:
            contribution = Estimate.without_bounds(math.nan, texts.FIXED_INPUT)
        contributions.append(_relative(contribution, of_output))
    yield "response", input_array(responses, [*steps], f"relative response of {title}")
    long_name = f"contribution to the relative uncertainty of {title}"
    yield "contribution", input_array(contributions, [*steps], long_name)
    if of_output:
        long_name = f"change of {title} per standard deviation of an input"
        changes = [each.change() for each in steps.values()]
        yield "change_per_std", input_array(changes, [*steps], long_name, units=output.unit)


def _relative(estimate: Estimate, *notes: str) -> Estimate:
    """Return a relative change with notes on what it is relative to, unless there is no value."""
    return estimate if math.isnan(estimate.value) else estimate.with_note(*notes)


def _offset_note(of: str, si: str, unit: str) -> str:
    """Return a note on relative changes of what is shown in a unit with an offset; else empty."""
    return texts.OF_SI_VALUE.format(of=of, si=si, unit=unit) if scale(unit).offset else ""


@dataclass(frozen=True)
class _Steps:
    """An output at the nominal point and at the steps of an input; NaN for no completed run."""

    nominal: float
    down: float
    up: float
    by: float  # the step, relative to the reference of the input
    is_one_sided: bool  # whether the design has one of the steps alone
    std: float  # of the input, relative to the magnitude of that reference; 0 if it is fixed
    sign: float  # of that reference
    is_of_spread: bool  # whether the reference is not the nominal value
    lacks_values: bool  # whether completed runs have no value: NaN is then no failure

    @classmethod
    def from_runs(cls, runs: xr.Dataset, name: str, entry: str, number: int) -> _Steps:
        """Return the steps of an input, which has a number among the moved ones."""
        values = np.where(runs[STATUS].values == Status.OK, runs[name].values, np.nan)
        moved, by = runs[MOVED_INPUT].values, runs[MOVED_BY].values
        of_input, inputs = moved == number, runs[entry].values
        nominal, steps = moved < 0, sorted(by[of_input].tolist())
        at = {step: float(values[of_input & (by == step)][0]) for step in steps}
        change = inputs[of_input & (by == steps[-1])][0] - inputs[nominal][0]
        return cls(
            float(values[nominal][0]),
            at.get(-abs(steps[0]), math.nan),
            at.get(abs(steps[0]), math.nan),
            abs(steps[0]),
            len(steps) == 1,
            float(runs[MOVED_UNCERTAINTY].values[of_input][0]),
            math.copysign(1.0, float(change) * steps[-1]),
            entry in str(runs[MOVED_BY].attrs.get(RELATIVE_TO_SPREAD, "")).split(),
            CONDITIONAL in runs.attrs,
        )

    def response(self) -> Estimate:
        """Return the relative change of the output divided by that of the input."""
        if math.isnan(self.nominal):
            return self._none(texts.NOMINAL_RUN_ABSENT, texts.NOMINAL_RUN_FAILED)
        if not self.nominal:
            return Estimate.without_bounds(math.nan, texts.NOMINAL_OUTPUT_IS_0)
        down, up = self.down / self.nominal - 1, self.up / self.nominal - 1
        found = self._derivative(-down / self.by, up / self.by, texts.NONLINEAR)
        is_of_spread = self.is_of_spread and not math.isnan(found.value)
        return found.with_note(texts.OF_HALF_SPREAD if is_of_spread else "")

    def change(self) -> Estimate:
        """Return the derivative of the output times the standard deviation of the input."""
        if math.isnan(self.nominal):
            return self._none(texts.NOMINAL_RUN_ABSENT, texts.NOMINAL_RUN_FAILED)
        if not self.std:
            return Estimate.without_bounds(math.nan, texts.FIXED_INPUT)
        # A step is relative to the nominal value, which may be below 0.
        per_step = self.sign * self.std
        return self._derivative(
            (self.nominal - self.down) / self.by * per_step,
            (self.up - self.nominal) / self.by * per_step,
            texts.NONLINEAR_CHANGE,
        )

    def _derivative(self, down: float, up: float, nonlinear: str) -> Estimate:
        """Return the mean of the slopes to either side, or the one that there is, with notes."""
        if math.isfinite(down) and math.isfinite(up):
            is_curved = abs(up - down) > _CURVED * max(abs(up), abs(down))
            note = nonlinear.format(down=down, up=up) if is_curved else ""
            return Estimate.without_bounds((down + up) / 2, texts.ONE_POINT, note)
        side, value = ("up", up) if math.isfinite(up) else ("down", down)
        if math.isnan(value):
            return self._none(texts.STEP_ABSENT, texts.STEP_FAILED)
        note = texts.ONE_SIDED_STEP_ABSENT if self.lacks_values else texts.ONE_SIDED_STEP
        note = texts.ONE_SIDED_DESIGN if self.is_one_sided else note
        return Estimate.without_bounds(value, texts.ONE_POINT, note.format(side=side))

    def _none(self, absent: str, failed: str) -> Estimate:
        """Return no estimate, for want of the output at some of the points."""
        return Estimate.without_bounds(math.nan, absent if self.lacks_values else failed)


# The same at each place of a field.

DesignAnalysis = Callable[[xr.Dataset, QuantityOfInterest], NamedArrays]


def effects_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Mean, mean absolute value and standard deviation of elementary effects at each place."""
    yield from _at_places(elementary_effects, runs, quantity)


def responses_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Relative responses and contributions at each place, in some units changes, too."""
    yield from _at_places(relative_responses, runs, quantity)


def _at_places(
    analysis: DesignAnalysis, runs: xr.Dataset, quantity: QuantityOfInterest
) -> NamedArrays:
    """Apply the analysis of a design at each place; a run without a value there has failed."""
    output = quantity.output
    scalar = replace(quantity, output=replace(output, dims=(), may_end=False))
    values = runs[output.name].values.reshape(runs.sizes[RUN], -1)
    others = [name for name, each in runs.data_vars.items() if each.dims != (RUN,)]
    bare = runs.drop_vars(others)
    found: dict[str, list[xr.DataArray]] = {}
    for place in values.T:
        for name, array in analysis(bare.assign({output.name: (RUN, place)}), scalar):
            found.setdefault(name, []).append(array)
    for name, arrays in found.items():
        yield name, joined_places(arrays, output)
