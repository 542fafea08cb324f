"""Principal components of a field: its mean and the few shapes that its runs scatter in.

A field is its mean plus a sum of components, each times a score. The scores are plain numbers of a
run, so a surrogate fits them as it fits scalar outputs. The components are orthonormal for the mean
over the grid by the trapezoidal rule. So they are of the field, not of its grid: a finer part of
the grid counts no more than its length.

References
----------
Ramsay, J. O. & Silverman, B. W. (2005). Functional Data Analysis. 2nd ed., Springer. Chapter 8.
Campbell, K., McKay, M. D. & Williams, B. J. (2006). Reliab. Eng. Syst. Saf. 91, 1468-1472.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.settings import setting
from uqpen.core.threads import one_blas_thread

__all__ = ["DEFAULT_COMPONENTS", "PrincipalComponents", "components_setting"]

# The truncation then leaves at most 1 % of the standard deviation.
DEFAULT_COMPONENTS = 0.9999


def components_setting() -> Any:
    """Declare how many components to keep: a share of the variance, or their number."""
    expected = "a share of the variance between 0 and 1, or a whole number of components"

    def accepts(value: Any) -> bool:
        if isinstance(value, float):
            return 0 < value < 1
        return isinstance(value, int) and not isinstance(value, bool) and value >= 1

    return setting("components", expected, accepts, default=DEFAULT_COMPONENTS)


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """Mean of a field and its leading principal components.

    Parameters
    ----------
    weights : ndarray, shape (place,)
        See `uqpen.core.variables.Output.place_weights`.
    mean : ndarray, shape (place,)
        Mean of the training runs, in the SI unit of the field.
    components : ndarray, shape (component, place)
        Plain numbers, orthonormal under the weights, those of the largest variance first.
    variances : ndarray, shape (component,)
        Variance of each score over the training runs.
    truncated : ndarray, shape (place,)
        Variance at each place that the components leave.
    """

    weights: FloatArray
    mean: FloatArray
    components: FloatArray
    variances: FloatArray
    truncated: FloatArray

    @classmethod
    @one_blas_thread()
    def of_runs(
        cls,
        values: FloatArray,
        weights: FloatArray,
        wanted: float,
        run_weights: FloatArray | None = None,
    ) -> PrincipalComponents:
        """Find the components of a field over some runs.

        Parameters
        ----------
        values : ndarray, shape (run, place)
            Finite, and not the same in all runs.
        weights : ndarray, shape (place,)
            See `uqpen.core.variables.Output.place_weights`.
        wanted : float or int
            The share of the variance that the components have at least, below 1; or their number.
        run_weights : ndarray, shape (run,), optional
            Weights of an integration rule, above 0; equal ones by default.
        """
        shares = np.ones(len(values)) if run_weights is None else run_weights
        shares = shares / shares.sum()
        mean = shares @ values
        roots = np.sqrt(shares)[:, None]
        left, sizes, shapes = scipy.linalg.svd(
            roots * (values - mean) * np.sqrt(weights), full_matrices=False, check_finite=False
        )
        rank = int((sizes > sizes[0] * max(values.shape) * np.finfo(float).eps).sum())
        kept = _kept(sizes[:rank] ** 2, wanted)
        components = _with_sign(shapes[:kept] / np.sqrt(weights))
        is_constant = (values == values[0]).all(axis=0)
        # No rounding may look like scatter.
        mean, components = np.where(is_constant, values[0], mean), components * ~is_constant
        beyond = slice(kept, rank)
        rest = (left[:, beyond] * sizes[beyond]) @ shapes[beyond] / np.sqrt(weights)
        return cls(weights, mean, components, sizes[:kept] ** 2, (rest**2).sum(axis=0))

    @property
    def count(self) -> int:
        """Number of the components."""
        return len(self.components)

    @property
    def variance(self) -> float:
        """Variance of the field over the training runs, as a mean over its places."""
        return float(self.variances.sum() + self.weights @ self.truncated)

    @property
    def truncation(self) -> float:
        """Share of that variance that the components leave."""
        return float(self.weights @ self.truncated) / self.variance

    def at(self, places: slice) -> PrincipalComponents:
        """Return them at some of the places."""
        return replace(
            self,
            weights=self.weights[places],
            mean=self.mean[places],
            components=self.components[:, places],
            truncated=self.truncated[places],
        )

    def scores(self, values: FloatArray) -> FloatArray:
        """Return the scores of some runs, shape (run, component), from their fields."""
        return ((values - self.mean) * self.weights) @ self.components.T

    def fields(self, scores: FloatArray) -> FloatArray:
        """Return the fields of some runs, shape (run, place), from their scores.

        The sum goes by components, so a run has the same bits in any batch.
        """
        values = np.tile(self.mean, (len(scores), 1))
        for score, component in zip(scores.T, self.components, strict=True):
            values += score[:, None] * component
        return values


def _kept(variances: FloatArray, wanted: float) -> int:
    """Return the number of components to keep."""
    if isinstance(wanted, int):
        return min(wanted, len(variances))
    shares = np.cumsum(variances) / variances.sum()
    return min(int(np.searchsorted(shares, wanted)) + 1, len(variances))


def _with_sign(components: FloatArray) -> FloatArray:
    """Turn each component so that its largest value is above 0."""
    largest = np.abs(components).argmax(axis=1)
    signs: FloatArray = np.sign(components[np.arange(len(components)), largest])
    return components * signs[:, None]
