"""Evidence on the errors of a surrogate: real runs, with predictions that have not seen them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    REFINED_FOR,
    REPLICATE,
    ROUND,
    RUN,
    SAMPLING,
    STATUS,
    STOPPING_STATISTICS,
    WEIGHT,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.correction.corrected_indices import (
    IndexedVariable,
    IndexedVariables,
)
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns, FoldFit
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.surrogates.field_surrogate import FieldSurrogate
from uqpen.surrogates.fitted_surrogate import ClosedForms
from uqpen.surrogates.fitting import CrossFit

__all__ = ["CorrectionEvidence", "Indexed", "correction_evidence"]

# By the beginning of the names of their indices: those of exceedance are one for each threshold.
Indexed = Mapping[str, tuple[IndexedVariable, ...]]

# The first of each set of the surrogate's quasi-random draws: every fold's fit is evaluated there,
# and the error that they leave is a part of the interval.
_DRAWS_OF_SET = 1024

# Fewer runs have no meaningful scatter.
_FEWEST_RUNS = 10


@dataclass(frozen=True, eq=False)
class CorrectionEvidence:
    """Evidence on the errors of a surrogate.

    Parameters
    ----------
    runs : mapping of str to CorrectionRuns
        By scalar output.
    reasons : mapping of str to str
        The reason why nothing corrects each other output.
    indexed : mapping of str to mapping of str to tuple of IndexedVariable
        By output and by the beginning of their names, what indices follow from.
    plain : mapping of str to mapping of str to DataArray
        Estimates of the runs of one design alone, before a surrogate placed any, for comparison.
    has_own_number : bool
        True if runs decided their own number.
    """

    runs: Mapping[str, CorrectionRuns]
    reasons: Mapping[str, str]
    indexed: Mapping[str, Indexed] = field(default_factory=dict)
    plain: Mapping[str, OutputStatistics] = field(default_factory=dict)
    has_own_number: bool = False


def correction_evidence(
    draws: SurrogateDraws,
    folds: CrossFit,
    training: xr.Dataset,
    check: xr.Dataset | None,
    quantities: Sequence[QuantityOfInterest],
) -> CorrectionEvidence:
    """Collect the runs that correct a surrogate.

    Parameters
    ----------
    draws : SurrogateDraws
        Of the fit to all training runs.
    folds : CrossFit
        The fits without a fold each.
    training, check : Dataset
        Runs of the design that it was fitted to, and of another one, if there is one.
    quantities : sequence of QuantityOfInterest
    """
    fitted = {output.name for output in draws.model.outputs}
    wanted = [each for each in quantities if each.output.name in fitted and not each.output.dims]
    used = [training] if folds.models else []
    parts = [
        FoldFit.of(fit, training.isel({RUN: np.flatnonzero(folds.fold == number)}))
        for number, fit in enumerate(folds.models)
    ]
    if check is not None and _is_drawn(check):
        used.append(check)
        parts.append(FoldFit.of(draws.model, check))
    if not used or not wanted:
        reason = folds.reason or texts.NO_CORRECTING_RUN
        return CorrectionEvidence({}, {each.output.name: reason for each in wanted})
    scalars = draws.model.scalars if isinstance(draws.model, FieldSurrogate) else draws.model
    collected = _Collected(replace(draws, model=scalars), parts)
    reasons = {each.output.name: collected.problem(each.output.name) for each in wanted}
    runs = {
        each.output.name: collected.runs(each) for each in wanted if not reasons[each.output.name]
    }
    return CorrectionEvidence(
        runs,
        {name: reason for name, reason in reasons.items() if reason},
        {
            name: collected.variables.of_output(each, runs[name])
            for each in wanted
            if (name := each.output.name) in runs
        },
        analyze(_first_draws(used[0]), wanted),
        any(STOPPING_STATISTICS in each.attrs for each in used),
    )


def _is_drawn(runs: xr.Dataset) -> bool:
    """Check that runs are draws, or sets of points, of the distribution of the inputs."""
    sampling = Sampling(runs.attrs[SAMPLING])
    is_drawn = sampling in (Sampling.INDEPENDENT, Sampling.STRATIFIED)
    return is_drawn and WEIGHT not in runs.coords


def _first_draws(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs before a surrogate placed any."""
    if REFINED_FOR not in runs.attrs or ROUND not in runs.coords:
        return runs
    first = np.flatnonzero(runs[ROUND].values == 0)
    return runs.isel({RUN: first}).drop_vars([WEIGHT, ROUND])


