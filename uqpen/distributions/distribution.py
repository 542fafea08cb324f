"""Interface of the distribution of one input, and its stand-in without code."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, NoReturn

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ModelError, Problem, SettingsError
from uqpen.core.settings import validate

# Interface of the distribution of one input.
#
# Both tails have a function each, so that a distribution truncated far out keeps its accuracy.

# A generator may return 0, and rounding may give 1, where a quantile may be infinite. So draws are
# kept half a step of the generator inside.
OPEN_INTERVAL = (2.0**-54, 1 - 2.0**-53)


class Distribution(ABC):
    """Distribution of one variable; probabilities are arrays of any shape.

    A subclass is a frozen dataclass of its parameters, in SI units.
    """

    is_discrete: ClassVar[bool] = False
    """True if it has probabilities of single values, and no density."""

    is_positive: ClassVar[bool] = False
    """True if all values are above 0, whatever its parameters."""

    is_count: ClassVar[bool] = False
    """True if its values are whole numbers without a unit."""

    unfitted_reason: ClassVar[str] = "its parameters have no estimate by maximum likelihood here"
    """Reason why it is not fitted to measurements; empty for a subclass that has `fit`."""

    def __init_subclass__(cls) -> None:
        if "fit" in vars(cls):
            cls.unfitted_reason = ""
        # Far out, the formulas overflow on their way to 0, to 1 or to an end of the support.
        for name in ("ppf", "isf", "cdf", "sf", "log_density"):
            if name in vars(cls):
                setattr(cls, name, np.errstate(all="ignore")(vars(cls)[name]))

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between parameters that are valid by themselves."""
        yield from ()

    @abstractmethod
    def ppf(self, probability: FloatArray) -> FloatArray:
        """Percent-point function: the value below which the given probability lies."""

    @abstractmethod
    def isf(self, probability: FloatArray) -> FloatArray:
        """Inverse survival function: the value above which the given probability lies."""

    @abstractmethod
    def cdf(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution function: the probability below a value."""

    @abstractmethod
    def sf(self, value: FloatArray) -> FloatArray:
        """Survival function: the probability above a value."""

    def log_density(self, value: FloatArray) -> FloatArray | None:
        """Return the logarithm of the density, or of the probability of a value of a discrete one.

        It is -inf where there is no probability. None if the density is not known.
        """
        return None

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return two functions that span the scores of the parameters behind its mean and std.

        Scores are the derivatives of the logarithm of the density. They may lack a constant: the
        mean of each over the distribution has to be subtracted. A distribution without a family of
        two parameters on the same support has those of the exponential family through it in
        which the mean and the variance are free: it is the one that changes the least, by
        Kullback and Leibler's divergence (Lemaître, P. et al. (2015). J. Stat. Comput. Simul. 85,
        1200-1223).
        """
        deviation = value - self.median
        return deviation, deviation * deviation

    def logarithm(self) -> Distribution | None:
        """Return the distribution of the logarithm if it is simpler; None otherwise."""
        return None

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Distribution:
        """Return the distribution under which measurements are the likeliest.

        Parameters
        ----------
        x : ndarray, shape (measurement,)
            The measurements divided by `size`, so that their powers neither overflow nor vanish.
            They are not all the same, and above 0 if the distribution `is_positive`.
        size : float
            A power of two near the largest of them, in SI units.

        Raises
        ------
        ArithmeticError, ValueError, RuntimeError
            If the equations have no solution within double precision.
        """
        raise NotImplementedError(cls.unfitted_reason)

    def atoms(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the values and probabilities of a discrete distribution; None if not known."""
        return None

    @property
    def is_finite(self) -> bool:
        """True if every draw is a finite number."""
        try:
            ends = self.ppf(np.array([OPEN_INTERVAL[0], 0.5, OPEN_INTERVAL[1]]))
        except (ArithmeticError, SettingsError):
            return False  # parameters so large or small that the formulas overflow
        return bool(np.isfinite(ends).all() and ends[0] < ends[-1])

    @property
    def least_upper_tail(self) -> float:
        """Least probability above a value that it knows with eight digits; 0 for any."""
        return 0.0

    @property
    def highest_moment(self) -> float:
        """Order from which on its moments are infinite; infinite where all are finite."""
        return math.inf

    @property
    def median(self) -> float:
        """Median of the distribution."""
        return float(self.ppf(np.array(0.5)))


# Why the upper tail of a distribution is refused, and what has it.
UPPER_TAIL = (
    "chaospy computes an upper tail as 1 - F, which has no digits left there; SciPy's "
    "distributions and those of uqpen have both tails"
)


def order_problem(lower: float, upper: float) -> Iterator[Problem]:
    """Yield a problem if two ends are in the wrong order."""
    if not lower < upper:
        yield Problem(("upper",), f"{upper:g}", "a value above lower")


# Stand-in for a user-defined distribution whose code is not executed.


@dataclass(frozen=True)
class UnloadedDistribution(Distribution):
    """Distribution known by its name only: a reference, or an object of a program."""

    name: str

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise ModelError(f"{self.name} is not loaded: it has no values without --trust")

    ppf = isf = cdf = sf = _refuse
