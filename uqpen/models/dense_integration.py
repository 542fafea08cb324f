"""Many independent initial value problems side by side, with their solutions between the steps.

The method is DOP853, as SciPy has it: of order 8, with an interpolant of order 7. Each problem has
a step of its own, so its solution has the same bits whatever else is in the batch. Sums have a
fixed order for the same reason: BLAS would add by the size of a batch.

References
----------
Hairer, E., Nørsett, S. P. & Wanner, G. (1993). Solving Ordinary Differential Equations I, sections
II.5 and II.6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.models import dop853

# Slopes of states of shape (variable, problem), given constants of shape (constant, problem).
Slopes = Callable[[FloatArray, FloatArray], FloatArray]
# Whether states of shape (variable, problem), given their constants, meet a condition.
Condition = Callable[[FloatArray, FloatArray], BoolArray]

# Attempts at most, after which a problem is given up.
MOST_STEPS = 16_000

# A step this much shorter than the time so far makes no progress.
_SHORTEST = 1e-14
# As SciPy's steps grow and shrink.
_SAFETY, _LARGEST_FALL, _LARGEST_RISE = 0.9, 0.2, 10.0
_TINY = np.finfo(float).tiny
# Secants at most to a value inside a step, which takes six as a rule, and its precision.
_MOST_SECANTS, _ROUNDING = 60, np.finfo(float).eps


class Steps(NamedTuple):
    """One step each of some of the problems."""

    problem: IntArray  # (step,): position in the batch; ascending
    is_last: BoolArray  # (step,): true where the problem ends in this step
    start: FloatArray  # (step,): time where the step begins
    size: FloatArray  # (step,): its length
    before: FloatArray  # (variable, step): states where it begins
    after: FloatArray  # (variable, step): states where it ends
    terms: FloatArray  # (term, variable, step): of the interpolant

    def states(self, step: IntArray, part: FloatArray) -> FloatArray:
        """Return states inside steps, shape (variable, place).

        A part of a step, from 0 to 1, has passed at each place.
        """
        return _interpolate(self.before[:, step], self.terms[..., step], part)

    def parts_at(self, step: IntArray, variable: int, values: FloatArray) -> FloatArray:
        """Return the part of each step after which a variable has a value (Illinois method).

        The values lie between those at the ends of the step.
        """
        start, terms = self.before[variable, step], self.terms[:, variable, step]
        return _root(
            lambda part: _interpolate(start, terms, part) - values,
            start - values,
            self.after[variable, step] - values,
            _ROUNDING * (np.abs(start) + np.abs(values)),
        )

    def root_parts(self, step: IntArray, value: Callable[[FloatArray], FloatArray]) -> FloatArray:
        """Return the part of each step after which a value of the states is 0.

        The values of states, of shape (variable, step), are about 1 in size, and differ in sign at
        the ends of each step.
        """
        return _root(
            lambda part: value(self.states(step, part)),
            value(self.before[:, step]),
            value(self.after[:, step]),
            np.full(step.size, 4 * _ROUNDING),
        )


def integrate(
    slopes: Slopes,
    start: FloatArray,
    constants: FloatArray,
    scales: FloatArray,
    is_past: Condition,
    tolerance: float,
) -> Iterator[Steps]:
    """Integrate a batch of problems until each is past its end, and yield the steps in order.

    A problem that makes no progress, or takes `MOST_STEPS`, is given up: none of its steps is the
    last.

    Parameters
    ----------
    slopes : callable
        Slopes in time of states, given their constants.
    start : ndarray, shape (variable, problem)
        States at time 0.
    constants : ndarray, shape (constant, problem)
        What the slopes take besides.
    scales : ndarray, shape (variable, problem)
        Sizes of the variables.
    is_past : callable
        Whether states are past the end of their problem, given its constants.
    tolerance : float
        Error allowed to a step, relative to a variable, and to a hundredth of its scale.
    """
    slope = slopes(start, constants)
    # The first step to try, which need not be a good one.
    fastest: FloatArray = np.max(np.abs(slope / scales), axis=0)
    first = tolerance**0.125 * 0.1 / fastest
    problems = np.arange(start.shape[1])
    batch = _Batch(problems, np.zeros(first.shape), first, start, slope, constants, scales)
    for _ in range(MOST_STEPS):
        if not batch.problem.size:
            return
        stages, after = _try_step(slopes, batch)
        error = _relative_error(stages, after, batch, tolerance)
        is_taken = error < 1
        is_over = is_taken & is_past(after, batch.constants)
        taken = np.flatnonzero(is_taken)
        if taken.size:
            steps, ends = batch.select(taken), after[:, taken]
            terms = _terms(slopes, [stage[:, taken] for stage in stages], ends, steps)
            yield Steps(
                steps.problem, is_over[taken], steps.time, steps.size, steps.state, ends, terms
            )
        # The eighth root, which is the same on all processors.
        root = np.sqrt(np.sqrt(np.sqrt(np.maximum(error, _TINY))))
        moved = batch._replace(
            time=np.where(is_taken, batch.time + batch.size, batch.time),
            size=batch.size * np.clip(_SAFETY / root, _LARGEST_FALL, _LARGEST_RISE),
            state=np.where(is_taken, after, batch.state),
            slope=np.where(is_taken, stages[-1], batch.slope),
        )
        batch = moved.select(np.flatnonzero(~is_over & (moved.size > _SHORTEST * moved.time)))


class _Batch(NamedTuple):
    """The problems that have not ended; the last axis of each array is theirs."""

    problem: IntArray
    time: FloatArray
    size: FloatArray
    state: FloatArray
    slope: FloatArray
    constants: FloatArray
    scales: FloatArray

    def select(self, which: IntArray) -> _Batch:
        """Return some of the problems."""
        return _Batch._make(each[..., which] for each in self)


def _try_step(slopes: Slopes, batch: _Batch) -> tuple[list[FloatArray], FloatArray]:
    """Return the slopes at all stages of a step, the last at its end, and the states there."""
    stages = [batch.slope]
    for weights in dop853.STAGES:
        moved = batch.state + batch.size * _weighted_sum(weights, stages)
        stages.append(slopes(moved, batch.constants))
    after = batch.state + batch.size * _weighted_sum(dop853.SOLUTION, stages)
    stages.append(slopes(after, batch.constants))
    return stages, after


def _relative_error(
    stages: list[FloatArray], after: FloatArray, batch: _Batch, tolerance: float
) -> FloatArray:
    """Return the error of a step, relative to the allowed one; infinite where it is no number."""
    size = np.maximum(np.abs(batch.state), np.abs(after))
    allowed = tolerance * (size + 1e-2 * batch.scales)
    fifth = ((_weighted_sum(dop853.ERROR_5, stages) / allowed) ** 2).mean(axis=0)
    third = ((_weighted_sum(dop853.ERROR_3, stages) / allowed) ** 2).mean(axis=0)
    error = batch.size * fifth / np.sqrt(np.maximum(fifth + 0.01 * third, _TINY))
    return np.where(np.isfinite(error), error, np.inf)


def _terms(
    slopes: Slopes, stages: list[FloatArray], after: FloatArray, batch: _Batch
) -> FloatArray:
    """Return the terms of the interpolant of a step."""
    for weights in dop853.FURTHER:
        moved = batch.state + batch.size * _weighted_sum(weights, stages)
        stages.append(slopes(moved, batch.constants))
    change = after - batch.state
    first, last = batch.size * stages[0], batch.size * stages[len(dop853.SOLUTION)]
    further = (batch.size * _weighted_sum(weights, stages) for weights in dop853.INTERPOLANT)
    return np.stack([change, first - change, 2 * change - first - last, *further])


def _root(
    value: Callable[[FloatArray], FloatArray],
    at_old: FloatArray,
    at_new: FloatArray,
    rounding: FloatArray,
) -> FloatArray:
    """Return the part of each step at which a value is 0, given its values at both ends."""
    old, new = np.zeros(at_old.size), np.ones(at_old.size)
    for _ in range(_MOST_SECANTS):
        is_found = np.abs(at_new) <= rounding
        if is_found.all():
            break
        with np.errstate(invalid="ignore", divide="ignore"):
            secant = new - at_new * (new - old) / (at_new - at_old)
        # One that is found stays, as it would alone.
        part = np.where(is_found, new, secant)
        found = value(part)
        is_passed = found * at_new < 0
        old, at_old = np.where(is_passed, new, old), np.where(is_passed, at_new, at_old / 2)
        new, at_new = part, found
    return new


def _interpolate(before: FloatArray, terms: FloatArray, part: FloatArray) -> FloatArray:
    """Return states where a part of a step has passed."""
    rest = 1 - part
    total = np.zeros_like(before)
    for number in reversed(range(len(terms))):
        total = (total + terms[number]) * (rest if number % 2 else part)
    return before + total


def _weighted_sum(weights: Sequence[float], arrays: list[FloatArray]) -> FloatArray:
    """Return a weighted sum of arrays of one shape; there may be more weights than arrays."""
    total = np.zeros_like(arrays[0])
    for weight, array in zip(weights, arrays, strict=False):
        if weight:
            total += weight * array
    return total
