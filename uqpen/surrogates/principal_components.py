"""Principal components of a field: its mean, and the few shapes that its runs scatter in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.processors import one_blas_thread

# No name of an output has a dot.
_SCORE = ".score_"


def score_name(output: str, number: int) -> str:
    """Return the name of the score of a component, counted from 0."""
    return f"{output}{_SCORE}{number + 1}"


# A field is its mean plus a sum of components, each times a score. The scores are plain numbers of
# a run, so a surrogate fits them as it fits scalar outputs. The components are orthonormal for the
# mean over the grid by the trapezoidal rule. So they are of the field, not of its grid: a finer
# part of the grid counts no more than its length.
#
# References
# ----------
# Ramsay, J. O. & Silverman, B. W. (2005). Functional Data Analysis. 2nd ed., Springer. Chapter 8.
# Campbell, K., McKay, M. D. & Williams, B. J. (2006). Reliab. Eng. Syst. Saf. 91, 1468-1472.


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """Mean of a field and its leading principal components."""

    weights: FloatArray  # (place,): see `uqpen.core.variables.Output.place_weights`
    mean: FloatArray  # (place,): mean of the training runs, in the SI unit of the field
    # (component, place): plain numbers, orthonormal under the weights, those of the largest
    # variance first.
    components: FloatArray
    variances: FloatArray  # (component,): variance of each score over the training runs
    truncated: FloatArray  # (place,): variance at each place that the components leave

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
        components = shapes[:kept] / np.sqrt(weights)
        # The largest value of each is above 0.
        largest = np.abs(components).argmax(axis=1)
        components *= np.sign(components[np.arange(kept), largest])[:, None]
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

    @property
    def place_weights(self) -> FloatArray:
        """Weight of each place of the field in a mean over it."""
        return self.weights

    @property
    def text(self) -> str:
        """Clause on what of the field they are of; empty for all of it."""
        return ""

    def names(self, output: str) -> list[str]:
        """Return the names of the scores of a field as outputs."""
        return [score_name(output, number) for number in range(self.count)]

    def score_outputs(self, output: Output) -> Iterator[Output]:
        """Yield the scores of a field as outputs."""
        for number in range(self.count):
            title = f"score {number + 1} of {output.title}"
            yield Output(score_name(output.name, number), output.unit, title)

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
        """Return the fields of some runs, shape (run, place), from their scores."""
        return self.sums(scores)

    def sums(self, scores: FloatArray) -> FloatArray:
        """Return the mean plus the components times some scores, shape (run, place).

        The sum goes by components, so a run has the same bits in any batch.
        """
        values = np.tile(self.mean, (len(scores), 1))
        for score, component in zip(scores.T, self.components, strict=True):
            values += score[:, None] * component
        return values

    def field_variances(self, scores: FloatArray, deviations: FloatArray) -> FloatArray:
        """Return variances of predicted fields, shape (run, place), from those of the scores.

        They are of independent errors of the scores, and contain the truncation.
        """
        variances = np.tile(self.truncated, (len(scores), 1))
        for deviation, component in zip(deviations.T, self.components, strict=True):
            variances += deviation[:, None] ** 2 * component**2
        return variances


def _kept(variances: FloatArray, wanted: float) -> int:
    """Return the number of components to keep."""
    if isinstance(wanted, int):
        return min(wanted, len(variances))
    shares = np.cumsum(variances) / variances.sum()
    return min(int(np.searchsorted(shares, wanted)) + 1, len(variances))


# A smaller share of a variance is rounding, which differs from one processor to another.
ROUNDING = 1e-20


def share_text(share: float) -> str:
    """Return a share of a variance as text."""
    return f"{share:.2g}" if share > ROUNDING else "none"
