"""Design that a surrogate goes on with, round by round, where it expects to err."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import REFINED_FOR, RUN, SAMPLING, WEIGHT
from uqpen.core.model import Model
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.designs.design import Design, Extension, Rounds
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.monte_carlo import MonteCarlo, independent_points
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.refinement.refinement import RefinedOutput
from uqpen.surrogates.surrogate import Surrogate

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.surrogates.refinement.predicted_errors import PredictedError

__all__ = ["RefinedDesign", "RefinedModel"]

# Candidates for each point.
_CANDIDATES = 64
# A round makes at most this part of the runs before it, so that later ones know more.
_ROUND_PART = 2


@dataclass(frozen=True, eq=False)
class RefinedModel:
    """A model of a study, with the outputs whose surrogate is to be refined.

    Parameters
    ----------
    model : Model
    given : mapping of str to float
        Values of its inputs that replace those of the study, in SI units.
    targets : tuple of RefinedOutput
    """

    model: Model
    given: Mapping[str, float]
    targets: tuple[RefinedOutput, ...]


@dataclass(frozen=True)
class RefinedDesign(Design):
    """Independent draws, and then rounds of points where a surrogate expects to err.

    Parameters
    ----------
    initial : MonteCarlo
        The first round, with a fixed number of runs.
    name : str
        The name of the surrogate.
    surrogate : Surrogate
    runs : int
        Number of runs after the first round.
    models : mapping of str to RefinedModel
        The models of the study, which all run all points.
    constraints : tuple of Constraint
        Of the inputs.
    """

    sampling = Sampling.INDEPENDENT

    initial: MonteCarlo
    name: str
    surrogate: Surrogate
    runs: int
    models: Mapping[str, RefinedModel]
    constraints: tuple[Constraint, ...] = ()

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        drawn = points_in_memory(next(self.initial.rounds(joint, stream)))
        feedback = yield self._weighted(drawn, np.ones(drawn.sizes[RUN]))
        made = [feedback.runs]
        for number, size in enumerate(self._sizes(drawn.sizes[RUN]), 1):
            own = stream.child("refinement", self.name, number)
            feedback = yield self._next_points(made, size, joint, own)
            made.append(feedback.runs)

    def run_count(self, joint: JointDistribution) -> int:
        return self.initial.run_count(joint) + self.runs

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if isinstance(earlier, RefinedDesign):
            earlier = earlier.initial
        return self.initial.extension(earlier, joint)

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> MonteCarlo | None:
        return self.initial.scaled(joint, runs, replicated=replicated)

    def _sizes(self, first: int) -> Iterator[int]:
        """Yield the numbers of runs of the rounds after the first."""
        made, end = first, first + self.runs
        while made < end:
            size = min(max(made // _ROUND_PART, 1), end - made)
            yield size
            made += size

    def _weighted(self, points: xr.Dataset, weights: FloatArray) -> xr.Dataset:
        weighted = points.assign_coords({WEIGHT: (RUN, weights)})
        return weighted.assign_attrs({REFINED_FOR: self.name})

    @one_blas_thread()
    def _next_points(
        self,
        made: Sequence[Mapping[str, xr.Dataset]],
        size: int,
        joint: JointDistribution,
        stream: Stream,
    ) -> xr.Dataset:
        """Return the points of a round, given the runs of those before by model."""
        from uqpen.surrogates.refinement.placement import place

        candidates = self._candidates(size * _CANDIDATES, joint, stream)
        each = candidates.sizes[RUN] // size
        if not each:
            plain = points_in_memory(independent_points(joint, stream.child("plain"), 0, size))
            return self._weighted(plain, np.ones(size))
        candidates = candidates.isel({RUN: slice(each * size)})
        errors: list[PredictedError] = []
        for name, model in self.models.items():
            rounds = [runs[name] for runs in made]
            errors += self._errors(model, rounds, candidates, joint, stream)
        heaviest = max(float(runs[WEIGHT].max()) for by_model in made for runs in by_model.values())
        placed = place(errors, size, each, heaviest, stream.generator("placement"))
        points = candidates.isel({RUN: placed.candidates}).assign_coords({RUN: np.arange(size)})
        return self._weighted(points, placed.weights)

    def _candidates(self, count: int, joint: JointDistribution, stream: Stream) -> xr.Dataset:
        """Return draws of the inputs that are admissible to all models."""
        from uqpen.execution import Evaluator

        drawn = points_in_memory(independent_points(joint, stream.child("candidates"), 0, count))
        is_admissible = np.ones(count, dtype=np.bool_)
        for each in self.models.values():
            columns = _columns(drawn.assign(each.given))
            for violated, _ in Evaluator(each.model, self.constraints).violations(columns):
                is_admissible &= ~np.asarray(violated, dtype=np.bool_)
        return drawn.isel({RUN: np.flatnonzero(is_admissible)})

    def _errors(
        self,
        model: RefinedModel,
        rounds: Sequence[xr.Dataset],
        candidates: xr.Dataset,
        joint: JointDistribution,
        stream: Stream,
    ) -> Iterator[PredictedError]:
        """Yield the errors that are expected of a model's surrogate."""
        from uqpen.execution import join_rounds
        from uqpen.surrogates.cross_fitting import cross_fit
        from uqpen.surrogates.fitting import fit_surrogate, is_built_in
        from uqpen.surrogates.refinement.predicted_errors import predicted_errors

        runs = join_rounds(rounds).assign_attrs({SAMPLING: str(self.sampling)})
        fitted = fit_surrogate(self.surrogate, self.name, runs, model.model, joint, stream)
        again = self.surrogate.for_refits(fitted.without_fields)
        folds = cross_fit(again, self.name, runs, model.model, joint, stream)
        try:
            yield from predicted_errors(folds, runs, _columns(candidates), model.targets)
        except (Exception, SystemExit):
            # Of a user-defined surrogate that cannot predict, nothing is known.
            if is_built_in(self.surrogate):
                raise


def _columns(points: xr.Dataset) -> dict[str, FloatArray]:
    """Return the inputs of points, each with a value for each point."""
    size = points.sizes[RUN]
    return {str(name): np.broadcast_to(points[name], size) for name in points.data_vars}
