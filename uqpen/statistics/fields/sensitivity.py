"""Sensitivity measures at each place of a field, and of the field as a whole."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import OF_FIELD, RUN
from uqpen.core.model import Output
from uqpen.designs.saltelli import MATRIX_A, MATRIX_B
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.fields.field_sample import (
    FieldSample,
    equal_columns,
    input_place_array,
    joined_places,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import SampleShape
from uqpen.statistics.sensitivity.given_data import (
    LocalRegressions,
    SampledVariable,
    VarianceParts,
    indices_name,
)
from uqpen.statistics.sensitivity.input_measures import input_array
from uqpen.statistics.sensitivity.local_regression import ResidualVariance
from uqpen.statistics.sensitivity.single_steps import elementary_effects, relative_responses
from uqpen.statistics.sensitivity.sobol_indices import (
    INDEX_ORDERS,
    BlockVariable,
    IndexTerms,
    PickFreezeBlocks,
)

__all__ = [
    "DistanceShape",
    "effects_at_places",
    "first_order_at_places",
    "responses_at_places",
    "sobol_indices_at_places",
]

# The shape of the distances of runs from the mean of a field.


class DistanceShape(SampleShape):
    """The shape of distances, which are deviations from a mean as they are."""

    @cached_property
    def mean(self) -> FloatArray:
        """Zero."""
        return np.zeros(self.sample.values.shape[:-1])


# First-order indices from any sample, at each place of a field and of the field as a whole.

# Values that go through an input together: few enough for the cache of a processor.
_VALUES_TOGETHER = 2**18


def first_order_at_places(
    sample: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """First-order indices of a field: at each place, and weighted by the variance over all places.

    A field has no indices of its logarithm or of events.

    Yields
    ------
    name : str
        ``first_order``; ``generalized_first_order``, the share of the field's variance, which is
        the mean over its places.
    estimate : DataArray
        Along the dimensions of the field, ``input`` and ``bound``; the generalized ones along
        ``input`` and ``bound``.

    References
    ----------
    Lamboni, M., Monod, H. & Makowski, D. (2011). Reliab. Eng. Syst. Saf. 96, 450-459.
    Gamboa, F., Janon, A., Klein, T. & Lagnoux, A. (2014). Electron. J. Stat. 8, 575-603.
    """
    inputs, level = sample.runs.inputs, sample.runs.level
    if not inputs:
        return
    whole = _FieldRegressions(sample)
    at_places = whole.place_indices()
    title = indices_name(quantity.output.title, sample.runs)
    yield "first_order", input_place_array(at_places, quantity.output, inputs, title, level)
    generalized = whole.generalized_indices(at_places)
    yield (
        "generalized_first_order",
        input_array(generalized, inputs, f"generalized {title}", level=level),
    )


@dataclass(frozen=True)
class _Distances(SampledVariable):
    """Distances of runs from the mean of a field, in place of a variable."""

    has_ends: bool = False

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of their tail."""
        return DistanceShape(self.sample)

    @property
    def _is_wider(self) -> bool:
        # Where curves end the noise of pairs is counted twice.
        return super()._is_wider or self.has_ends


@dataclass(eq=False)
class _InputSums:
    """Sums over the places of a field, each with its weight, about the lines of one input.

    Parameters
    ----------
    squares : ndarray, shape (run,)
        Squared distances of the runs from the mean of the field.
    influence, left_influence : ndarray, shape (run,)
        Influence of each run on `variance` and on `left`, of mean 0.
    variance, left : float
        The variance, and its part that the input does not explain.
    products : ndarray, shape (bin, slot, slot)
        Pair products.
    """

    squares: FloatArray
    influence: FloatArray
    left_influence: FloatArray
    variance: float = 0.0
    left: float = 0.0
    products: FloatArray = field(default_factory=lambda: np.zeros(1))

    def add(self, places: _Part, lines: ResidualVariance, parts: VarianceParts) -> None:
        """Add places that exist in some of the runs."""
        runs, weights = places.runs, places.weights
        self.variance += float((weights * parts.total).sum())
        self.left += float((weights * parts.left).sum())
        squares, left = (
            np.einsum("v,vr->r", weights, each) for each in (parts.squares, parts.left_influence)
        )
        # A mean over a part of the runs: the others have no influence on it.
        fold = len(self.squares) / len(squares)
        if fold == 1:
            self.products = self.products + lines.pair_products(weights)
        self.squares[runs] += squares
        self.influence[runs] += fold * (squares - squares.mean())
        self.left_influence[runs] += fold * (left - left.mean())

    def parts(self, pair_noise: float) -> VarianceParts:
        """Return the parts of the variance of the whole field."""
        total, left, noise = map(np.asarray, (self.variance, self.left, pair_noise))
        return VarianceParts(total, left, self.influence, self.left_influence, noise)


