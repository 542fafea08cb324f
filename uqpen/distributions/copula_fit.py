"""Fit of a copula to rows that were measured together, and its goodness of fit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError, counted
from uqpen.core.lookup import resolve
from uqpen.distributions import COPULAS
from uqpen.distributions.copulas import Dependence
from uqpen.distributions.measurements import LOWEST_P_VALUE

# A rank correlation of fewer pairs has a standard error above a quarter.
FEWEST_ROWS = 10

# Bootstrap samples: enough to distinguish a probability of 0.05 from 0.02 and 0.08.
_SAMPLES = 199

# Draws by which the distribution function of a copula is known to 0.01, and rows at which it is
# compared with that of the rows: more change a distance by less than its own scatter.
_DRAWS = 2500
_COMPARED = 1000


@dataclass(frozen=True)
class CopulaFit:
    """Copula fitted to rows of measurements by Kendall's rank correlations."""

    copula: Dependence
    family: str
    rows: int
    # Cramér-von Mises distance: the sum of squared differences of its distribution function from
    # that of the rows, at the rows.
    distance: float
    # Share of samples of the fitted copula, each fitted anew, that lie as far from their fit as the
    # rows from theirs.
    p_value: float
    # The family that is next by its likelihood, and the difference of the criteria: twice the
    # logarithm of the ratio of the likelihoods, less 2 for each further parameter. None if the
    # family was given, or no other one has these correlations.
    runner_up: tuple[str, float] | None
    has_ties: bool  # whether values stand several times in a column

    @property
    def is_rejected(self) -> bool:
        """True if such rows would be unlikely under the fitted copula."""
        return self.p_value < LOWEST_P_VALUE

    @property
    def description(self) -> str:
        """Text on the fit, in one line."""
        others = ""
        if self.runner_up is not None:
            name, difference = self.runner_up
            others = f"; next by likelihood {name} (AIC {difference:.3g} higher)"
        ties = ", as without ties" if self.has_ties else ""
        return (
            f"Cramér-von Mises distance {self.distance:.3g}, p = {self.p_value:.2g}{ties}{others}"
        )


def fit_copula(
    inputs: tuple[str, ...],
    rows: FloatArray,
    rng: np.random.Generator,
    families: Iterable[str] = COPULAS,
    *,
    samples: int = _SAMPLES,
) -> CopulaFit:
    """Fit the likeliest of some copulas to rows of measurements.

    Each family is fitted by Kendall's rank correlations, which do not depend on the distributions
    of the inputs. The family has the least AIC by the pseudo-likelihood, that of the ranks over
    n + 1. Its distance from the rows is compared with those of samples of the fitted copula, each
    fitted anew.

    Parameters
    ----------
    inputs : tuple of str
        Names of the inputs.
    rows : ndarray, shape (row, input)
        Values that were measured together.
    rng : Generator
        Source of the samples.
    families : iterable of str
        Names in `COPULAS`.
    samples : int
        Number of bootstrap samples.

    Raises
    ------
    SettingsError
        If there are too few rows, a column does not vary, or no family has such correlations.

    References
    ----------
    Genest, C., Ghoudi, K. & Rivest, L.-P. (1995). Biometrika 82, 543-552: pseudo-likelihood.

    Genest, C. & Rémillard, B. (2008). Ann. Inst. H. Poincaré Probab. Statist. 44, 1096-1127: the
    bootstrap, in two levels.
    """
    if len(rows) < FEWEST_ROWS:
        few = Problem((), counted(len(rows), "row"), f"at least {FEWEST_ROWS}")
        raise SettingsError([few])
    for name, column in zip(inputs, rows.T, strict=True):
        if not np.ptp(column) > 0:
            raise SettingsError([Problem((), f"{name} that does not vary", "values that differ")])
    kendall, ranks = kendall_matrix(rows), pseudo_observations(rows)
    fitted = {
        name: copula
        for name in families
        if (copula := resolve(COPULAS[name]).fit(inputs, kendall, ranks)) is not None
    }
    if not fitted:
        pairs = ", ".join(
            f"{one} and {other} {kendall[i, j]:.3g}"
            for (i, one), (j, other) in combinations(enumerate(inputs), 2)
        )
        expected = "another copula, which can have them"
        raise SettingsError([Problem((), f"Kendall's rank correlations of {pairs}", expected)])
    criteria = {
        name: 2 * copula.parameters - 2 * float(copula.log_density(ranks).sum())
        for name, copula in fitted.items()
    }
    best, *others = sorted(criteria, key=criteria.__getitem__)
    copula = fitted[best]
    distance, worse = _distance(copula, ranks, rng), 0
    for _ in range(samples):
        sample = copula.inverse_rosenblatt(rng.random(rows.shape))
        drawn = pseudo_observations(sample)
        again = type(copula).fit(inputs, kendall_matrix(sample), drawn)
        # A sample that the family cannot fit is as far from it as any.
        worse += again is None or _distance(again, drawn, rng) >= distance
    return CopulaFit(
        copula,
        best,
        len(rows),
        distance,
        (1 + worse) / (1 + samples),
        (others[0], criteria[others[0]] - criteria[best]) if others else None,
        any(len(np.unique(column)) < len(column) for column in rows.T),
    )


def pseudo_observations(rows: FloatArray) -> FloatArray:
    """Return the ranks over n + 1, shape (row, input); equal values share their mean rank."""
    return scipy.stats.rankdata(rows, axis=0) / (len(rows) + 1)


def kendall_matrix(rows: FloatArray) -> FloatArray:
    """Return Kendall's rank correlations of all pairs of columns, tau-b where values are equal."""
    size = rows.shape[1]
    found = np.eye(size)
    for one, other in combinations(range(size), 2):
        found[one, other] = found[other, one] = scipy.stats.kendalltau(
            rows[:, one], rows[:, other], method="asymptotic"
        ).statistic
    return found


def _distance(copula: Dependence, ranks: FloatArray, rng: np.random.Generator) -> float:
    """Return the Cramér-von Mises distance of a copula from ranks, at the first of these."""
    at = ranks[:_COMPARED]
    draws = copula.inverse_rosenblatt(rng.random((_DRAWS, ranks.shape[1])))
    difference = _distribution_function(draws, at) - _distribution_function(ranks, at)
    return float((difference**2).sum() * len(ranks) / len(at))


def _distribution_function(draws: FloatArray, at: FloatArray) -> FloatArray:
    """Return the share of draws that are not above a point in any column."""
    below = np.ones((len(at), len(draws)), dtype=bool)
    for column, values in zip(draws.T, at.T, strict=True):
        below &= column <= values[:, None]
    return below.mean(axis=1)
