"""Joint distribution of a model's inputs: fixed inputs, random inputs, and draws of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from graphlib import TopologicalSorter
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.files import FileSnapshot
from uqpen.core.formulas import Formula
from uqpen.core.labels import (
    DEPENDENCE,
    DERIVED_FROM,
    DERIVED_INPUT,
    INTERVAL_ENDS,
    PARAMETER_INTERVALS,
    ROLE,
    RUN,
)
from uqpen.core.model import Input
from uqpen.core.variables import label_attributes
from uqpen.distributions.copulas import Dependence
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution, UnloadedDistribution
from uqpen.distributions.input_group import InputGroup
from uqpen.distributions.univariate import Uniform
from uqpen.distributions.unknowns import FittedParameters, ParameterBox, Unknown

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class FixedInput:
    """An input with one value, in its SI unit."""

    variable: Input
    value: float
    display_unit: str

    @property
    def nominal(self) -> float:
        """Value of the input."""
        return self.value


@dataclass(frozen=True)
class RandomInput:
    """An input with a distribution over its SI unit."""

    variable: Input
    distribution: Distribution
    display_unit: str
    description: str = ""  # the distribution as its author wrote it
    # Number of measurements and goodness of fit, if the distribution follows from measurements.
    fit: Mapping[str, str | int | float] = field(default_factory=dict, hash=False)
    files: tuple[FileSnapshot, ...] = ()  # files of those measurements
    # What is not known of its distribution, which then is the one that points are drawn from.
    unknown: Unknown | None = None

    @property
    def nominal(self) -> float:
        """Median: the one value that exists for every distribution and lies inside its support."""
        return self.distribution.median


@dataclass(frozen=True)
class MeasuredDependence:
    """Rows of a file to which a copula is fitted."""

    description: str  # their number, and how well it fits
    warning: str  # that it does not fit; empty if it does
    file: FileSnapshot


@dataclass(frozen=True)
class DerivedInput:
    """An input that follows from others by a formula, so that the others stay independent."""

    variable: Input
    formula: Formula  # of inputs, in SI units
    display_unit: str


@dataclass(frozen=True)
class IntervalInput:
    """An input with two known ends, in its SI unit, and no distribution."""

    variable: Input
    lower: float
    upper: float
    display_unit: str
    description: str = ""  # the interval as its author wrote it

    @property
    def nominal(self) -> float:
        """Middle of the interval."""
        return (self.lower + self.upper) / 2


@dataclass(frozen=True)
class JointDistribution:
    """Joint distribution of a study's inputs, in the model's order.

    It is a product of independent parts: inputs by themselves, the inputs of a copula, and groups
    of inputs that have a joint distribution of their own.
    """

    # At most one of each name.
    inputs: tuple[FixedInput | RandomInput | DerivedInput | IntervalInput, ...]
    # All inputs of the model: a table of points may give some that the study does not.
    variables: tuple[Input, ...]
    # The copula of some of the random inputs; the others are independent.
    dependence: Dependence | None = None
    # Joint distributions of further inputs, which have entries as all random inputs have.
    groups: tuple[InputGroup, ...] = ()
    measured_dependence: MeasuredDependence | None = None  # what the copula is fitted to

    @property
    def fixed(self) -> tuple[FixedInput, ...]:
        """The inputs with one value."""
        return tuple(entry for entry in self.inputs if isinstance(entry, FixedInput))

    @property
    def random(self) -> tuple[RandomInput, ...]:
        """The inputs with a distribution."""
        return tuple(entry for entry in self.inputs if isinstance(entry, RandomInput))

    @property
    def intervals(self) -> tuple[IntervalInput, ...]:
        """The inputs that are known by an interval; together these are a box."""
        return tuple(entry for entry in self.inputs if isinstance(entry, IntervalInput))

    def over_box(self) -> JointDistribution:
        """Return the joint distribution with intervals as uniform inputs, for a search alone."""
        return replace(
            self,
            inputs=tuple(
                RandomInput(each.variable, Uniform(each.lower, each.upper), each.display_unit)
                if isinstance(each, IntervalInput)
                else each
                for each in self.inputs
            ),
        )

    @property
    def boxes(self) -> dict[str, ParameterBox]:
        """The parameters that are intervals, by the random input that has them."""
        found = {each.variable.name: each.unknown for each in self.random}
        return {name: each for name, each in found.items() if isinstance(each, ParameterBox)}

    @property
    def fitted(self) -> dict[str, FittedParameters]:
        """The parameters that are uncertain, as they follow from specimens, by random input."""
        found = {each.variable.name: each.unknown for each in self.random}
        return {name: each for name, each in found.items() if isinstance(each, FittedParameters)}

    def at(self, distributions: Mapping[str, Distribution]) -> JointDistribution:
        """Return the joint distribution at values of its unknowns.

        Parameters
        ----------
        distributions : mapping of str to Distribution
            By input, its distribution there.
        """
        found = [
            replace(each, distribution=distributions[each.variable.name], unknown=None)
            if isinstance(each, RandomInput) and each.variable.name in distributions
            else each
            for each in self.inputs
        ]
        return replace(self, inputs=tuple(found))

    @cached_property
    def derived(self) -> tuple[DerivedInput, ...]:
        """The inputs that follow from others, each behind those that its formula names."""
        found = {each.variable.name: each for each in self.inputs if isinstance(each, DerivedInput)}
        sources = {name: sorted(each.formula.names & found.keys()) for name, each in found.items()}
        # A study with a cycle is refused.
        return tuple(found[name] for name in TopologicalSorter(sources).static_order())

    def with_derived(self, values: Arrays) -> dict[str, FloatArray]:
        """Return values of inputs with those that follow from them and are not among them."""
        found = dict(values)
        for each in self.derived:
            if each.variable.name not in found and each.formula.names <= found.keys():
                found[each.variable.name] = each.formula.values(found)
        return found

    def following(self, kept: Collection[str]) -> Callable[[Arrays], dict[str, FloatArray]] | None:
        """Return a function that computes the inputs that follow from others, but for some.

        Values of them that it gets are nominal ones, say. None where there is nothing to compute.
        """
        again = {each.variable.name for each in self.derived} - {*kept}
        if not again:
            return None
        return lambda values: self.with_derived(
            {name: column for name, column in values.items() if name not in again}
        )

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        """Snapshots of the files from which its distributions follow."""
        own = [file for entry in self.random for file in entry.files]
        if self.measured_dependence is not None:
            own.append(self.measured_dependence.file)
        return (*own, *(file for group in self.groups for file in group.files))

    @property
    def is_independent(self) -> bool:
        """True if the random inputs are independent of each other."""
        return self.dependence is None and not self.groups

    @property
    def dependence_text(self) -> str:
        """Text on the dependence between inputs; empty where they are independent."""
        parts = [self.dependence, *self.groups] if self.dependence else self.groups
        texts = [str(part) for part in parts]
        if self.measured_dependence is not None:
            texts[0] += f", {self.measured_dependence.description}"
        return "; ".join(texts)

    @property
    def conditional_reason(self) -> str:
        """Reason why inputs cannot be drawn given some of them; empty where they can."""
        return next((group.conditional_reason for group in self.groups), "")

    @property
    def implicit_inputs(self) -> tuple[str, ...]:
        """Random inputs whose own distribution is not known, apart from the others."""
        return tuple(name for group in self.groups if not group.marginals for name in group.inputs)

    def nominal(self) -> dict[str, float]:
        """Return one value for each input: the fixed one, the median, or the middle of an interval.

        An input whose distribution is not loaded has none.
        """
        entries: Iterable[FixedInput | RandomInput | IntervalInput]
        entries, unloaded = (*self.fixed, *self.random, *self.intervals), self.unloaded
        found = {
            entry.variable.name: np.array(entry.nominal)
            for entry in entries
            if entry.variable.name not in unloaded
        }
        of_all = self.with_derived(found)
        names = (entry.variable.name for entry in self.inputs)
        return {name: float(of_all[name]) for name in names if name in of_all}

    @property
    def unloaded(self) -> dict[str, str]:
        """Names of the distributions that are not loaded, by input."""
        return {
            entry.variable.name: entry.distribution.name
            for entry in self.random
            if isinstance(entry.distribution, UnloadedDistribution)
        }

    def points(self, unit: FloatArray, coordinates: Arrays) -> xr.Dataset:
        """Map points of the unit cube to the input space.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Independent probabilities, one column for each random input in order.
        coordinates : mapping of str to ndarray, shape (run,)
            Coordinates of the design for an analysis, such as the replicate.
        """
        values = self.ppf(self.conditional_probabilities(unit, {}))
        return points_dataset(self, values, coordinates, runs=len(unit))

    def conditional_probabilities(
        self, unit: FloatArray, given: Mapping[int, FloatArray]
    ) -> FloatArray:
        """Draw probabilities of the random inputs, given those of some of them.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Independent probabilities; the columns of given inputs are ignored.
        given : mapping of int to ndarray, shape (run,)
            By position in `random`, the probability below each given value: 0.5 for a median.
            If empty, draws are of the joint distribution itself. Where there is a
            `conditional_reason`, it must be empty.

        Returns
        -------
        ndarray, shape (run, random input)
            Argument for `ppf`. Given columns are unchanged, and those of independent inputs and of
            groups too.
        """
        points = np.clip(unit, *OPEN_INTERVAL)
        for position, column in given.items():
            points[:, position] = np.clip(column, *OPEN_INTERVAL)
        if self.dependence is None:
            return points
        names = [entry.variable.name for entry in self.random]
        joined = [names.index(name) for name in self.dependence.inputs]
        among = {joined.index(key): column for key, column in given.items() if key in joined}
        points[:, joined] = self.dependence.inverse_rosenblatt(points[:, joined], among)
        return points

    def ppf(self, probabilities: FloatArray) -> dict[str, FloatArray]:
        """Return the random inputs' values in SI units, from their probabilities.

        Parameters
        ----------
        probabilities : ndarray, shape (run, random input)
            Probability below the value, for each input by itself; for the inputs of a group, its
            coordinates in the unit cube.
        """
        inside = np.clip(probabilities, *OPEN_INTERVAL)
        columns = dict(zip((entry.variable.name for entry in self.random), inside.T, strict=True))
        grouped = {name: group for group in self.groups for name in group.inputs}
        values = dict[str, FloatArray]()
        for entry in self.random:
            name = entry.variable.name
            if name not in grouped:
                values[name] = entry.distribution.ppf(columns[name])
            elif name not in values:
                group = grouped[name]
                unit = np.column_stack([columns[each] for each in group.inputs])
                values |= dict(zip(group.inputs, group.values(unit).T, strict=True))
        return {name: values[name] for name in columns}

    def reason_without_density(self, names: Collection[str]) -> str:
        """Reason why some inputs have no density that is known; empty where they have one."""
        for group in self.groups:
            if named := [name for name in group.inputs if name in names]:
                return f"{group.description} has no density (of {', '.join(named)})"
        for entry in self.random:
            name, distribution = entry.variable.name, entry.distribution
            if name in names and distribution.log_density(np.zeros(1)) is None:
                what = getattr(distribution, "name", type(distribution).__name__)
                return f"the distribution of {name} ({what}) has no density"
            joined = self.dependence is not None and name in self.dependence.inputs
            if joined and distribution.is_discrete and {*self.dependence.inputs} & {*names}:  # type: ignore[union-attr]
                return f"{name} is discrete, and a copula joins it: they have no density together"
        return ""

    def log_density(self, values: Arrays, names: Collection[str]) -> FloatArray:
        """Return the logarithm of the density of some random inputs, for a ratio of densities.

        Parameters
        ----------
        values : mapping of str to ndarray, shape (run,)
            Of all random inputs, in SI units.
        names : collection of str
            The inputs; they have no `reason_without_density`. A copula that joins some of them is
            taken at all its inputs.

        Returns
        -------
        ndarray, shape (run,)
            Of a discrete input it is that of its probability. -inf where there is none.
        """
        chosen = [entry for entry in self.random if entry.variable.name in names]
        total = np.zeros(np.shape(next(iter(values.values()))))
        for entry in chosen:
            found = entry.distribution.log_density(np.asarray(values[entry.variable.name]))
            assert found is not None  # see `reason_without_density`
            total = total + found
        if self.dependence is not None and {*self.dependence.inputs} & {*names}:
            by_name = {entry.variable.name: entry.distribution for entry in self.random}
            below = [by_name[name].cdf(np.asarray(values[name])) for name in self.dependence.inputs]
            inside = np.clip(np.column_stack(below), *OPEN_INTERVAL)
            total = np.where(np.isneginf(total), total, total + self.dependence.log_density(inside))
        return total


def points_dataset(
    joint: JointDistribution, values: Arrays, coordinates: Arrays, *, runs: int
) -> xr.Dataset:
    """Return points as a dataset; fixed inputs that `values` does not contain are added."""
    import xarray as xr

    fixed = {entry.variable.name: entry.value for entry in joint.fixed}
    derived = {entry.variable.name: entry.formula.text for entry in joint.derived}
    of_all = joint.with_derived(
        {name: np.array(each) for name, each in fixed.items()} | dict(values)
    )
    fits = {entry.variable.name: entry.fit for entry in joint.random}
    ends: dict[str, dict[str, Any]] = {
        each.variable.name: {INTERVAL_ENDS: np.array([each.lower, each.upper])}
        for each in joint.intervals
    }
    for name, box in joint.boxes.items():
        ends[name] = {PARAMETER_INTERVALS: " and ".join(box.ends)}
    variables: dict[str, Any] = {}
    # One of several models may not take an input, which is described all the same.
    for variable in joint.variables:
        name = variable.name
        attributes = {
            "long_name": variable.title,
            ROLE: "input",
            "units": variable.unit,
            "display_units": variable.preferred_unit,
            **fits.get(name, {}),
            **ends.get(name, {}),
            **label_attributes(variable),
        }
        if name in derived and name in of_all and name not in values:
            attributes |= {ROLE: DERIVED_INPUT, DERIVED_FROM: derived[name]}
            is_fixed = np.ndim(of_all[name]) == 0
            variables[name] = (() if is_fixed else RUN, of_all[name], attributes)
        elif name in values:
            variables[name] = (RUN, values[name], attributes)
        elif name in fixed:
            variables[name] = ((), fixed[name], attributes)
    indexes = {name: (RUN, column) for name, column in coordinates.items()}
    points = xr.Dataset(variables, {RUN: np.arange(runs), **indexes})
    if text := joint.dependence_text:
        points.attrs[DEPENDENCE] = text
    return points


# One in so many studies of independent inputs has a larger correlation by chance.
_CHANCE = 1e-4
# A weaker one changes the variance of a sum of two inputs by less than a tenth.
_WEAK = 0.1


class Agreement(NamedTuple):
    """Comparison of points with a joint distribution by one number."""

    inputs: tuple[str, ...]  # the input, or the two inputs of a correlation
    value: float  # Kolmogorov's distance, or Spearman's rank correlation
    # Probability that as many independent draws of the joint distribution depart as far.
    p_value: float

    @property
    def is_contradiction(self) -> bool:
        """True for a departure that is neither chance nor too small to matter."""
        return self.p_value < _CHANCE and abs(self.value) >= _WEAK


def input_agreements(
    joint: JointDistribution, points: Mapping[str, FloatArray]
) -> Iterator[Agreement]:
    """Compare each random input with its distribution, by the Kolmogorov-Smirnov test.

    The points are in SI units. An input with a discrete distribution, or whose distribution is not
    known by itself, is left out.
    """
    unknown = {*joint.unloaded, *joint.implicit_inputs}
    for entry in joint.random:
        name = entry.variable.name
        if name in unknown or name not in points or entry.distribution.is_discrete:
            continue
        tested = scipy.stats.kstest(points[name], entry.distribution.cdf)
        yield Agreement((name,), float(tested.statistic), float(tested.pvalue))


def largest_correlation(
    joint: JointDistribution, points: Mapping[str, FloatArray]
) -> Agreement | None:
    """Return the largest rank correlation of two random inputs that are stated independent.

    Its probability is that of the largest among all pairs (Bonferroni). None where the study states
    a dependence, or fewer than two inputs vary.
    """
    # Codes of texts have no order.
    names = [entry.variable.name for entry in joint.random if not entry.variable.labels]
    names = [name for name in names if name in points and np.ptp(points[name]) > 0]
    runs = len(points[names[0]]) if names else 0
    if not joint.is_independent or len(names) < 2 or runs < 3:
        return None
    ranks = np.array([scipy.stats.rankdata(points[name]) for name in names])
    correlations = np.corrcoef(ranks)
    pairs = list(combinations(range(len(names)), 2))
    first, second = max(pairs, key=lambda pair: abs(correlations[pair]))
    value = float(correlations[first, second])
    with np.errstate(divide="ignore"):
        t = abs(value) * np.sqrt((runs - 2) / np.float64(max(1 - value**2, 0.0)))
    p_value = min(1.0, len(pairs) * 2 * float(scipy.stats.t.sf(t, runs - 2)))
    return Agreement((names[first], names[second]), value, p_value)