@dataclass(frozen=True)
class _Collected:
    """Folds of real runs, with draws of the input distribution given admissible."""

    draws: SurrogateDraws
    folds: Sequence[FoldFit]

    @cached_property
    def _points(self) -> xr.Dataset:
        """The draws at which each fit is evaluated: the first of each set."""
        runs = self.draws.runs
        replicate = runs[REPLICATE].values
        position = np.arange(len(replicate)) - np.searchsorted(replicate, replicate)
        is_admissible = runs[STATUS].values != Status.INADMISSIBLE
        return runs.isel({RUN: np.flatnonzero(is_admissible & (position < _DRAWS_OF_SET))})

    @cached_property
    def _at_runs(self) -> list[Mapping[str, FloatArray]]:
        return [fold.predictions(fold.completed) for fold in self.folds]

    @cached_property
    def _at_missing(self) -> list[Mapping[str, FloatArray]]:
        return [fold.predictions(fold.missing) for fold in self.folds]

    @cached_property
    def _at_draws(self) -> list[Mapping[str, FloatArray]]:
        return [fold.predictions(self._points) for fold in self.folds]

    def problem(self, output: str) -> str:
        """Return why no run corrects an output; empty if some do."""
        for fold in self.folds:
            if output not in {each.name for each in fold.model.outputs}:
                reason = fold.model.reasons.get(output, "")
                return texts.NOT_FITTED_WITHOUT.format(reason=reason)
        runs = sum(fold.size for fold in self.folds)
        if runs < _FEWEST_RUNS:
            return texts.FEW_CORRECTING_RUNS.format(runs=runs)
        if np.unique(self._points[REPLICATE].values).size < 2:
            return texts.NO_ADMISSIBLE_DRAW
        if not all(np.isfinite(fold.completed[output].values).all() for fold in self.folds):
            return texts.WITHOUT_VALUE_IN_RUNS
        predicted = (*self._at_runs, *self._at_missing, *self._at_draws)
        are_finite = all(np.isfinite(each[output]).all() for each in predicted)
        return "" if are_finite else texts.NOT_FINITE_PREDICTIONS

    def runs(self, quantity: QuantityOfInterest) -> CorrectionRuns:
        """Return the runs that correct an output."""
        name = quantity.output.name
        sizes = [fold.size for fold in self.folds]
        values = [fold.completed[name].values.astype(np.float64) for fold in self.folds]
        _, replicate = np.unique(self._points[REPLICATE].values, return_inverse=True)
        return CorrectionRuns(
            np.concatenate(values),
            np.concatenate([each[name] for each in self._at_runs]),
            np.repeat(np.arange(len(sizes)), sizes),
            np.array([each[name] for each in self._at_draws]),
            replicate.astype(np.int64),
            np.concatenate([each[name] for each in self._at_missing]),
            np.repeat(np.arange(len(sizes)), [each.missing.sizes[RUN] for each in self.folds]),
            self._exact_moments(name),
            quantity.confidence_level,
            *self._weights(),
        )

    def _weights(self) -> tuple[FloatArray | None, FloatArray | None]:
        """Return the weights of completed and of missing runs; None where all are 1."""
        completed, missing = (
            np.concatenate([_weights_of(part) for part in parts])
            for parts in zip(*((each.completed, each.missing) for each in self.folds), strict=True)
        )
        is_weighted = (completed != 1).any() or (missing != 1).any()
        return (completed, missing) if is_weighted else (None, None)

    def _exact_moments(self, output: str) -> FloatArray | None:
        """Return the moments of each fit where all are known without draws."""
        models = [fold.model for fold in self.folds]
        if not self.draws.all_are_admissible:
            return None
        found = [
            model.closed_form_moments(output)
            for model in models
            if isinstance(model, ClosedForms) and model.has_closed_form(output)
        ]
        return np.array(found) if len(found) == len(models) else None

    @cached_property
    def variables(self) -> IndexedVariables:
        """The variables whose indices they correct."""
        return IndexedVariables(self.draws, self.folds)


def _weights_of(runs: xr.Dataset) -> FloatArray:
    weights = runs[WEIGHT].values if WEIGHT in runs.coords else np.ones(runs.sizes[RUN])
    return np.asarray(weights, dtype=np.float64)
