"""Projections of each fold's fit, by draws that share inputs with its runs and with each other.

No terms of a fit are needed: the part of an output that an input explains is a conditional mean. At
a run it is the mean over some draws that share the input with the run. They are unbiased, however
few they are. Its mean square follows from pairs of draws that share the input. All draws are
admissible, so that the parts are those of the distribution given admissible, and they may be of
inputs that depend on each other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.execution import Evaluator
from uqpen.statistics.surrogate.conditional_draws import ConditionalDraws
from uqpen.statistics.surrogate.correction.corrected_indices import InputParts
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.fold_fit import FoldFit
from uqpen.statistics.surrogate.pick_freeze_pairs import PickFreezePairs, paired_outputs
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws

__all__ = ["FoldProjections"]

# Draws that share inputs with a run: their scatter, divided by their number, adds to that of the
# errors. Fewer of them for many runs or inputs.
_MOST_DRAWS = 32
_FEWEST_DRAWS = 4
_EVALUATIONS = 2**20


@dataclass(frozen=True)
class FoldProjections:
    """Folds of real runs, with conditional draws of their fits.

    Parameters
    ----------
    draws : SurrogateDraws
        Of the fit to all training runs; its model has scalar outputs.
    folds : sequence of FoldFit
    """

    draws: SurrogateDraws
    folds: Sequence[FoldFit]

    def first_order(
        self, output: str, function: Callable[[FloatArray], FloatArray], runs: CorrectionRuns
    ) -> InputParts:
        """Return conditional means given each input.

        Parameters
        ----------
        output : str
        function : callable
            The indices are of this function of the output.
        runs : CorrectionRuns
            Of the function of the output.
        """
        values, squares = [], []
        for number, (at_runs, pairs) in enumerate(zip(self._at_runs, self._pairs, strict=True)):
            own = runs.predictions[runs.fold == number]
            centre = float(np.nanmean(function(pairs.first[output])))
            means = [_row_means(function(at_runs[each][output]), own) for each in self._single]
            values.append(np.column_stack(means) - centre)
            squares.append([pairs.explained(output, function, each) for each in self._single])
        return _parts(values, squares, runs)

    def total_order(
        self, output: str, function: Callable[[FloatArray], FloatArray], runs: CorrectionRuns
    ) -> InputParts:
        """Return what is left without the conditional means given all other inputs."""
        values, squares = [], []
        for number, (at_runs, pairs) in enumerate(zip(self._at_runs, self._pairs, strict=True)):
            own = runs.predictions[runs.fold == number]
            means = [_row_means(function(at_runs[each][output]), own) for each in self._others]
            values.append(own[:, None] - np.column_stack(means))
            squares.append([pairs.left(output, function, each) for each in self._others])
        return _parts(values, squares, runs)

    @property
    def _single(self) -> list[int]:
        """Sets of one input each, as bits."""
        return [1 << number for number in range(len(self.draws.joint.random))]

    @property
    def _others(self) -> list[int]:
        """Sets of all inputs but one."""
        whole = (1 << len(self.draws.joint.random)) - 1
        return [whole ^ each for each in self._single]

    @cached_property
    def _conditional(self) -> ConditionalDraws:
        draws = self.draws
        evaluator = Evaluator(draws.model, draws.constraints)
        return ConditionalDraws(evaluator, draws.joint, draws.given, draws.stream.child("indices"))

    @cached_property
    def _pairs(self) -> list[PickFreezePairs]:
        subsets = sorted({0, *self._single, *self._others})
        return paired_outputs(self._conditional, [*map(self._evaluator, self.folds)], subsets)

    def _evaluator(self, fold: FoldFit) -> Evaluator:
        return Evaluator(fold.model, self.draws.constraints)

    @cached_property
    def _at_runs(self) -> list[dict[int, Mapping[str, FloatArray]]]:
        """Outputs of each fold's fit, by shared inputs, each of shape (run, draw)."""
        return [self._at_runs_of(number, fold) for number, fold in enumerate(self.folds)]

    def _at_runs_of(self, number: int, fold: FoldFit) -> dict[int, Mapping[str, FloatArray]]:
        subsets = sorted({*self._single, *self._others})
        runs = sum(each.size for each in self.folds)
        affordable = _EVALUATIONS // (len(subsets) * max(runs, 1))
        count = 1 << min(max(affordable, _FEWEST_DRAWS), _MOST_DRAWS).bit_length() - 1
        rng = self._conditional.stream.generator("runs", number)
        unit = sobol_points(rng, max(fold.size, 1) * count, len(self._single))
        unit = unit[: fold.size * count]
        given = {name: np.repeat(each, count) for name, each in fold.inputs(fold.completed).items()}
        points = self._conditional.probabilities(given, unit)
        names = list(given)
        found: dict[int, Mapping[str, FloatArray]] = {}
        for subset in subsets:
            some = [each for each in range(len(names)) if subset >> each & 1]
            sample = self._conditional.draw(
                unit,
                {each: points[:, each] for each in some},
                f"run {number}, {subset}",
                {names[each]: given[names[each]] for each in some},
            )
            outputs = self._evaluator(fold)(sample.inputs).outputs
            found[subset] = {name: each.reshape(-1, count) for name, each in outputs.items()}
        return found


def _row_means(values: FloatArray, otherwise: FloatArray) -> FloatArray:
    """Return the means over the draws of each run; another value for a run without any."""
    is_known = np.isfinite(values)
    count = is_known.sum(axis=1)
    sums = np.where(is_known, values, 0.0).sum(axis=1)
    return np.where(count > 0, sums / np.maximum(count, 1), otherwise)


def _parts(
    values: Sequence[FloatArray], squares: Sequence[Sequence[FloatArray]], runs: CorrectionRuns
) -> InputParts:
    """Return the parts of all folds, with the scatter of mean squares, (fold, input, replicate)."""
    found = np.array(squares)
    pooled = np.tensordot(runs.shares, found, axes=1)
    error = pooled.std(axis=-1, ddof=1) / np.sqrt(pooled.shape[-1])
    return InputParts(np.concatenate(values), found.mean(axis=-1), error)
