"""The methods of a study at each budget, and the statistics that they are compared by."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import BENCHMARK_STATISTICS, CATALOGUE
from uqpen.core.errors import Problem, SettingsError, toml_text
from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    EXCEEDANCE,
    LOWER_THRESHOLD,
    MOMENTS,
    PROBABILITY,
    QUANTILES,
    REPLICATED,
    SINGLE,
    THRESHOLD,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.streams import Stream
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.rounds import first_round
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import EvaluationOptions, Evaluator, Map, Progress, evaluate
from uqpen.execution.checkpoint import Checkpoint
from uqpen.statistics.analyze import analyze
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import ONLY_MODEL, ValidatedStudy
from uqpen.surrogates.fitting import fit_surrogate
from uqpen.surrogates.surrogate import Surrogate
from uqpen.workflow import run_design

# Settings.

# Powers of two are fair to all: at other numbers of runs, a Sobol' sequence loses its balance.
BUDGETS = (128, 256, 1024, 4096, 8192)
REPEATS = 30

# With fewer repeats nothing shows that a few of them decide an error.
FEWEST_REPEATS = 10

_FEWEST_RUNS, _MOST_RUNS = 8, 10_000_000

# Number of replicates of the reference, each with a power of two of points.
_REPLICATES = 16
_EACH_VECTORIZED = 65_536


@dataclass(frozen=True)
class BenchmarkSettings:
    """Settings of a benchmark, common to all methods."""

    # Numbers of runs. They are sorted, and duplicates are removed.
    budgets: tuple[int, ...] = BUDGETS
    repeats: int = REPEATS  # number of repeats of each method at each budget
    # Least number of runs of the reference; None for a number that depends on the model's speed.
    reference: int | None = None

    def __post_init__(self) -> None:
        if problems := self._problems():
            raise SettingsError(problems)
        object.__setattr__(self, "budgets", tuple(sorted(set(self.budgets))))

    def _problems(self) -> list[Problem]:
        expected = f"whole numbers of runs from {_FEWEST_RUNS} to {_MOST_RUNS:_}"
        found = [
            Problem(("budget",), toml_text(budget), expected)
            for budget in self.budgets
            if not _is_whole_number(budget, _FEWEST_RUNS)
        ]
        if not self.budgets:
            found.append(Problem(("budget",), "none", expected))
        if not _is_whole_number(self.repeats, FEWEST_REPEATS):
            expected = f"a whole number, at least {FEWEST_REPEATS}: fewer do not show the noise"
            found.append(Problem(("repeats",), toml_text(self.repeats), expected))
        fewest = 2 * _REPLICATES
        if self.reference is not None and not _is_whole_number(self.reference, fewest):
            expected = f"a whole number, at least {fewest} and at most {_MOST_RUNS:_}"
            found.append(Problem(("reference",), toml_text(self.reference), expected))
        return found

    def reference_design(self, *, vectorized: bool) -> tuple[int, int]:
        """Return runs and replicates of the reference; runs of a vectorized model are cheap."""
        wanted = self.reference
        if wanted is None:
            largest = _REPLICATES * max(self.budgets)
            wanted = max(_REPLICATES * _EACH_VECTORIZED, largest) if vectorized else largest
        each = -(-wanted // _REPLICATES)
        return _REPLICATES * (1 << (each - 1).bit_length()), _REPLICATES


def _is_whole_number(value: object, fewest: int) -> bool:
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return is_whole and fewest <= value <= _MOST_RUNS  # type: ignore[operator]


# The statistics that methods are compared by.


# Estimate arrays by output and statistic.
Estimates = Mapping[str, Mapping[str, xr.DataArray]]

_COMPARED = tuple(each.name for each in BENCHMARK_STATISTICS)

# The analyses that yield the statistics that are compared.
COMPARED_ANALYSES = (MOMENTS, QUANTILES, EXCEEDANCE)

# Where a value's own size says little, because zero is a place as any other, errors are relative
# to the standard deviation.
_SMALL = 0.01


@dataclass(frozen=True)
class BenchmarkStatistic:
    """A statistic of an output, with one entry or several."""

    quantity: QuantityOfInterest  # the quantity of interest of its output
    name: str  # its name in the catalogue
    # The coordinates of its entries; ``("",)`` for a single entry.
    entries: tuple[float | str, ...] = ("",)

    @property
    def output(self) -> str:
        """The name of its output."""
        return self.quantity.output.name

    @property
    def dimension(self) -> str:
        """The dimension of its entries; empty for a single one."""
        return next(iter(self._described.dims), "")

    @property
    def units(self) -> str:
        """The unit of its values."""
        return self.quantity.output.unit if self._has_unit else DIMENSIONLESS

    @property
    def display_units(self) -> str:
        """The unit to show its values in."""
        return self.quantity.display_unit if self._has_unit else DIMENSIONLESS

    @property
    def _described(self) -> Statistic:
        return CATALOGUE[self.name]

    @property
    def _has_unit(self) -> bool:
        return self._described.unit is not UnitRule.NONE

    def estimates(self, estimates: Estimates) -> FloatArray:
        """Return its estimates out of all, of shape (entry, bound); NaN for missing ones."""
        shape = (len(self.entries), len(BOUNDS))
        array = estimates.get(self.output, {}).get(self.name)
        if array is None:
            return np.full(shape, np.nan)
        return np.asarray(array.values, dtype=np.float64).reshape(shape)

    def error_scale(self, reference: FloatArray, spread: float) -> FloatArray:
        """Return the sizes that errors are relative to, of shape (entry,).

        They follow from the reference's values and the standard deviation of the output.
        """
        size = np.abs(reference)
        if self._described.unit is UnitRule.VALUE:  # may be zero without being small
            size = np.where(size < _SMALL * spread, spread, size)
        return np.where(size > 0, size, 1.0)


def benchmark_statistics(
    quantities: Sequence[QuantityOfInterest],
    names: Sequence[str] = _COMPARED,
) -> Iterator[BenchmarkStatistic]:
    """Yield the statistics of every output that is a number, output by output."""
    for quantity in quantities:
        if not quantity.output.is_number:
            continue
        entries: Mapping[str, tuple[float | str, ...]] = {
            PROBABILITY: tuple(quantity.quantiles),
            THRESHOLD: tuple(threshold.text for threshold in quantity.thresholds),
            LOWER_THRESHOLD: tuple(threshold.text for threshold in quantity.lower_thresholds),
        }
        for name in names:
            along = [entries[dimension] for dimension in CATALOGUE[name].dims]
            if all(along):
                yield BenchmarkStatistic(quantity, name, *along)


# Runs for the methods of a benchmark: the study's model at its inputs, as in the study itself.

# Numbers of runs to measure the duration of one: for a vectorized model, and for another.
_TIMED_VECTORIZED, _TIMED = 4096, 1


@dataclass(frozen=True)
class BenchmarkRunner:
    """Runs and analyses of the single model of a study.

    The map makes batches of runs. The checkpoint has the runs of a round until they are analysed.
    """

    study: ValidatedStudy
    map: Map
    progress: Progress
    checkpoint: Checkpoint

    @property
    def quantities(self) -> tuple[QuantityOfInterest, ...]:
        """The quantities of interest; all benchmarks have the same confidence level."""
        asked = self.study.quantities_of_interest
        return tuple(replace(quantity, confidence_level=LEVEL) for quantity in asked)

    def run_design(self, design: Design, stream: Stream) -> xr.Dataset:
        """Make the runs of a design, in all its rounds."""
        runs = run_design(
            self.study,
            design,
            stream,
            map=self.map,
            progress=self.progress,
            round_checkpoint=lambda model, number: self.checkpoint,
        )
        return runs[ONLY_MODEL]

    def estimates(self, runs: xr.Dataset) -> Estimates:
        """Return the estimates from runs, by output and statistic."""
        return analyze(runs, self.quantities, only=COMPARED_ANALYSES)

    def seconds_per_run(self) -> float:
        """Measure the duration of a run; no estimate depends on it."""
        count = _TIMED_VECTORIZED if self.study.model.vectorized else _TIMED
        evaluator = Evaluator(self.study.model, self.study.constraints)
        stream = Stream(self.study.seed, "head_to_head", "timing")
        # In memory, as the time is that of runs alone.
        points = points_in_memory(first_round(MonteCarlo(count), self.study.joint, stream))
        options = EvaluationOptions(map=self.map)
        # The first time, the model may have to be loaded where it runs.
        evaluate(evaluator, points, {}, options)
        began = time.perf_counter()
        evaluate(evaluator, points, {}, options)
        return (time.perf_counter() - began) / count


# Fitting takes ever longer, and a surrogate is there to do with few runs.
_MOST_WITH_SURROGATE = 1024

# Runs of a check for each of the training, where the study names no design for it, or a larger one
# than that of the training, which then serves more than the check.
_DEFAULT_CHECK = 0.2


class MethodCost(NamedTuple):
    """Cost of a method at a budget."""

    runs: int  # number of runs, at most the budget; 0 where the budget is too small
    replicates: int  # number of replicates; 1 for a method without replicates


@dataclass(frozen=True)
class BenchmarkMethod(ABC):
    """Method that makes estimates from a budget of runs."""

    source: str  # the name of its design or surrogate in the study
    # The comparisons that it takes part in: `SINGLE`, `REPLICATED` or both.
    variants: tuple[str, ...]
    design: Design  # the design of its runs, as the study has it
    joint: JointDistribution  # the study's inputs

    @abstractmethod
    def cost(self, budget: int) -> MethodCost:
        """Return its numbers of runs and replicates at a budget."""

    @abstractmethod
    def estimates(self, runner: BenchmarkRunner, budget: int, stream: Stream) -> Estimates:
        """Return its estimates from one budget of new runs, by output and statistic.

        The budget has to be sufficient according to `cost`. The stream is the source of all its
        random numbers.
        """

    @property
    def name(self) -> str:
        """Name of the method; it contains a space if it is not a name in the study."""
        return self.source if SINGLE in self.variants else f"{self.source} {REPLICATED}"


@dataclass(frozen=True)
class DesignMethod(BenchmarkMethod):
    """A design of the study, scaled."""

    def cost(self, budget: int) -> MethodCost:
        """Return the numbers of runs and replicates of the scaled design."""
        scaled = self.scaled(budget)
        if scaled is None:
            return MethodCost(0, 0)
        return MethodCost(scaled.run_count(self.joint), scaled.replicate_count)

    def estimates(self, runner: BenchmarkRunner, budget: int, stream: Stream) -> Estimates:
        """Return the estimates from the runs of the scaled design."""
        scaled = self.scaled(budget)
        assert scaled is not None
        return runner.estimates(runner.run_design(scaled, stream))

    def scaled(self, budget: int) -> Design | None:
        """Return the design scaled to a budget; None where that is too small."""
        return self.design.scaled(self.joint, budget, replicated=SINGLE not in self.variants)


@dataclass(frozen=True)
class SurrogateMethod(BenchmarkMethod):
    """A surrogate of the study, with its training and validation runs scaled in proportion.

    The validation runs count as cost but are not made: they show whether to trust the estimates,
    and change none.

    Parameters
    ----------
    source, variants, design, joint
        As of `BenchmarkMethod`; the design is that of the training.
    surrogate : Surrogate
        As the study has it.
    share : float
        The share of a budget for the training.
    """

    surrogate: Surrogate
    share: float

    def cost(self, budget: int) -> MethodCost:
        """Return the number of training and validation runs together."""
        scaled = self._scaled(budget)
        if scaled is None:
            return MethodCost(0, 0)
        return MethodCost(scaled.run_count(self.joint) + budget - self._training_budget(budget), 1)

    def estimates(self, runner: BenchmarkRunner, budget: int, stream: Stream) -> Estimates:
        """Return the estimates of the surrogate, fitted to the scaled training."""
        scaled = self._scaled(budget)
        assert scaled is not None
        runs = runner.run_design(scaled, stream.child("training"))
        fitted = fit_surrogate(
            self.surrogate, self.source, runs, runner.study.model, self.joint, stream
        )
        study = runner.study
        given = study.models[ONLY_MODEL].given
        draws = SurrogateDraws(fitted, study.joint, study.constraints, given, stream)
        found = surrogate_statistics(draws, runner.quantities, only=COMPARED_ANALYSES).outputs
        return {
            output: {name: each.where(each[BOUND] == BOUNDS[0]) for name, each in arrays.items()}
            for output, arrays in found.items()
        }

    def _training_budget(self, budget: int) -> int:
        return round(self.share * budget)

    def _scaled(self, budget: int) -> Design | None:
        if budget > _MOST_WITH_SURROGATE:
            return None
        return self.design.scaled(self.joint, self._training_budget(budget), replicated=False)


def study_methods(study: ValidatedStudy, budgets: Sequence[int]) -> tuple[BenchmarkMethod, ...]:
    """Return the methods of a study that can use at least one of the budgets.

    A method without replicates, such as a design of independent points, is in both comparisons. If
    several designs are equal once they are scaled, the first represents all.
    """
    methods: list[BenchmarkMethod] = []
    known: list[list[Design | None]] = []
    for method in _design_methods(study, budgets):
        scaled = [method.scaled(budget) for budget in budgets]
        if scaled not in known:
            known.append(scaled)
            methods.append(method)
    methods += _surrogate_methods(study)
    return tuple(each for each in methods if any(each.cost(budget).runs for budget in budgets))


def _design_methods(study: ValidatedStudy, budgets: Sequence[int]) -> Iterator[DesignMethod]:
    # What only serves a surrogate comes last, so that it does not stand for a design like it.
    serving = {name for each in study.surrogates.values() for name in (each.design, each.check)}
    for name in sorted(study.designs, key=lambda name: name in serving):
        replicated = DesignMethod(name, (REPLICATED,), study.designs[name], study.joint)
        has_both = any(replicated.cost(budget).runs for budget in budgets)
        yield replace(replicated, variants=(SINGLE,) if has_both else (SINGLE, REPLICATED))
        if has_both:
            yield replicated


def _surrogate_methods(study: ValidatedStudy) -> Iterator[SurrogateMethod]:
    joint = study.joint
    for name, surrogate in study.surrogates.items():
        training, check = study.designs[surrogate.design], _DEFAULT_CHECK
        if surrogate.check is not None:
            ratio = study.designs[surrogate.check].run_count(joint) / training.run_count(joint)
            check = ratio if ratio <= 1 else _DEFAULT_CHECK
        variants = (SINGLE, REPLICATED)
        yield SurrogateMethod(name, variants, training, joint, surrogate, 1 / (1 + check))
