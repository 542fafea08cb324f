"""The methods of a study that can meet: its designs, scaled to each budget."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import xarray as xr

from uqpen.designs.design import Design
from uqpen.head_to_head.bench import Bench
from uqpen.inputs.law import InputLaw
from uqpen.labels import REPLICATED, SINGLE
from uqpen.streams import Stream
from uqpen.study.study import Study
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["DesignMethod", "Method", "Spent", "SurrogateMethod", "methods_of"]

# Fitting takes ever longer, and a surrogate is there to do with few runs.
_MOST_WITH_SURROGATE = 1024

# Runs of a check for each of the training, where the study names no design for it, or a larger one
# than that of the training, which then serves more than the check.
_USUAL_CHECK = 0.2


class Spent(NamedTuple):
    """What a method does with a budget.

    Attributes
    ----------
    runs : int
        How many it makes: no more than the budget; 0 where it cannot do with so few.
    replicates : int
        In how many replicates; 1 where there are none.
    """

    runs: int
    replicates: int


@dataclass(frozen=True)
class Method(ABC):
    """What makes estimates out of a budget of runs.

    Parameters
    ----------
    source : str
        The study's name of what it is.
    variants : tuple of str
        The contests it is in: `SINGLE`, `REPLICATED` or both.
    """

    source: str
    variants: tuple[str, ...]

    @abstractmethod
    def spent(self, budget: int) -> Spent:
        """What it does with a budget."""

    @abstractmethod
    def answers(self, bench: Bench, budget: int, stream: Stream) -> dict[str, xr.Dataset]:
        """Its estimates from one budget of new runs, as groups of an archive have them.

        Parameters
        ----------
        bench : Bench
            Makes and analyses the runs.
        budget : int
            Of which `spent` says that it suffices.
        stream : Stream
            Where its random numbers come from.
        """

    def is_like(self, other: Method, budgets: Sequence[int]) -> bool:
        """Whether it would make the same runs as another, but for their random numbers."""
        return False

    @property
    def name(self) -> str:
        """What it is called; a space keeps it apart from every name that a study can give."""
        return self.source if SINGLE in self.variants else f"{self.source} {REPLICATED}"


@dataclass(frozen=True)
class DesignMethod(Method):
    """A design of the study, scaled.

    Parameters
    ----------
    source, variants
        As of `Method`.
    design : Design
        As the study has it.
    law : InputLaw
        The study's inputs.
    """

    design: Design
    law: InputLaw

    def spent(self, budget: int) -> Spent:
        """The scaled design's runs and replicates."""
        scaled = self._scaled(budget)
        if scaled is None:
            return Spent(0, 0)
        return Spent(scaled.size(self.law), getattr(scaled, "replicates", 1))

    def answers(self, bench: Bench, budget: int, stream: Stream) -> dict[str, xr.Dataset]:
        """What the runs of the scaled design tell."""
        scaled = self._scaled(budget)
        assert scaled is not None
        return bench.answers(bench.runs(scaled, stream))

    def is_like(self, other: Method, budgets: Sequence[int]) -> bool:
        """Whether both are the same once they are scaled."""
        if not isinstance(other, DesignMethod):
            return False
        return all(self._scaled(budget) == other._scaled(budget) for budget in budgets)

    def _scaled(self, budget: int) -> Design | None:
        return self.design.scaled(self.law, budget, replicated=SINGLE not in self.variants)


@dataclass(frozen=True)
class SurrogateMethod(Method):
    """A surrogate of the study, its training and its check scaled in proportion.

    The check is charged and not made: it tells whether to trust the estimates, and changes none.

    Parameters
    ----------
    source, variants
        As of `Method`.
    surrogate : Surrogate
        As the study has it.
    training : Design
        What it is fitted to.
    share : float
        The part of a budget that the training takes.
    law : InputLaw
        The study's inputs.
    """

    surrogate: Surrogate
    training: Design
    share: float
    law: InputLaw

    def spent(self, budget: int) -> Spent:
        """Training and check together."""
        scaled = self._scaled(budget)
        if scaled is None:
            return Spent(0, 0)
        return Spent(scaled.size(self.law) + budget - self._trained(budget), 1)

    def answers(self, bench: Bench, budget: int, stream: Stream) -> dict[str, xr.Dataset]:
        """What the surrogate tells that is fitted to the scaled training."""
        scaled = self._scaled(budget)
        assert scaled is not None
        runs = bench.runs(scaled, stream.child("training"))
        fitted = self.surrogate.fit(self.source, runs, bench.study.model, self.law, stream)
        return bench.answers_of_surrogate(fitted, stream)

    def _trained(self, budget: int) -> int:
        return round(self.share * budget)

    def _scaled(self, budget: int) -> Design | None:
        if budget > _MOST_WITH_SURROGATE:
            return None
        return self.training.scaled(self.law, self._trained(budget), replicated=False)


def methods_of(study: Study, budgets: Sequence[int]) -> tuple[Method, ...]:
    """The methods of a study that can do with at least one of the budgets.

    What has no replicates is in both contests: a design of independent points, say. Of designs that
    are the same once they are scaled, the first stands for all.

    Parameters
    ----------
    study : Study
        Whose designs and surrogates they are.
    budgets : sequence of int
        What they may spend.
    """
    found: list[Method] = []
    for method in (*_design_methods(study, budgets), *_surrogate_methods(study)):
        can_do = any(method.spent(budget).runs for budget in budgets)
        if can_do and not any(method.is_like(other, budgets) for other in found):
            found.append(method)
    return tuple(found)


def _design_methods(study: Study, budgets: Sequence[int]) -> Iterator[Method]:
    # What only serves a surrogate comes last, so that it does not stand for a design like it.
    serving = {name for each in study.surrogates.values() for name in (each.design, each.check)}
    for name in sorted(study.designs, key=lambda name: name in serving):
        design = study.designs[name]
        replicated = DesignMethod(name, (REPLICATED,), design, study.law)
        has_both = any(replicated.spent(budget).runs for budget in budgets)
        contests = (SINGLE,) if has_both else (SINGLE, REPLICATED)
        yield DesignMethod(name, contests, design, study.law)
        if has_both:
            yield replicated


def _surrogate_methods(study: Study) -> Iterator[Method]:
    for name, surrogate in study.surrogates.items():
        training = study.designs[surrogate.design]
        checked = _USUAL_CHECK
        if surrogate.check is not None:
            proportion = study.designs[surrogate.check].size(study.law) / training.size(study.law)
            checked = proportion if proportion <= 1 else _USUAL_CHECK
        share = 1 / (1 + checked)
        yield SurrogateMethod(name, (SINGLE, REPLICATED), surrogate, training, share, study.law)
