"""Missing estimates of a surrogate that its runs refute, or whose runs are of other inputs.

A surrogate is refuted where the mean of the runs that it has not seen predicts them better than it
does, where its predictions are not finite, or where their mean is beyond all runs.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUND,
    CONTRADICTION,
    EQUIVALENT_RUNS,
    INTERVAL,
    INTERVAL_LABEL,
    NOTE,
    REFINED_FOR,
    RUN,
    STATUS,
    SURROGATE_ESTIMATE,
    WEIGHT,
)
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics
from uqpen.statistics.surrogate.correction_runs import FoldFit
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.surrogates.diagnostics import predictive_q2, shown_diagnostics
from uqpen.surrogates.field_surrogate import FieldSurrogate
from uqpen.surrogates.fitting import CrossFit

# Below it, a surrogate errs more than the mean of the runs, and so knows less than they do. Above
# it, runs correct its figures, and their intervals say how little it knows.
LEAST_Q2 = 0.0

# The scatter of fewer runs says too little to refute anything.
_FEWEST_RUNS = 10


class _Unseen(NamedTuple):
    """Runs of an output with predictions by fits that have not seen them."""

    truth: FloatArray
    predicted: FloatArray
    weights: FloatArray


def refutations(
    draws: SurrogateDraws,
    folds: CrossFit,
    training: xr.Dataset,
    check: xr.Dataset | None,
    fits: Mapping[str, xr.DataTree],
) -> dict[str, str]:
    """Find the refuted outputs of a surrogate, and why they are.

    Its check runs decide; without them, its training runs by the fits that have not seen them, or
    else the error at runs left out that a fit states itself.

    Parameters
    ----------
    folds : CrossFit
        The fits without a fold each.
    training, check : Dataset
        Runs of the design that it was fitted to, and of another one, if there is one.
    fits : mapping of str to DataTree
        The group of the fit to each output, with its diagnostics.

    Returns
    -------
    dict of str to str
        The reason, by output.
    """
    model = draws.model
    fields: Collection[str] = model.fields if isinstance(model, FieldSurrogate) else ()
    if isinstance(model, FieldSurrogate):
        draws = replace(draws, model=model.scalars)
    if check is None or _completed_runs(check) < _FEWEST_RUNS:
        which, stated, judges = texts.RUNS_LEFT_OUT, "q2", training
        unseen = [
            FoldFit.of(fit, training.isel({RUN: np.flatnonzero(folds.fold == number)}))
            for number, fit in enumerate(folds.models)
        ]
    else:
        which, stated, judges = texts.CHECK_RUNS, "check_q2_of_output", check
        unseen = [FoldFit.of(model, check)]
    every = [training] if check is None else [training, check]
    found = {}
    for name in (output.name for output in model.outputs):
        if name in fields or not _have_fitted(unseen, name):
            found[name] = _stated_problem(fits[name], stated, judges, which)
        else:
            found[name] = _error_problem(name, unseen, which)
        if name not in fields:
            found[name] = found[name] or _range_problem(name, draws.runs, every)
    return {name: reason for name, reason in found.items() if reason}


def contradiction(training: xr.Dataset, check: xr.Dataset | None) -> str:
    """Return why runs are of other inputs than a surrogate is asked about; empty if they are not.

    It then corrects estimates for the stated inputs by errors at others, and shares of a variance
    of independent inputs are those of no inputs that were met.
    """
    every = (training,) if check is None else (training, check)
    texts_of = (str(runs.attrs.get(CONTRADICTION, "")) for runs in every)
    found = next(filter(None, texts_of), "")
    return texts.CONTRADICTED.format(contradiction=found) if found else ""


def without_numbers(
    statistics: Mapping[str, OutputStatistics], reasons: Mapping[str, str]
) -> dict[str, OutputStatistics]:
    """Return the statistics of outputs, without any number of some of them.

    Parameters
    ----------
    statistics : mapping of str to mapping of str to DataArray
        By output, the estimate arrays of a surrogate.
    reasons : mapping of str to str
        By the outputs without numbers. They are the notes of the missing estimates; a distribution
        function is left out as a whole.
    """
    return {
        output: {
            name: missing_estimates(array, reasons[output])
            for name, array in arrays.items()
            if name not in CATALOGUE or not CATALOGUE[name].is_function
        }
        if output in reasons
        else arrays
        for output, arrays in statistics.items()
    }


def missing_estimates(array: xr.DataArray, reason: str) -> xr.DataArray:
    """Return an estimate array without a number, for a reason."""
    found = array.copy(data=np.full(array.shape, np.nan))
    if BOUND not in array.dims:
        return found
    dims, shape = array.dims[:-1], array.shape[:-1]
    said = {INTERVAL: "none", INTERVAL_LABEL: "none", NOTE: reason}
    beside = [name for name in (SURROGATE_ESTIMATE, EQUIVALENT_RUNS) if name in array.coords]
    return found.assign_coords(
        {
            **{key: (dims, np.full(shape, text, dtype=object)) for key, text in said.items()},
            **{key: (dims, np.full(shape, np.nan)) for key in beside},
        }
    )


def _error_problem(output: str, fits: Sequence[FoldFit], which: str) -> str:
    """Return why predictions of runs that fits have not seen refute them; empty if they do not."""
    parts = [_unseen(output, fit) for fit in fits]
    truth, predicted, weights = (np.concatenate(each) for each in zip(*parts, strict=True))
    if len(truth) < _FEWEST_RUNS or np.ptp(truth) == 0:
        return ""
    if not np.isfinite(predicted).all():
        return texts.REFUTED_AS_NOT_FINITE.format(runs=which.format(runs=len(truth)))
    q2 = predictive_q2(predicted, truth, None if (weights == 1).all() else weights)
    if q2 >= LEAST_Q2:
        return ""
    return texts.REFUTED.format(runs=which.format(runs=len(truth)), q2=_q2_text(q2))


def _unseen(output: str, fit: FoldFit) -> _Unseen:
    runs = fit.completed
    truth = runs[output].values.astype(np.float64)
    # Weights of placed runs are by design; those of a rule are no shares of cases.
    is_weighted = REFINED_FOR in runs.attrs and WEIGHT in runs.coords
    weights = runs[WEIGHT].values if is_weighted else np.ones(len(truth))
    has_value = np.isfinite(truth)
    predicted = fit.predictions(runs)[output]
    return _Unseen(truth[has_value], predicted[has_value], weights[has_value])


def _range_problem(output: str, drawn: xr.Dataset, runs: Sequence[xr.Dataset]) -> str:
    """Return why the predictions at draws refute a surrogate; empty if they do not."""
    predicted = _completed(drawn, output)
    if not np.isfinite(predicted).all():
        return texts.REFUTED_AS_NOT_FINITE.format(runs=texts.DRAWS)
    values = np.concatenate([_completed(each, output) for each in runs])
    values = values[np.isfinite(values)]
    if not predicted.size or values.size < _FEWEST_RUNS:
        return ""
    # Divided first, as the sum can overflow.
    mean = float((predicted / predicted.size).sum())
    if values.min() <= mean <= values.max():
        return ""
    return texts.REFUTED_BY_ITS_MEAN.format(runs=values.size)


def _completed(runs: xr.Dataset, output: str) -> FloatArray:
    found = runs[output].values[runs[STATUS].values == Status.OK]
    return np.asarray(found, dtype=np.float64)


def _completed_runs(runs: xr.Dataset) -> int:
    return int((runs[STATUS].values == Status.OK).sum())


def _have_fitted(fits: Sequence[FoldFit], output: str) -> bool:
    known = [{each.name for each in fit.model.outputs} for fit in fits]
    return bool(known) and all(output in names for names in known)


def _stated_problem(fit: xr.DataTree, diagnostic: str, runs: xr.Dataset, which: str) -> str:
    """Return why the Q² that a fit states refutes it; empty if it does not."""
    # It takes all runs alike, but a refined design has most of them where the surrogate errs.
    if REFINED_FOR in runs.attrs or _completed_runs(runs) < _FEWEST_RUNS:
        return ""
    q2 = {each.name: each.value for each in shown_diagnostics(fit)}.get(diagnostic, np.nan)
    if not q2 < LEAST_Q2:
        return ""
    return texts.REFUTED.format(runs=which.format(runs=_completed_runs(runs)), q2=_q2_text(q2))


def _q2_text(q2: float) -> str:
    # The square of a finite error can overflow.
    return f"{q2:.3g}" if np.isfinite(q2) else "below -1e300"
