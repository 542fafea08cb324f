"""What a distribution of an input is.

Both tails have a function each, so that a law truncated far out keeps its accuracy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from uqpen.errors import Problem, SettingsError
from uqpen.settings import validate

__all__ = ["OPEN", "Distribution", "order_problem"]

FloatArray = npt.NDArray[np.float64]

# Generators give 0 now and then, and rounding 1, where the quantile of a law may be infinite: so
# draws are taken from half a step of the generator inside.
OPEN = (2.0**-54, 1 - 2.0**-53)


class Distribution(ABC):
    """A continuous law of one variable; probabilities go in and out as arrays of any shape.

    A subclass is a frozen dataclass of its parameters, in SI units.
    """

    def __init_subclass__(cls) -> None:
        # Far out, the formulas overflow on their way to 0, to 1 or to an end of the law.
        for name in ("quantile", "exceeded", "below", "above"):
            if name in vars(cls):
                setattr(cls, name, np.errstate(all="ignore")(vars(cls)[name]))

    def __post_init__(self) -> None:
        validate(self, self.disorder())

    def disorder(self) -> Iterator[Problem]:
        """What is wrong between parameters that are right by themselves."""
        yield from ()

    @abstractmethod
    def quantile(self, probability: FloatArray) -> FloatArray:
        """The value below which the law lies with the given probability."""

    @abstractmethod
    def exceeded(self, probability: FloatArray) -> FloatArray:
        """The value above which the law lies with the given probability."""

    @abstractmethod
    def below(self, value: FloatArray) -> FloatArray:
        """Probability of lying below a value."""

    @abstractmethod
    def above(self, value: FloatArray) -> FloatArray:
        """Probability of lying above a value."""

    @property
    def is_finite(self) -> bool:
        """Whether every draw is a finite number."""
        try:
            ends = self.quantile(np.array([OPEN[0], 0.5, OPEN[1]]))
        except (ArithmeticError, SettingsError):
            return False  # parameters so large or small that the formulas overflow
        return bool(np.isfinite(ends).all() and ends[0] < ends[-1])

    @property
    def median(self) -> float:
        """The value that is exceeded as often as not."""
        return float(self.quantile(np.array(0.5)))


def order_problem(lower: float, upper: float) -> Iterator[Problem]:
    """The problem of two ends in the wrong order, if they are."""
    if not lower < upper:
        yield Problem(("upper",), f"{upper:g}", "a value above lower")
