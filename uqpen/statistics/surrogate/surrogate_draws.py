"""Draws of a surrogate, in any number, since an evaluation costs almost nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import xarray as xr

from uqpen.core.labels import SAMPLING, STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.designs.rounds import first_round
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics import texts
from uqpen.statistics.surrogate.pick_freeze_pairs import PickFreezePairs, draw_pick_freeze_pairs
from uqpen.surrogates.fitted_surrogate import ClosedForms, FittedSurrogate

__all__ = ["SurrogateDraws"]

# Enough that the error of sampling is far below that of the fit.
_SAMPLE = SobolSequence(runs=65_536, replicates=16)


@dataclass(frozen=True)
class SurrogateDraws:
    """A fitted surrogate with the joint distribution of its inputs.

    Parameters
    ----------
    model : FittedSurrogate
    joint : JointDistribution
    constraints : sequence of Constraint
        Bounds of the joint distribution.
    given : mapping of str to float
        Values of fixed inputs that replace those of the joint distribution.
    stream : Stream
        Source of the random numbers.
    """

    model: FittedSurrogate
    joint: JointDistribution
    constraints: Sequence[Constraint]
    given: Mapping[str, float]
    stream: Stream

    @cached_property
    def runs(self) -> xr.Dataset:
        """Runs of the surrogate at a sample of the joint distribution."""
        points = first_round(_SAMPLE, self.joint, self.stream.child("sample")).assign(self.given)
        runs = evaluate(self._evaluator, points, {})
        return runs.assign_attrs({SAMPLING: str(_SAMPLE.sampling)})

    @cached_property
    def pairs(self) -> PickFreezePairs:
        """Pairs of draws for all sets of inputs."""
        return draw_pick_freeze_pairs(self._evaluator, self.joint, self.given, self.stream)

    @cached_property
    def all_are_admissible(self) -> bool:
        """True if no draw of the sample is inadmissible."""
        return not bool((self.runs[STATUS].values == Status.INADMISSIBLE).any())

    @cached_property
    def closed_forms(self) -> ClosedForms | None:
        """The surrogate's closed forms, if it has any; None if a draw is inadmissible."""
        is_whole = isinstance(self.model, ClosedForms) and self.all_are_admissible
        return cast(ClosedForms, self.model) if is_whole else None

    def closed_forms_of_output(self, output: str) -> ClosedForms | None:
        """Return the closed forms if they are those of an output; None for draws in their place."""
        forms = self.closed_forms
        return forms if forms is not None and forms.has_closed_form(output) else None

    def closed_forms_of_logarithm(self) -> ClosedForms | None:
        """Return the closed forms if they are those of a logarithm that was fitted."""
        return self.closed_forms if self.joint.is_independent else None

    @property
    def sampling_estimator(self) -> str:
        """Text on the estimation of statistics from the sample."""
        drawn = int((self.runs[STATUS].values == Status.OK).sum())
        return texts.FROM_DRAWS.format(draws=drawn)

    @property
    def pairs_estimator(self) -> str:
        """Text on the estimation of indices from the pairs."""
        if self.joint.conditional_reason:
            return texts.NO_PAIRS
        pairs = len(next(iter(self.pairs.first.values())))
        return texts.FROM_PAIRS.format(pairs=pairs)

    @property
    def estimand(self) -> str:
        """Text on the distribution of the indices, and on first-order ones with dependence."""
        estimand = texts.ESTIMAND if self.all_are_admissible else texts.ESTIMAND_IF_ADMISSIBLE
        if self.joint.is_independent:
            return estimand
        return f"{estimand}; {texts.FIRST_ORDER_INCLUDES}"

    @cached_property
    def _evaluator(self) -> Evaluator:
        return Evaluator(self.model, self.constraints)
