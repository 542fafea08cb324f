"""Draws from a joint distribution, conditional on some inputs and on being admissible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import Evaluator

__all__ = ["ConditionalDraws", "ConditionalSample"]

# Number of redraws after which a draw that is still inadmissible is left out.
_MOST_REDRAWS = 100

_NO_VALUES: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class ConditionalSample:
    """Draws of all inputs.

    Parameters
    ----------
    points : ndarray, shape (run, random input)
        As probabilities.
    inputs : mapping of str to ndarray, shape (run,)
        In SI units. Some rows may be inadmissible for want of a better draw.
    """

    points: FloatArray
    inputs: dict[str, FloatArray]


@dataclass(frozen=True)
class ConditionalDraws:
    """Joint distribution to draw from, conditional on some inputs and on being admissible.

    Parameters
    ----------
    evaluator : Evaluator
        A model with the constraints of the joint distribution. It knows what is admissible.
    joint : JointDistribution
    given : mapping of str to float
        Values of fixed inputs that replace those of the joint distribution.
    stream : Stream
        Source of the random numbers of redraws.
    """

    evaluator: Evaluator
    joint: JointDistribution
    given: Mapping[str, float]
    stream: Stream

    def draw(
        self,
        unit: FloatArray,
        shared: Mapping[int, FloatArray],
        purpose: str,
        values: Mapping[str, FloatArray] = _NO_VALUES,
    ) -> ConditionalSample:
        """Draw the inputs given some of them.

        An inadmissible draw is drawn again from the distribution conditional on the shared inputs,
        until it is admissible (rejection sampling). The result is a draw conditional on both.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Points of the unit cube; the columns of shared inputs are ignored.
        shared : mapping of int to ndarray, shape (run,)
            Probabilities of the shared inputs, by position.
        purpose : str
            Name of the stream of redraws.
        values : mapping of str to ndarray, shape (run,)
            Values of shared inputs, where these are known to the bit.
        """
        points = self.joint.conditional_probabilities(unit, shared)
        inputs = self._inputs(points) | dict(values)
        is_open = self._is_inadmissible(inputs)
        for number in range(_MOST_REDRAWS):
            rows = np.flatnonzero(is_open)
            if not rows.size:
                break
            fresh = self.stream.generator(purpose, number).random((rows.size, unit.shape[1]))
            some = {i: column[rows] for i, column in shared.items()}
            points[rows] = self.joint.conditional_probabilities(fresh, some)
            again = self._inputs(points[rows])
            again |= {name: column[rows] for name, column in values.items()}
            is_open[rows] = self._is_inadmissible(again)
            for name, column in again.items():
                inputs[name][rows] = column
        return ConditionalSample(points, inputs)

    def probabilities(self, values: Mapping[str, FloatArray], unit: FloatArray) -> FloatArray:
        """Return probabilities of given values of the random inputs, shape (run, random input).

        A value with a probability of its own has any one within its step. Draws that share the
        value, and not the step's part, have their own.

        Parameters
        ----------
        values : mapping of str to ndarray, shape (run,)
        unit : ndarray, shape (run, random input)
            Where in its step each one is, from 0 to 1.
        """
        columns = []
        for entry, part in zip(self.joint.random, unit.T, strict=True):
            value = values[entry.variable.name]
            before, at = map(entry.distribution.cdf, (np.nextafter(value, -np.inf), value))
            columns.append(before + part * (at - before))
        return np.column_stack(columns)

    def _inputs(self, points: FloatArray) -> dict[str, FloatArray]:
        fixed = {entry.variable.name: entry.value for entry in self.joint.fixed} | {**self.given}
        columns = {name: np.full(len(points), value) for name, value in fixed.items()}
        return columns | {name: np.array(each) for name, each in self.joint.ppf(points).items()}

    def _is_inadmissible(self, inputs: dict[str, FloatArray]) -> BoolArray:
        found = np.zeros(len(next(iter(inputs.values()))), dtype=np.bool_)
        for violated, _ in self.evaluator.violations(inputs):
            found |= violated
        return found
