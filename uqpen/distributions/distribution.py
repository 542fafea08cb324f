"""What a distribution of an input is.

Both tails have a function each, so that a law truncated far out keeps its accuracy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from uqpen.core.errors import Problem, SettingsError
from uqpen.core.settings import validate

__all__ = ["OPEN_INTERVAL", "Distribution", "order_problem"]

FloatArray = npt.NDArray[np.float64]

# Generators give 0 now and then, and rounding 1, where the quantile of a law may be infinite: so
# draws are taken from half a step of the generator inside.
OPEN_INTERVAL = (2.0**-54, 1 - 2.0**-53)


class Distribution(ABC):
    """A continuous law of one variable; probabilities go in and out as arrays of any shape.

    A subclass is a frozen dataclass of its parameters, in SI units.
    """

    def __init_subclass__(cls) -> None:
        # Far out, the formulas overflow on their way to 0, to 1 or to an end of the law.
        for name in ("ppf", "isf", "cdf", "sf"):
            if name in vars(cls):
                setattr(cls, name, np.errstate(all="ignore")(vars(cls)[name]))

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """What is wrong between parameters that are right by themselves."""
        yield from ()

    @abstractmethod
    def ppf(self, probability: FloatArray) -> FloatArray:
        """The value below which the law lies with the given probability."""

    @abstractmethod
    def isf(self, probability: FloatArray) -> FloatArray:
        """The value above which the law lies with the given probability."""

    @abstractmethod
    def cdf(self, value: FloatArray) -> FloatArray:
        """Probability of lying below a value."""

    @abstractmethod
    def sf(self, value: FloatArray) -> FloatArray:
        """Probability of lying above a value."""

    @property
    def is_finite(self) -> bool:
        """Whether every draw is a finite number."""
        try:
            ends = self.ppf(np.array([OPEN_INTERVAL[0], 0.5, OPEN_INTERVAL[1]]))
        except (ArithmeticError, SettingsError):
            return False  # parameters so large or small that the formulas overflow
        return bool(np.isfinite(ends).all() and ends[0] < ends[-1])

    @property
    def median(self) -> float:
        """The value that is exceeded as often as not."""
        return float(self.ppf(np.array(0.5)))


def order_problem(lower: float, upper: float) -> Iterator[Problem]:
    """The problem of two ends in the wrong order, if they are."""
    if not lower < upper:
        yield Problem(("upper",), f"{upper:g}", "a value above lower")
