"""Design that a surrogate goes on with, round by round, where it expects to err."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.labels import REFINED_FOR, RUN, SAMPLING, STATUS, WEIGHT
from uqpen.core.model import Model
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Extension, Rounds
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.monte_carlo import MonteCarlo, independent_points
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.surrogate import Surrogate

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.surrogates.fitting import CrossFit

# Candidates for each point.
_CANDIDATES = 64
# A round makes at most this part of the runs before it, so that later ones know more.
_ROUND_PART = 2


@dataclass(frozen=True, eq=False)
class RefinedModel:
    """A model of a study, with the outputs whose surrogate is to be refined."""

    model: Model
    given: Mapping[str, float]  # values of its inputs that replace those of the study, in SI units
    targets: tuple[RefinedOutput, ...]


@dataclass(frozen=True)
class RefinedDesign(Design):
    """Independent draws, and then rounds of points where a surrogate expects to err."""

    sampling = Sampling.INDEPENDENT

    initial: MonteCarlo  # the first round, with a fixed number of runs
    name: str  # the name of the surrogate
    surrogate: Surrogate
    runs: int  # number of runs after the first round
    models: Mapping[str, RefinedModel]  # the models of the study, which all run all points
    constraints: tuple[Constraint, ...] = ()  # of the inputs

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
        from uqpen.surrogates.fitting import cross_fit, fit_surrogate, is_built_in

        runs = join_rounds(rounds).assign_attrs({SAMPLING: str(self.sampling)})
        fitted = fit_surrogate(
            self.surrogate,
            self.name,
            runs,
            model.model,
            joint,
            stream,
            has_ending_curves=False,
        )
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


# Settings of a refinement: how many further runs, and which estimates they are to sharpen.

FOR_MEAN, FOR_PROBABILITIES = "mean", "probabilities"


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """Further runs of the design that a surrogate is fitted to."""

    # Number of further runs; without it, there are none.
    refine: int | None = count(minimum=10, maximum=100_000, default=None)
    # What they sharpen: ``"mean"``, the corrected means of all outputs, or ``"probabilities"``,
    # those of the thresholds of the study.
    refine_for: str = choice(FOR_MEAN, FOR_PROBABILITIES, default=FOR_MEAN)


@dataclass(frozen=True)
class RefinedOutput:
    """An output whose estimates are to be sharpened."""

    output: str  # its name
    # Thresholds whose probabilities are meant, in its SI unit; its mean where there are none.
    limits: tuple[float, ...] = ()


# Errors of a surrogate where there are no runs: its fits disagree, as much as they err at runs.
#
# References
# ----------
# Seung, H. S., Opper, M. & Sompolinsky, H. (1992). Proc. COLT '92, 287-294 (query by committee).


@dataclass(frozen=True, eq=False)
class PredictedError:
    """Expected square of the error that a run corrects, at candidates for further runs."""

    # (candidate,): of an output, or of whether it exceeds a threshold: then the probability of a
    # disagreement.
    squares: FloatArray
    is_of_event: bool  # true for a threshold


def predicted_errors(
    folds: CrossFit, runs: xr.Dataset, candidates: Arrays, targets: Sequence[RefinedOutput]
) -> Iterator[PredictedError]:
    """Yield the errors that the fits to parts of the runs suggest at candidates.

    A target that some fit does not have, or for which the fits do not disagree, is left out.

    Parameters
    ----------
    folds : CrossFit
        The fits without a fold of the runs each.
    candidates : mapping of str to ndarray, shape (candidate,)
        Admissible inputs in SI units.
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


# Random placement of runs where errors are expected, with weights that keep estimates unbiased.
#
# Each point is drawn from candidates of its own, which are draws of the inputs. So points are
# independent, and the weight of a point is the mean of the placement's density over its candidates,
# over that at the point: its expectation is exactly 1.
#
# References
# ----------
# Zrnic, T. & Candès, E. J. (2024). Proc. ICML 235, 62993-63010 (active statistical inference);
# Hesterberg, T. (1995). Technometrics 37, 185-194 (defensive mixtures).

# Shares of the points that are drawn as the inputs are; a weight is at most one over the share.
_SHARES = (0.8, 0.6, 0.4)

# A placement is used where the variance that it promises is at most this part of that of draws.
_CLEARLY_SMALLER = 0.9


@dataclass(frozen=True, eq=False)
class Placement:
    """Chosen candidates."""

    candidates: IntArray  # (point,): their numbers among all candidates
    weights: FloatArray  # (point,): density of the inputs over that of the placement
    share: float  # share of the points that were drawn as the inputs are
    gain: float  # the promised variance of the evidence, over that of as many draws of the inputs


def place(
    errors: Sequence[PredictedError],
    points: int,
    each: int,
    heaviest: float,
    rng: np.random.Generator,
) -> Placement:
    """Choose points among candidates, more of them where errors are expected.

    The share of plain draws is the one whose interval promises to be the narrowest.

    Parameters
    ----------
    errors : sequence of PredictedError
        At ``points * each`` candidates; without any, points are plain draws.
    points, each : int
        Number of points, and of the candidates of each.
    heaviest : float
        The largest weight of the runs so far.
    """
    shape = (points, each)
    uniform = rng.random((points, 1))
    relative = _relative_density(errors, shape)
    gains = {
        share: np.mean([_gain(error, share + (1 - share) * relative, heaviest) for error in errors])
        for share in _SHARES
        if errors
    }
    share = min(gains, key=lambda each: gains[each], default=1.0)
    if not gains or gains[share] > _CLEARLY_SMALLER:
        return Placement(np.arange(points) * each, np.ones(points), 1.0, 1.0)
    density = share + (1 - share) * relative
    chosen = (density.cumsum(axis=1) > uniform * each).argmax(axis=1)
    rows = np.arange(points)
    return Placement(rows * each + chosen, 1 / density[rows, chosen], share, float(gains[share]))


def _relative_density(errors: Sequence[PredictedError], shape: tuple[int, int]) -> FloatArray:
    """Return the best density for the sum of all scaled errors, over that of the inputs."""
    found = np.zeros(shape)
    for error in errors:
        size = np.sqrt(error.squares).reshape(shape)
        found += size / (size.mean() or 1.0)
    mean = found.mean(axis=1, keepdims=True)
    # Where nothing is expected of any candidate, all are alike.
    return np.divide(found, mean, out=np.ones(shape), where=mean > 0)


def _gain(error: PredictedError, density: FloatArray, heaviest: float) -> float:
    """Return the promised variance of an estimate, over that with plain draws.

    The interval of a probability counts a disagreement of either kind that no run has shown, at
    the largest weight.
    """
    squares, points = error.squares.reshape(density.shape), len(density)
    unseen = [2 * max(heaviest, 1 / density.min()) ** 2, 2 * heaviest**2]
    with_it, without = points * (squares / density).mean(), points * squares.mean()
    if error.is_of_event:
        with_it, without = with_it + unseen[0], without + unseen[1]
    return float(with_it / without)
