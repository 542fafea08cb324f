"""Errors of a Gaussian process at runs left out, and the factor that they give its deviations.

At each run the process is conditioned on all the others, in closed form. Its lengths and its nugget
are found without a fifth of the runs, to which the run belongs. Parameters that have seen a run
would make its error look too small.

References
----------
Dubrule, O. (1983). Mathematical Geology 15, 687-699.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.surrogates.process_likelihood import (
    FEW_RUNS,
    ConditionedProcess,
    Parameters,
    ProcessData,
    improve_parameters,
)

__all__ = ["LeftOutErrors"]

# Parts of the runs, and steps of the search for the parameters without one of them.
_FOLDS = 5
_STEPS = 8

# Intervals of this coverage have to hold the runs left out: half of their width is 1.96 std.
_COVERAGE, _HALF_WIDTH = 0.95, 1.959964


@dataclass(frozen=True, eq=False)
class LeftOutErrors:
    """Errors at runs left out.

    Parameters
    ----------
    errors : ndarray, shape (run,)
        Of the prediction from the other runs.
    deviations : ndarray, shape (run,)
        Their standard deviations by the process.
    """

    errors: FloatArray
    deviations: FloatArray

    @classmethod
    def of_runs(
        cls, data: ProcessData, parameters: Parameters, rng: np.random.Generator
    ) -> LeftOutErrors | None:
        """Leave out each run; None where the others are singular to rounding.

        Of many runs the parameters are those of all runs, which a fifth of them hardly changes.
        """
        count = len(data.values)
        fold = rng.permutation(count) % (_FOLDS if count <= FEW_RUNS else 1)
        errors, deviations = np.empty((2, count))
        for number in range(fold.max() + 1):
            out, others = fold == number, np.flatnonzero(fold != number)
            found = parameters
            if len(others):
                found = improve_parameters(data.part(others), parameters, _STEPS)
            process = ConditionedProcess.of_runs(data, found)
            if process is None:
                return None
            precisions = np.diag(process.inverse)[out]
            errors[out] = process.weights[out] / precisions
            deviations[out] = np.sqrt(process.variance / precisions)
        return cls(errors, deviations)

    def q2(self, values: FloatArray) -> float:
        """Return one minus the mean square error over the variance of the values."""
        return 1 - float(np.mean(self.errors**2) / np.var(values))

    @property
    def std_factor(self) -> float:
        """Factor of the deviations with which 95 % intervals hold 95 % of the runs left out."""
        standardised = np.abs(self.errors) / self.deviations
        # As many of n + 1 errors: that of a further run is as likely to be of any rank.
        return float(np.quantile(standardised, _COVERAGE, method="weibull")) / _HALF_WIDTH
