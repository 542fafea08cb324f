"""Errors of a surrogate where there are no runs: its fits disagree, as much as they err at runs.

References
----------
Seung, H. S., Opper, M. & Sompolinsky, H. (1992). Proc. COLT '92, 287-294 (query by committee).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import special

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.labels import RUN, STATUS, WEIGHT
from uqpen.core.status import Status
from uqpen.surrogates.cross_fitting import CrossFit
from uqpen.surrogates.refinement.refinement import RefinedOutput

__all__ = ["PredictedError", "predicted_errors"]


@dataclass(frozen=True, eq=False)
class PredictedError:
    """Expected square of the error that a run corrects, at candidates for further runs.

    Parameters
    ----------
    squares : ndarray, shape (candidate,)
        Of an output, or of whether it exceeds a threshold: then the probability of a disagreement.
    is_of_event : bool
        True for a threshold.
    """

    squares: FloatArray
    is_of_event: bool


def predicted_errors(
    folds: CrossFit, runs: xr.Dataset, candidates: Arrays, targets: Sequence[RefinedOutput]
) -> Iterator[PredictedError]:
    """Yield the errors that the fits to parts of the runs suggest at candidates.

    A target that some fit does not have, or for which the fits do not disagree, is left out.

    Parameters
    ----------
    folds : CrossFit
        The fits without a fold of the runs each.
    runs : Dataset
        All runs so far, with the weights of the completed ones.
    candidates : mapping of str to ndarray, shape (candidate,)
        Admissible inputs in SI units.
    targets : sequence of RefinedOutput
    """
    models = [each.without_fields for each in folds.models]
    if not models:
        return
    known = set.intersection(*({output.name for output in each.outputs} for each in models))
    predicted = [each.evaluate(candidates).outputs for each in models]
    for target in (each for each in targets if each.output in known):
        committee = np.array([each[target.output] for each in predicted])
        spread = committee.var(axis=0)
        error = _mean_square_error(folds, runs, target.output)
        if not (np.isfinite(committee).all() and spread.mean() > 0 and 0 < error < np.inf):
            continue
        squares = error * spread / spread.mean()
        if not target.limits:
            yield PredictedError(squares, is_of_event=False)
        for limit in target.limits:
            with np.errstate(divide="ignore", invalid="ignore"):  # where all fits agree
                distance = np.abs(committee.mean(axis=0) - limit) / np.sqrt(squares)
            distance = np.nan_to_num(distance, nan=0.0)
            yield PredictedError(special.ndtr(-distance), is_of_event=True)


def _mean_square_error(folds: CrossFit, runs: xr.Dataset, output: str) -> float:
    """Return the weighted mean square of the errors at runs that a fit has not seen."""
    squares, weights = [], []
    for number, model in enumerate(folds.models):
        is_own = (folds.fold == number) & (runs[STATUS].values == Status.OK)
        own = runs.isel({RUN: np.flatnonzero(is_own)})
        fit = model.without_fields
        inputs = {name: np.broadcast_to(own[name], own.sizes[RUN]) for name in fit.random_inputs}
        squares.append((own[output].values - fit.evaluate(inputs).outputs[output]) ** 2)
        weights.append(own[WEIGHT].values)
    all_weights = np.concatenate(weights)
    return float(np.concatenate(squares) @ all_weights / all_weights.sum())
