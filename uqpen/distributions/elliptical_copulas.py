"""Copulas of the multivariate normal and Student's t distributions, given by a matrix.

Fang, K. T., Kotz, S. & Ng, K. W. (1990). Symmetric Multivariate and Related Distributions.
Chapman and Hall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.settings import number
from uqpen.distributions.dependence import Dependence, sum_columns

__all__ = ["MEASURES", "EllipticalCopula", "GaussianCopula", "StudentCopula", "score_correlation"]

Matrix = tuple[tuple[float, ...], ...]

# No conditional variance is smaller; rounding leaves it ten digits.
_LEAST_EIGENVALUE = 1e-6

MEASURES = {
    "normal-scores": "the normal scores, the copula's own parameter",
    "t-scores": "the t scores, the copula's own parameter",
    "ranks": "the ranks (Spearman's)",
    "kendall": "the order of two draws (Kendall's)",
}


def score_correlation(correlation: float, measure: str) -> float:
    """Convert a rank correlation to the correlation of normal scores.

    Parameters
    ----------
    correlation : float
        Between -1 and 1.
    measure : str
        One of `MEASURES`. The conversion of Kendall's is the same for every elliptical
        distribution; that of Spearman's is the one of the normal distribution.

    References
    ----------
    Kruskal, W. H. (1958). J. Am. Stat. Assoc. 53, 814-861.
    """
    if measure == "ranks":
        return 2 * math.sin(math.pi * correlation / 6)
    if measure == "kendall":
        return math.sin(math.pi * correlation / 2)
    return correlation


@dataclass(frozen=True)
class EllipticalCopula(Dependence):
    """Copula of a distribution whose surfaces of equal density are ellipsoids.

    Parameters
    ----------
    inputs : tuple of str
        The inputs that it joins.
    matrix : tuple of tuple of float
        Correlations of the scores.
    """

    measures: ClassVar[tuple[str, ...]]
    """Keys of `MEASURES` that convert exactly into a correlation of its scores."""

    inputs: tuple[str, ...]
    matrix: Matrix

    def check_settings(self) -> Iterator[Problem]:
        size = len(self.inputs)
        if len(self.matrix) != size or any(len(row) != size for row in self.matrix):
            yield Problem(("matrix",), "another size", f"{size} rows of {size} correlations")
            return
        wrong = list(_entry_problems(self.matrix))
        yield from wrong
        least = 1.0 if wrong else float(np.linalg.eigvalsh(np.array(self.matrix))[0])
        if not least > _LEAST_EIGENVALUE:
            found = f"correlations of scores whose matrix has the smallest eigenvalue {least:.3g}"
            expected = f"a positive definite matrix (every eigenvalue above {_LEAST_EIGENVALUE:g})"
            yield Problem(("matrix",), found, f"{expected}: correlations that can hold together")

    @property
    def description(self) -> str:
        pairs = [
            f"{one} and {other} {correlation:.4g}"
            for (row, one), (column, other) in combinations(enumerate(self.inputs), 2)
            if (correlation := self.matrix[row][column])
        ]
        scores = self.measures[0].replace("-", " ")
        return f"correlation of {scores}: {', '.join(pairs or ['none'])}"

    def _regression(
        self, position: int, known: Mapping[int, FloatArray]
    ) -> tuple[FloatArray, float]:
        """Return the conditional mean of a score given others, and its conditional scatter."""
        matrix, others = np.array(self.matrix), sorted(known)
        weights = np.linalg.solve(matrix[np.ix_(others, others)], matrix[others, position])
        mean = sum_columns({key: weights[rank] * known[key] for rank, key in enumerate(others)})
        return mean, math.sqrt(1 - float(weights @ matrix[others, position]))

    def _distance(self, known: Mapping[int, FloatArray]) -> FloatArray:
        """Return the squared Mahalanobis distance of known scores from the centre."""
        others = sorted(known)
        inverse = np.linalg.inv(np.array(self.matrix)[np.ix_(others, others)])
        products = [
            inverse[row, column] * known[one] * known[other]
            for row, one in enumerate(others)
            for column, other in enumerate(others)
        ]
        return sum_columns(dict(enumerate(products)))


@dataclass(frozen=True)
class GaussianCopula(EllipticalCopula):
    """Copula of the multivariate normal distribution."""

    measures = ("normal-scores", "ranks", "kendall")

    def score(self, probability: FloatArray) -> FloatArray:
        return scipy.special.ndtri(probability)

    def probability(self, score: FloatArray) -> FloatArray:
        return scipy.special.ndtr(score)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        mean, std = self._regression(position, known)
        return mean + std * scipy.special.ndtri(probability)


@dataclass(frozen=True)
class StudentCopula(EllipticalCopula):
    """Copula of the multivariate t distribution: extreme values of all inputs occur together.

    Parameters
    ----------
    degrees : float
        Its degrees of freedom; the fewer, the more the tails depend.
    """

    measures = ("t-scores", "kendall")

    degrees: float = number(above=1, below=1000, default=4.0)

    @property
    def description(self) -> str:
        return f"{self.degrees:g} degrees of freedom; {super().description}"

    def score(self, probability: FloatArray) -> FloatArray:
        return scipy.special.stdtrit(self.degrees, probability)

    def probability(self, score: FloatArray) -> FloatArray:
        return scipy.special.stdtr(self.degrees, score)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        mean, scale = self._regression(position, known)
        degrees = self.degrees + len(known)
        widening = np.sqrt((self.degrees + self._distance(known)) / degrees)
        return mean + scale * widening * scipy.special.stdtrit(degrees, probability)


def _entry_problems(matrix: Matrix) -> Iterator[Problem]:
    """Yield the problems of single entries: the diagonal, the range, the symmetry."""
    for row, values in enumerate(matrix):
        for column, value in enumerate(values):
            where = ("matrix", row, column)
            if row == column:
                if value != 1:
                    yield Problem(where, f"{value:g}", "1 on the diagonal")
            elif not abs(value) < 1:
                yield Problem(where, f"{value:g}", "a correlation between -1 and 1")
            elif column < row and value != matrix[column][row]:
                found = f"{value:g} across the diagonal from {matrix[column][row]:g}"
                yield Problem(where, found, "a symmetric matrix: the same as across the diagonal")
