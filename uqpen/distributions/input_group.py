"""Interface of the joint distribution of several inputs, and its stand-in without code."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ModelError
from uqpen.core.files import FileSnapshot
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.unloaded import UnloadedDistribution

__all__ = ["ImplicitMarginal", "InputGroup", "UnloadedGroup"]


class InputGroup(ABC):
    """Joint distribution of several random inputs, which depend on each other.

    It maps points of the unit cube to values of its inputs. A point decides its values alone, so
    these do not depend on the other points of a design. The inputs outside the group are
    independent of it.
    """

    conditional_reason: ClassVar[str]
    """Why its inputs cannot be drawn given values of some of them, for a message."""

    inputs: tuple[str, ...]

    @property
    @abstractmethod
    def description(self) -> str:
        """Description in one line, for points and tables."""

    @property
    def marginals(self) -> tuple[Distribution, ...] | None:
        """Distribution of each input by itself; None where they are not known."""
        return None

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        """Files from which it follows."""
        return ()

    @abstractmethod
    def values(self, unit: FloatArray) -> FloatArray:
        """Map points of the unit cube to values of the inputs.

        Parameters
        ----------
        unit : ndarray, shape (run, input)
            Independent probabilities, strictly between 0 and 1.

        Returns
        -------
        ndarray, shape (run, input)
            In SI units. Uniform points give draws of the joint distribution.
        """

    @abstractmethod
    def nominal(self) -> tuple[float, ...]:
        """Return one value of each input, which together lie in the middle of the distribution."""

    def __str__(self) -> str:
        return f"{self.description} of {', '.join(self.inputs)}"


@dataclass(frozen=True)
class ImplicitMarginal(Distribution):
    """Distribution of one input of a group that is known by its draws alone.

    Parameters
    ----------
    name : str
        The group, for a message.
    nominal : float
        Nominal value of the input, in its SI unit.
    """

    name: str
    nominal: float

    @property
    def median(self) -> float:
        """Nominal value of the input in its group."""
        return self.nominal

    def ppf(self, probability: FloatArray) -> FloatArray:
        raise self._error()

    def isf(self, probability: FloatArray) -> FloatArray:
        raise self._error()

    def cdf(self, value: FloatArray) -> FloatArray:
        raise self._error()

    def sf(self, value: FloatArray) -> FloatArray:
        raise self._error()

    def _error(self) -> ModelError:
        return ModelError(f"{self.name} is known by its draws alone, not by those of one input")


@dataclass(frozen=True)
class UnloadedGroup(InputGroup):
    """Group known by its name only: an object of a program that is not here."""

    conditional_reason = "its joint distribution is not loaded"

    inputs: tuple[str, ...]
    name: str

    @property
    def description(self) -> str:
        return self.name

    @property
    def marginals(self) -> tuple[Distribution, ...]:
        return (UnloadedDistribution(self.name),) * len(self.inputs)

    def values(self, unit: FloatArray) -> FloatArray:
        raise ModelError(f"{self.name} is not loaded: it has no values without --trust")

    def nominal(self) -> tuple[float, ...]:
        raise ModelError(f"{self.name} is not loaded: it has no values without --trust")
