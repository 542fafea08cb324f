"""Variables whose indices runs correct: an output, its logarithm, and whether it exceeds a value.

What the fits have of each input follows from their terms, where these are those of the variable,
and else from draws that share inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import OF_EXCEEDANCE, OF_LOGARITHM
from uqpen.statistics import texts
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.correction.corrected_indices import InputParts
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.fold_fit import FoldFit
from uqpen.statistics.surrogate.correction.fold_projections import FoldProjections
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.surrogates.fitted_surrogate import ClosedForms

__all__ = ["FIRST_ORDER", "TOTAL_ORDER", "IndexedVariable", "IndexedVariables"]

FIRST_ORDER, TOTAL_ORDER = "first_order", "total_order"

Function = Callable[[FloatArray], FloatArray]


def _itself(values: FloatArray) -> FloatArray:
    return values


@dataclass(frozen=True, eq=False)
class IndexedVariable:
    """Variable with the projections of its fits.

    Parameters
    ----------
    output : CorrectionRuns
        Of the output that it follows from.
    parts : mapping of str to InputParts
        By the kind of the indices.
    reasons : mapping of str to str
        Why there are no projections for the other kinds.
    function : callable
        Function of the output that the variable is.
    is_event : bool
        True if the variable is 0 or 1.
    """

    output: CorrectionRuns
    parts: Mapping[str, InputParts]
    reasons: Mapping[str, str]
    function: Function = _itself
    is_event: bool = False

    @property
    def runs(self) -> CorrectionRuns:
        """The runs of the variable; those of many thresholds are not in memory together."""
        return self.output if self.function is _itself else self.output.of(self.function)

    @classmethod
    def without(
        cls, output: CorrectionRuns, reason: str, function: Function = _itself
    ) -> IndexedVariable:
        """Return a variable without projections, for one reason."""
        return cls(output, {}, dict.fromkeys((FIRST_ORDER, TOTAL_ORDER), reason), function)


@dataclass(frozen=True)
class IndexedVariables:
    """Folds of real runs, with the projections of their fits.

    Parameters
    ----------
    draws : SurrogateDraws
        Of the fit to all training runs; its model has scalar outputs.
    folds : sequence of FoldFit
    """

    draws: SurrogateDraws
    folds: Sequence[FoldFit]

    def of_output(
        self, quantity: QuantityOfInterest, runs: CorrectionRuns
    ) -> dict[str, tuple[IndexedVariable, ...]]:
        """Return the variables of an output, by the beginning of the names of their indices."""
        name = quantity.output.name
        output = self._variable(name, _itself, runs, is_fitted=not self._is_log(name))
        found: dict[str, tuple[IndexedVariable, ...]] = {"": (output,)}
        if self._is_log(name):
            found[OF_LOGARITHM] = (self._logarithm(name, runs),)
        found[OF_EXCEEDANCE] = tuple(
            replace(self._variable(name, exceeds, runs, is_fitted=False), is_event=True)
            for exceeds in (_event(each.value) for each in quantity.thresholds)
        )
        return found

    def _is_log(self, output: str) -> bool:
        return output in self.draws.model.logarithms

    def _logarithm(self, output: str, runs: CorrectionRuns) -> IndexedVariable:
        if not (runs.values > 0).all():
            return IndexedVariable.without(runs, texts.NOT_POSITIVE_IN_RUNS)
        return self._variable(output, np.log, runs, is_fitted=True)

    def _variable(
        self,
        output: str,
        function: Function,
        runs: CorrectionRuns,
        *,
        is_fitted: bool,
    ) -> IndexedVariable:
        """Return a function of an output, which may be the variable that was fitted."""
        variable = runs if function is _itself else runs.of(function)
        if runs.placed:
            reason = texts.NO_INDICES_OF_PLACED.format(placed=runs.placed)
            return IndexedVariable.without(runs, reason, function)
        if not np.isfinite(variable.draws).all():
            return IndexedVariable.without(runs, texts.NOT_FINITE_PREDICTIONS)
        if is_fitted and (terms := self._from_terms(output, variable)):
            return terms
        joint, draws = self.draws.joint, self._projections
        if joint.conditional_reason:
            return IndexedVariable.without(runs, joint.conditional_reason, function)
        parts = {FIRST_ORDER: draws.first_order(output, function, variable)}
        if not joint.is_independent:
            return IndexedVariable(runs, parts, {TOTAL_ORDER: texts.DEPENDENT_INPUTS}, function)
        parts[TOTAL_ORDER] = draws.total_order(output, function, variable)
        return IndexedVariable(runs, parts, {}, function)

    def _from_terms(self, output: str, variable: CorrectionRuns) -> IndexedVariable | None:
        """Return the variable with the terms of all fits; None where these are not known."""
        if not (self.draws.joint.is_independent and self.draws.all_are_admissible):
            return None
        known = [each for fold in self.folds if (each := _terms(fold, output))]
        if len(known) < len(self.folds):
            return None
        alone, in_all, first, total, moments = zip(*known, strict=True)
        parts = {
            FIRST_ORDER: InputParts(np.concatenate(alone), np.array(first)),
            TOTAL_ORDER: InputParts(np.concatenate(in_all), np.array(total)),
        }
        return IndexedVariable(replace(variable, exact_moments=np.array(moments)), parts, {})

    @cached_property
    def _projections(self) -> FoldProjections:
        return FoldProjections(self.draws, self.folds)


def _terms(fold: FoldFit, output: str) -> tuple[FloatArray, ...] | None:
    """Return the parts of the inputs at the runs of a fold, their mean squares, and moments."""
    forms = fold.model
    if not isinstance(forms, ClosedForms):
        return None
    if output not in fold.model.logarithms and not forms.has_closed_form(output):
        return None
    found = forms.closed_form_parts(output, fold.inputs(fold.completed))
    if found is None:
        return None
    mean, std = forms.closed_form_moments(output)
    shares = forms.closed_form_indices(output)
    return *found, shares.first * std**2, shares.total * std**2, np.array([mean, std])


def _event(limit: float) -> Function:
    """Return a function for the event that an output exceeds a value; NaN for an output of NaN."""
    return lambda values: np.where(np.isnan(values), np.nan, values > limit)
