"""Dependence between random inputs: copulas, as maps of the unit cube onto itself.

A copula is the joint distribution of the inputs' probabilities, apart from the distribution of
each. The inverse of Rosenblatt's transformation turns points of the unit cube whose coordinates
are independent into points that follow the copula: each coordinate in turn is the quantile of its
conditional distribution given those before.

Rosenblatt, M. (1952). Ann. Math. Stat. 23, 470-472.
"""

from __future__ import annotations

import functools
import operator
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.settings import validate
from uqpen.distributions.distribution import OPEN_INTERVAL

__all__ = ["Dependence", "sum_columns"]

_NONE_GIVEN: Mapping[int, FloatArray] = MappingProxyType({})


class Dependence(ABC):
    """Copula over some of the random inputs.

    A subclass is a frozen dataclass of its parameters. The first one is ``inputs``, the names of
    the inputs that it joins. It works on *scores*: the function of the probabilities in which its
    formulas are simplest. Every formula treats each run by itself, in a fixed number of steps, so
    that the point of a run does not depend on the other runs computed with it.
    """

    inputs: tuple[str, ...]

    def __post_init__(self) -> None:
        if problems := list(self._check_input_names()):
            raise SettingsError(problems)
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between parameters that are valid by themselves."""
        yield from ()

    def __str__(self) -> str:
        return f"{self.title} of {', '.join(self.inputs)}: {self.description}"

    @property
    def title(self) -> str:
        """Name for display."""
        return f"{type(self).__name__.removesuffix('Copula').lower()} copula"

    @property
    @abstractmethod
    def description(self) -> str:
        """Parameters in one line."""

    @abstractmethod
    def score(self, probability: FloatArray) -> FloatArray:
        """Convert probabilities to scores, element by element."""

    @abstractmethod
    def probability(self, score: FloatArray) -> FloatArray:
        """Convert scores to probabilities."""

    @abstractmethod
    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        """Return the conditional quantile of one input's score, given the scores of others.

        Parameters
        ----------
        position : int
            Position in `inputs`.
        probability : ndarray, shape (run,)
            Strictly between 0 and 1.
        known : mapping of int to ndarray, shape (run,)
            The scores of other inputs, by position; at least one.
        """

    def inverse_rosenblatt(
        self, unit: FloatArray, given: Mapping[int, FloatArray] = _NONE_GIVEN
    ) -> FloatArray:
        """Map points with independent coordinates to points that follow the copula.

        Parameters
        ----------
        unit : ndarray, shape (run, input)
            Independent probabilities; the columns of given inputs are ignored.
        given : mapping of int to ndarray, shape (run,)
            The probabilities of given inputs, by position; the copula is then conditional on them.

        Returns
        -------
        ndarray, shape (run, input)
            Given columns are unchanged, or else the first. Without given inputs, each column is
            uniform by itself.
        """
        points = np.clip(unit, *OPEN_INTERVAL)
        for position, column in given.items():
            points[:, position] = np.clip(column, *OPEN_INTERVAL)
        known = {position: self.score(points[:, position]) for position in sorted(given)}
        for position in range(len(self.inputs)):
            if not known:
                known[position] = self.score(points[:, position])
            elif position not in known:
                known[position] = self.conditional_score(position, points[:, position], known)
                points[:, position] = np.clip(self.probability(known[position]), *OPEN_INTERVAL)
        return points

    def _check_input_names(self) -> Iterator[Problem]:
        if len(self.inputs) < 2:
            yield Problem(("inputs",), f"{len(self.inputs)} inputs", "at least two, to be joined")
        for position, name in enumerate(self.inputs):
            if name in self.inputs[:position]:
                yield Problem(("inputs", position), f'"{name}" twice', "each input once")


def sum_columns(columns: Mapping[int, FloatArray]) -> FloatArray:
    """Sum columns in the order of their positions, run by run.

    A sum over an axis of an array may go in another order where the array has another shape.
    """
    return functools.reduce(operator.add, [columns[position] for position in sorted(columns)])