@dataclass(frozen=True, eq=False)
class _Part:
    """Places of a field that go through an input together.

    Parameters
    ----------
    places : ndarray of int, shape (place,)
        By their positions in the field, flattened.
    runs : ndarray of int, shape (run,)
        The runs in which they exist, by their positions in the field.
    regressions : LocalRegressions
        Of these runs.
    variable : SampledVariable
        The values at each place.
    weights : ndarray, shape (place,)
        Variance at each place, times its part of the grid.
    """

    places: IntArray
    runs: IntArray
    regressions: LocalRegressions
    variable: SampledVariable
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class _FieldRegressions:
    """The runs of a field, put together by each of their inputs."""

    field: FieldSample

    @cached_property
    def sums(self) -> list[_InputSums]:
        """Sums over all places for each input, complete after `place_indices`."""
        size = self.field.runs.size
        return [_InputSums(*np.zeros((3, size))) for _ in self.field.runs.inputs]

    @cached_property
    def regressions(self) -> LocalRegressions:
        """All runs, put together by each of their inputs."""
        return LocalRegressions(self.field.runs)

    @cached_property
    def has_ends(self) -> bool:
        """True if not all places exist in all runs."""
        return not bool(self.field.exists.all())

    @cached_property
    def unit(self) -> float:
        """Range of the values; squares of values over it do not overflow."""
        matrix = self.field.matrix
        spread = float(np.fmax.reduce(matrix, axis=None) - np.fmin.reduce(matrix, axis=None))
        return spread if spread > 0 else 1.0

    def place_indices(self) -> Estimate:
        """Estimate the indices at each place, and add the places up."""
        return Estimate.joined(
            (part.places, part.regressions.indices(part.variable, partial(self._add, part)))
            for part in self._parts()
        )

    def _add(
        self, places: _Part, column: int, lines: ResidualVariance, parts: VarianceParts
    ) -> None:
        self.sums[column].add(places, lines, parts)

    def generalized_indices(self, at_places: Estimate) -> list[Estimate]:
        """Estimate the indices of the field as a whole, where those at its places are known."""
        first = at_places[0].each()
        return [
            self._generalized_index(column, sums) if sums.variance > 0 else first[column]
            for column, sums in enumerate(self.sums)
        ]

    def _generalized_index(self, column: int, sums: _InputSums) -> Estimate:
        distances = replace(self.field.runs, values=np.sqrt(sums.squares))
        regressions = self.regressions
        # Where curves end, the bins of places differ, and the noise of pairs is counted twice.
        noise = 0.0 if self.has_ends else regressions.bins(column).pair_noise(sums.products)
        variable = _Distances(distances, has_ends=self.has_ends)
        found = regressions.estimates(
            variable, sums.parts(noise), lambda _: np.array([self._halved_share(column)])
        )
        (estimate,) = regressions.with_note(found).each()
        return estimate

    def _halved_share(self, column: int) -> float:
        """Return the share of the field's variance that bins of half the size explain."""
        explained = 0.0
        for part in self._parts():
            if not part.variable.too_few_runs:
                everywhere = np.ones(len(part.places), dtype=np.bool_)
                shares = part.regressions.halved_shares(part.variable, column, everywhere)
                explained += float((part.weights * part.variable.variance * shares).sum())
        return explained / self.sums[column].variance

    def _parts(self) -> Iterator[_Part]:
        for group in self.field.samples():
            regressions = LocalRegressions(group.runs) if self.has_ends else self.regressions
            runs = np.flatnonzero(self.field.exists[:, group.places[0]])
            size = max(_VALUES_TOGETHER // max(group.runs.size, 1), 1)
            for start in range(0, len(group.places), size):
                places = group.places[start : start + size]
                values = group.runs.values[start : start + size]
                variable = SampledVariable(replace(group.runs, values=values))
                yield _Part(places, runs, regressions, variable, self._weights(places, variable))

    def _weights(self, places: IntArray, variable: SampledVariable) -> FloatArray:
        if variable.too_few_runs:
            return np.zeros(len(places))
        return self.field.weights[places] * (variable.shape.std / self.unit) ** 2


# Sobol' indices from pick-freeze blocks, at each place of a field and of the field as a whole.


def sobol_indices_at_places(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Sobol' indices of a field: at each place, and weighted by the variance over all places.

    Where curves end, a block counts at the places that all of its curves reach. A place that fewer
    than half of the blocks reach has no indices. A field has no second-order indices, and none of
    its logarithm or of events.

    Yields
    ------
    name : str
        ``first_order``, ``total_order``, ``generalized_first_order``, ``generalized_total_order``.
    estimate : DataArray
        Along the dimensions of the field, ``input`` and ``bound``; the generalized ones along
        ``input`` and ``bound``.

    References
    ----------
    Lamboni, M., Monod, H. & Makowski, D. (2011). Reliab. Eng. Syst. Saf. 96, 450-459.
    Gamboa, F., Janon, A., Klein, T. & Lagnoux, A. (2014). Electron. J. Stat. 8, 575-603.
    """
    blocks = PickFreezeBlocks.from_runs(runs)
    values = runs[quantity.output.name].values.astype(np.float64)
    field = _Field(
        blocks, quantity.output, values.reshape(len(values), -1), quantity.confidence_level
    )
    inputs, level = blocks.layout.inputs, quantity.confidence_level
    sums = _FieldSums.of_none(blocks)
    for order, at_places in field.indices(sums).items():
        title = f"{INDEX_ORDERS[order]} Sobol' indices of {quantity.output.title}"
        array = input_place_array(at_places, quantity.output, inputs, title, level)
        yield order, array.assign_attrs(blocks.attributes)
        whole = field.whole_indices(order, sums) if sums.weight else at_places[0].each()
        generalized = input_array(whole, inputs, f"generalized {title}", level=level)
        yield f"{OF_FIELD}{order}", generalized.assign_attrs(blocks.attributes)


@dataclass(frozen=True, eq=False)
class _Places:
    """Places of a field that the same blocks reach, and where it varies.

    Parameters
    ----------
    reached : ndarray of bool, shape (block,)
        Which of all blocks reach them.
    variable : BlockVariable
        The values at each place, over these blocks.
    weights : ndarray, shape (place,)
        Variance at each place, times its part of the grid.
    """

    reached: BoolArray
    variable: BlockVariable
    weights: FloatArray

    def sum(self, terms: FloatArray) -> FloatArray:
        """Sum terms, shape (place, block), by the weights of places, as terms of all blocks."""
        found = np.zeros(len(self.reached))
        found[self.reached] = np.einsum("p,pb->b", self.weights, terms)
        return found * (len(self.reached) / terms.shape[-1])

    def indices(self, terms: IndexTerms) -> Estimate:
        """Return an index at each place, with a note on blocks that do not reach it."""
        note = "" if self.reached.all() else texts.ENDED_BLOCKS
        return self.variable.estimates(terms).with_note(note)


@dataclass(eq=False)
class _IndexSums:
    """Sums over the places of a field, each with its weight, of the terms of one index."""

    numerator: FloatArray
    informative: BoolArray
    value: float = 0.0

    def add(self, places: _Places, terms: IndexTerms) -> None:
        """Add some places."""
        self.value += float((places.weights * terms.value).sum())
        self.numerator += places.sum(terms.numerator)
        self.informative[places.reached] |= terms.informative.any(axis=0)


@dataclass(eq=False)
class _FieldSums:
    """Sums over the places of a field, each with its weight.

    Parameters
    ----------
    of_indices : dict of str to list of _IndexSums
        For each order and input.
    squares : ndarray, shape (matrix, block)
        Squared distances of the points A and B from the mean of the field.
    weight : float
        Sum of the weights.
    """

    of_indices: dict[str, list[_IndexSums]]
    squares: FloatArray
    weight: float = 0.0

    @classmethod
    def of_none(cls, blocks: PickFreezeBlocks) -> _FieldSums:
        """Return the sums over no place."""
        size, inputs = blocks.count, range(blocks.layout.dimension)
        return cls(
            {
                order: [_IndexSums(np.zeros(size), np.zeros(size, np.bool_)) for _ in inputs]
                for order in INDEX_ORDERS
            },
            np.zeros((2, size)),
        )

    def add(self, places: _Places) -> None:
        """Add the variance of some places."""
        self.weight += float(places.weights.sum())
        self.squares += [places.sum(each**2) for each in places.variable.drawn]


@dataclass(frozen=True)
class _WholeField(BlockVariable):
    """A field over blocks, whose values are the distances of the runs from its mean."""

    denominator: FloatArray = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of the distances."""
        return DistanceShape(self.sample)

    @property
    def _denominator(self) -> FloatArray:
        return self.denominator


@dataclass(frozen=True, eq=False)
class _Field:
    """A field over the runs of blocks, whose values have shape (run, place)."""

    blocks: PickFreezeBlocks
    output: Output
    values: FloatArray
    level: float

    def indices(self, sums: _FieldSums) -> dict[str, Estimate]:
        """Estimate the indices of each order, of shape (place, input), and add the places up."""
        found: dict[str, list[tuple[IntArray, Estimate]]] = {each: [] for each in INDEX_ORDERS}
        for positions, part in self._parts():
            if isinstance(part, _Places):
                sums.add(part)
            for order, vectors in found.items():
                vectors.append((positions, self._indices(order, part, len(positions), sums)))
        return {order: Estimate.joined(vectors) for order, vectors in found.items()}

    def _indices(self, order: str, part: _Places | str, places: int, sums: _FieldSums) -> Estimate:
        """Return indices at some places; a text is the reason why these have none."""
        of_inputs = sums.of_indices[order]
        if isinstance(part, str):
            return Estimate.without_bounds(np.full((places, len(of_inputs)), np.nan), part)
        columns = []
        for i, sum_of_input in enumerate(of_inputs):
            terms: IndexTerms = getattr(part.variable, f"{order}_terms")(i)
            columns.append(part.indices(terms))
            sum_of_input.add(part, terms)
        return Estimate.stacked(columns)

    def whole_indices(self, order: str, sums: _FieldSums) -> list[Estimate]:
        """Estimate the indices of the field as a whole from the sums over its places."""
        distances = np.full(len(self.values), np.nan)
        for matrix, row in zip((MATRIX_A, MATRIX_B), sums.squares, strict=True):
            distances[self.blocks.rows[matrix]] = np.sqrt(row)
        variance = sums.squares.mean(axis=0)
        whole = _WholeField(self.blocks, distances, level=self.level, denominator=variance)
        return [
            estimate
            for each in sums.of_indices[order]
            for estimate in whole.estimates(
                IndexTerms(np.asarray(each.value / sums.weight), each.numerator, each.informative)
            ).each()
        ]

    def _parts(self) -> Iterator[tuple[IntArray, _Places | str]]:
        """Yield places by their positions, or the reason why they have no indices."""
        exists = ~np.isnan(self.values)
        reached = np.logical_and.reduce([exists[part] for part in self.blocks.rows.values()])
        for group in equal_columns(reached):
            blocks = self.blocks.subset(reached[:, group[0]])
            if 2 * blocks.count < self.blocks.count:
                yield group, texts.FEW_BLOCKS_REACH
            elif not blocks.count:
                yield group, texts.NO_BLOCK
            else:
                step = max(_VALUES_TOGETHER // len(self.values), 1)
                for start in range(0, len(group), step):
                    part = group[start : start + step]
                    yield from self._varying(part, reached[:, part[0]], blocks)

    def _varying(
        self, places: IntArray, reached: BoolArray, blocks: PickFreezeBlocks
    ) -> Iterator[tuple[IntArray, _Places | str]]:
        # The values of a place next to each other, as sums are then the same as of it alone.
        values = np.ascontiguousarray(self.values[:, places].T)
        varies = ~BlockVariable(blocks, values).sample.is_constant
        if not varies.all():
            yield places[~varies], texts.CONSTANT_OUTPUT
        if varies.any():
            variable = BlockVariable(blocks, values[varies], level=self.level)
            weights = (
                self.output.place_weights[places[varies]] * (variable.shape.std / self.unit) ** 2
            )
            yield places[varies], _Places(reached, variable, weights)

    @cached_property
    def unit(self) -> float:
        """Range of the values; squares of values over it do not overflow."""
        completed = [self.values[rows] for rows in self.blocks.rows.values()]
        ends = [
            (np.fmin.reduce(each, axis=None), np.fmax.reduce(each, axis=None)) for each in completed
        ]
        lowest, highest = np.transpose(ends)
        return float(np.fmax.reduce(highest) - np.fmin.reduce(lowest)) or 1.0


# Effects of single steps at each place of a field: elementary effects and responses.


Arrays = Iterator[tuple[str, xr.DataArray]]
DesignAnalysis = Callable[[xr.Dataset, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]


def effects_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> Arrays:
    """Mean, mean absolute value and standard deviation of elementary effects at each place."""
    yield from _at_places(elementary_effects, runs, quantity)


def responses_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> Arrays:
    """Relative responses and contributions at each place, in some units changes, too."""
    yield from _at_places(relative_responses, runs, quantity)


def _at_places(analysis: DesignAnalysis, runs: xr.Dataset, quantity: QuantityOfInterest) -> Arrays:
    """Apply the analysis of a design at each place; a run without a value there has failed."""
    output = quantity.output
    scalar = replace(quantity, output=replace(output, dims=(), may_end=False))
    values = runs[output.name].values.reshape(runs.sizes[RUN], -1)
    others = [name for name, each in runs.data_vars.items() if each.dims != (RUN,)]
    bare = runs.drop_vars(others)
    found: dict[str, list[xr.DataArray]] = {}
    for place in values.T:
        for name, array in analysis(bare.assign({output.name: (RUN, place)}), scalar):
            found.setdefault(name, []).append(array)
    for name, arrays in found.items():
        yield name, joined_places(arrays, output)
