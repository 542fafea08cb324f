"""Methods of a benchmark: the designs and surrogates of a study, scaled to each budget."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from uqpen.benchmark.runner import BenchmarkRunner
from uqpen.benchmark.statistics import Estimates
from uqpen.core.labels import REPLICATED, SINGLE
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.study import Study
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["BenchmarkMethod", "DesignMethod", "MethodCost", "SurrogateMethod", "study_methods"]

# Fitting takes ever longer, and a surrogate is there to do with few runs.
_MOST_WITH_SURROGATE = 1024

# Runs of a check for each of the training, where the study names no design for it, or a larger one
# than that of the training, which then serves more than the check.
_DEFAULT_CHECK = 0.2


class MethodCost(NamedTuple):
    """Cost of a method at a budget.

    Attributes
    ----------
    runs : int
        Number of runs, at most the budget; 0 where the budget is too small.
    replicates : int
        Number of replicates; 1 for a method without replicates.
    """

    runs: int
    replicates: int


@dataclass(frozen=True)
class BenchmarkMethod(ABC):
    """Method that makes estimates from a budget of runs.

    Parameters
    ----------
    source : str
        The name of its design or surrogate in the study.
    variants : tuple of str
        The comparisons that it takes part in: `SINGLE`, `REPLICATED` or both.
    """

    source: str
    variants: tuple[str, ...]

    @abstractmethod
    def cost(self, budget: int) -> MethodCost:
        """Return its numbers of runs and replicates at a budget."""

    @abstractmethod
    def estimates(self, runner: BenchmarkRunner, budget: int, stream: Stream) -> Estimates:
        """Return its estimates from one budget of new runs, by output and statistic.

        Parameters
        ----------
        runner : BenchmarkRunner
            Makes and analyses the runs.
        budget : int
            Number of runs; sufficient according to `cost`.
        stream : Stream
            Source of its random numbers.
        """

    def is_equivalent(self, other: BenchmarkMethod, budgets: Sequence[int]) -> bool:
        """Return True if it would make the same runs as another, except for random numbers."""
        return False

    @property
    def name(self) -> str:
        """Name of the method; it contains a space if it is not a name in the study."""
        return self.source if SINGLE in self.variants else f"{self.source} {REPLICATED}"


@dataclass(frozen=True)
class DesignMethod(BenchmarkMethod):
    """A design of the study, scaled.

    Parameters
    ----------
    source, variants
        As of `BenchmarkMethod`.
    design : Design
        As the study has it.
    joint : JointDistribution
        The study's inputs.
    """

    design: Design
    joint: JointDistribution

    def cost(self, budget: int) -> MethodCost:
        """Return the numbers of runs and replicates of the scaled design."""
        scaled = self._scaled(budget)
        if scaled is None:
            return MethodCost(0, 0)
        return MethodCost(scaled.run_count(self.joint), scaled.replicate_count)

    def estimates(self, runner: BenchmarkRunner, budget: int, stream: Stream) -> Estimates:
        """Return the estimates from the runs of the scaled design."""
        scaled = self._scaled(budget)
        assert scaled is not None
        return runner.estimates(runner.run_design(scaled, stream))

    def is_equivalent(self, other: BenchmarkMethod, budgets: Sequence[int]) -> bool:
        """Return True if both designs are equal once they are scaled."""
        if not isinstance(other, DesignMethod):
            return False
        return all(self._scaled(budget) == other._scaled(budget) for budget in budgets)

    def _scaled(self, budget: int) -> Design | None:
        return self.design.scaled(self.joint, budget, replicated=SINGLE not in self.variants)


@dataclass(frozen=True)
class SurrogateMethod(BenchmarkMethod):
    """A surrogate of the study, with its training and validation runs scaled in proportion.

    The validation runs count as cost but are not made: they show whether to trust the estimates,
    and change none.

    Parameters
    ----------
    source, variants
        As of `BenchmarkMethod`.
    surrogate : Surrogate
        As the study has it.
    training : Design
        The design that it is fitted to.
    share : float
        The share of a budget for the training.
    joint : JointDistribution
        The study's inputs.
    """

    surrogate: Surrogate
    training: Design
    share: float
    joint: JointDistribution

    def cost(self, budget: int) -> MethodCost:
        """Training and check together."""
        scaled = self._scaled(budget)
        if scaled is None:
            return MethodCost(0, 0)
        return MethodCost(scaled.run_count(self.joint) + budget - self._training_budget(budget), 1)

    def estimates(self, runner: BenchmarkRunner, budget: int, stream: Stream) -> Estimates:
        """Return the estimates of the surrogate, fitted to the scaled training."""
        scaled = self._scaled(budget)
        assert scaled is not None
        runs = runner.run_design(scaled, stream.child("training"))
        fitted = self.surrogate.fit(self.source, runs, runner.study.model, self.joint, stream)
        return runner.surrogate_estimates(fitted, stream)

    def _training_budget(self, budget: int) -> int:
        return round(self.share * budget)

    def _scaled(self, budget: int) -> Design | None:
        if budget > _MOST_WITH_SURROGATE:
            return None
        return self.training.scaled(self.joint, self._training_budget(budget), replicated=False)


def study_methods(study: Study, budgets: Sequence[int]) -> tuple[BenchmarkMethod, ...]:
    """Return the methods of a study that can use at least one of the budgets.

    A method without replicates, such as a design of independent points, is in both comparisons. If
    several designs are equal once they are scaled, the first represents all.

    Parameters
    ----------
    study : Study
        The study with the designs and surrogates.
    budgets : sequence of int
        Numbers of runs.
    """
    found: list[BenchmarkMethod] = []
    for method in (*_design_methods(study, budgets), *_surrogate_methods(study)):
        can_do = any(method.cost(budget).runs for budget in budgets)
        if can_do and not any(method.is_equivalent(other, budgets) for other in found):
            found.append(method)
    return tuple(found)


def _design_methods(study: Study, budgets: Sequence[int]) -> Iterator[BenchmarkMethod]:
    # What only serves a surrogate comes last, so that it does not stand for a design like it.
    serving = {name for each in study.surrogates.values() for name in (each.design, each.check)}
    for name in sorted(study.designs, key=lambda name: name in serving):
        design = study.designs[name]
        replicated = DesignMethod(name, (REPLICATED,), design, study.joint)
        has_both = any(replicated.cost(budget).runs for budget in budgets)
        variants = (SINGLE,) if has_both else (SINGLE, REPLICATED)
        yield DesignMethod(name, variants, design, study.joint)
        if has_both:
            yield replicated


def _surrogate_methods(study: Study) -> Iterator[BenchmarkMethod]:
    for name, surrogate in study.surrogates.items():
        training = study.designs[surrogate.design]
        checked = _DEFAULT_CHECK
        if surrogate.check is not None:
            proportion = study.designs[surrogate.check].run_count(study.joint) / training.run_count(
                study.joint
            )
            checked = proportion if proportion <= 1 else _DEFAULT_CHECK
        share = 1 / (1 + checked)
        yield SurrogateMethod(name, (SINGLE, REPLICATED), surrogate, training, share, study.joint)
