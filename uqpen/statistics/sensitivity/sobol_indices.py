"""Sobol' indices from pick-freeze blocks: shares of the inputs in an output's variance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import CONDITIONAL, OF_FIELD, OF_MEAN, PAIR, REPLICATE, ROUND, RUN, STATUS
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.designs.saltelli import MATRIX_A, MATRIX_B, BlockLayout
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import LEVEL, Estimate, NamedArrays
from uqpen.statistics.fields.field_sample import equal_columns
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.intervals import (
    fieller_margins,
    group_sums,
    ratio_error,
    ratio_jackknife_error,
    student_quantile,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import DistanceShape, Sample, SampleShape
from uqpen.statistics.sensitivity.input_measures import (
    function_array,
    input_array,
    input_place_array,
    output_functions,
)

# Complete blocks of a pick-freeze design.


@dataclass(frozen=True)
class PickFreezeBlocks:
    """Complete blocks: those whose runs all completed."""

    layout: BlockLayout  # the parts of a block
    rows: dict[int, IntArray]  # (block,): the number of the run of each part, by the part's matrix
    # (block,): the replicate of each block. Only replicates with a block are numbered.
    replicate: IntArray
    # Attributes of indices from these blocks: numbers of used and dropped blocks, and the joint
    # distribution that the indices refer to.
    attributes: dict[str, int | str]

    @classmethod
    def from_runs(cls, runs: xr.Dataset) -> PickFreezeBlocks:
        """Return the complete blocks in the runs of a design."""
        layout = BlockLayout.from_runs(runs)
        rows = layout.run_numbers(runs)
        status = runs[STATUS].values
        reached = np.array(
            [np.where(part < 0, Status.INADMISSIBLE, status[part]) for part in rows.values()]
        )
        whole = np.flatnonzero((reached == Status.OK).all(axis=0))
        lost = (reached != Status.OK) & (reached != Status.INADMISSIBLE)
        dropped_blocks = int(lost.any(axis=0).sum())
        unsettled = reached.shape[1] - len(whole) - dropped_blocks
        is_conditional = ROUND in runs.coords or (status == Status.INADMISSIBLE).any()
        condition = runs.attrs.get(CONDITIONAL, texts.ADMISSIBLE_INPUTS)
        estimand = texts.ESTIMAND
        if is_conditional:
            estimand = texts.ESTIMAND_IF.format(condition=condition)
        if dropped_blocks:
            estimand += f"; {texts.FAILED_BLOCKS}"
        if unsettled:
            is_absent = CONDITIONAL in runs.attrs  # some of them, of an output that not all have
            estimand += f"; {texts.ABSENT_BLOCKS if is_absent else texts.INADMISSIBLE_BLOCKS}"
        chosen = {number: part[whole] for number, part in rows.items()}
        _, replicate = np.unique(runs[REPLICATE].values[chosen[MATRIX_A]], return_inverse=True)
        attributes: dict[str, int | str] = {
            "estimand": estimand,
            "blocks_used": len(whole),
            "blocks_dropped": reached.shape[1] - len(whole),
        }
        return cls(layout, chosen, replicate.astype(np.int64), attributes)

    def subset(self, chosen: BoolArray) -> PickFreezeBlocks:
        """Return some of the blocks, by a mask."""
        rows = {number: part[chosen] for number, part in self.rows.items()}
        _, replicate = np.unique(self.replicate[chosen], return_inverse=True)
        return replace(self, rows=rows, replicate=replicate.astype(np.int64))

    @property
    def count(self) -> int:
        """Number of complete blocks."""
        return len(self.replicate)

    @property
    def replicate_count(self) -> int:
        """Number of replicates with a complete block."""
        return int(self.replicate.max(initial=-1)) + 1


# A variable over the blocks of a pick-freeze design, and its Sobol' indices.

# The orders of indices of single inputs, with their names in titles.
INDEX_ORDERS = {"first_order": "first-order", "total_order": "total-order"}

# For an event in a seventh of the runs, the coverage of indices was 91 % with 128 blocks.
_ENOUGH_FOR_EVENTS = 500
# With fewer blocks that contribute to an index, replicates do not show its error: for a threshold
# exceeded in 0.8 % of the runs, the coverage of first-order indices was 28 % with 2 048 blocks.
_FEWEST_INFORMATIVE = 10

# A sum of as many standardized values as there ever are is exact to this.
_ROUNDING = 1e-12

# Values of a field that go through an index together: few enough for the cache of a processor.
_VALUES_TOGETHER = 2**18


class IndexTerms(NamedTuple):
    """Terms of an index of a variable with variance 1, the mean of `numerator` over the blocks.

    `numerator` and `informative`, a mask of the blocks that contribute, have shape (..., block).
    """

    numerator: FloatArray
    informative: BoolArray


@dataclass(frozen=True)
class BlockVariable:
    """A variable over the runs of blocks, and its Sobol' indices.

    At places of a field it is a variable at each of them.
    """

    blocks: PickFreezeBlocks
    # (run,): the variable, in any unit. At no place it is constant.
    values: npt.NDArray[Any]
    is_event: bool = False  # true if it is the indicator (0 or 1) of an event
    is_distance: bool = False  # true if its values are distances from a mean
    level: float = LEVEL  # confidence level of the intervals of its indices

    @cached_property
    def sample(self) -> Sample:
        """The points A and B of all blocks, as one sample."""
        drawn = np.concatenate([self.blocks.rows[MATRIX_A], self.blocks.rows[MATRIX_B]])
        everything = np.arange(len(drawn))
        return Sample(
            values=np.take(self.values, drawn, axis=-1).astype(np.float64),
            used=everything,
            missing=everything[:0],
            columns=InputColumns.none(len(drawn)),
            replicates=np.tile(self.blocks.replicate, 2),
            sampling=Sampling.PICK_FREEZE,
        )

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of that sample."""
        return DistanceShape(self.sample) if self.is_distance else self.sample.shape

    @cached_property
    def drawn(self) -> tuple[FloatArray, FloatArray]:
        """Standardized values at the points A and B of each block."""
        return self._values_at(MATRIX_A), self._values_at(MATRIX_B)

    def _values_at(self, matrix: int) -> FloatArray:
        """Standardized values at a part of each block."""
        values = np.take(self.values, self.blocks.rows[matrix], axis=-1)
        mean, scale = (each[..., np.newaxis] for each in (self.shape.mean, self.shape.scale))
        return (values - mean) / scale / self.shape.deviations.std(axis=-1, keepdims=True)

    def indices(self, order: str) -> Estimate:
        """Return the indices of an order: of all inputs, or of all pairs of inputs."""
        layout = self.blocks.layout
        numbers = range(len(layout.pairs) if order == "second_order" else layout.dimension)
        return self._unless_constant(
            lambda: Estimate.stacked(self.estimates(self.terms(order, i)) for i in numbers),
            len(numbers),
        )

    def _unless_constant(self, estimated: Callable[[], Estimate], *shape: int) -> Estimate:
        """Return estimates of a shape, or the reason why there are none."""
        reason = ""
        if not self.blocks.count:
            reason = texts.NO_BLOCK
        elif self.sample.is_constant.all():
            reason = texts.CONSTANT_EVENT if self.is_event else texts.CONSTANT_OUTPUT
        if reason:
            return Estimate.without_bounds(np.full(shape, np.nan), reason)
        return estimated()

    def terms(self, order: str, number: int) -> IndexTerms:
        """Return the terms of the index of an input, or of a pair of inputs, by its number.

        Of the first order it is the share of the variance that would go were the input known
        (Saltelli et al. 2010), of the total order the share that would stay were all others known
        (Jansen 1999, Comput. Phys. Commun. 117, 35-43), of the second order the share of a pair
        beyond their first-order indices (Saltelli 2002).
        """
        (A, B), layout = self.drawn, self.blocks.layout
        if order == "total_order":
            AB = self._values_at(layout.part_sharing_others(number).matrix)
            return IndexTerms((A - AB) ** 2 / 2, A != AB)
        if order == "first_order":
            AB = self._values_at(layout.part_sharing_one(number).matrix)
            numerator = B * (AB - A)
            if not self.is_event:
                return IndexTerms(numerator, numerator != 0)
            # Only pairs of points that share the input and both see the rarer case inform on it.
            side = 1 if self.sample.values.mean() < 0.5 else -1
            return IndexTerms(numerator, (side * B > 0) & (side * AB > 0))
        shared = layout.part_sharing_pair(number)
        assert shared.anchor is not None
        pair, BAj = self._values_at(shared.matrix), self._values_at(shared.anchor)
        ABj, ABk = (
            self._values_at(layout.part_sharing_one(i).matrix) for i in layout.pairs[number]
        )
        numerator = BAj * pair - A * B - B * (ABj - A) - B * (ABk - A)
        return IndexTerms(numerator, numerator != 0)

    @cached_property
    def _denominator(self) -> FloatArray:
        """Contribution of each block to the variance."""
        A, B = self.drawn
        return (A**2 + B**2) / 2

    # Of a model with noise of its own, by both runs A and A' at each point of A. Their noise has
    # nothing in common, so it is not in the mean of a product of them.

    @cached_property
    def _noise(self) -> FloatArray:
        """Contribution of each block to the variance of the noise."""
        return (self.drawn[0] - self._again) ** 2 / 2

    @property
    def _again(self) -> FloatArray:
        """Standardized values of the second runs at the points A."""
        return self._values_at(self.blocks.layout.part_sharing_all().matrix)

    def noise_share(self) -> Estimate:
        """Return the share of the noise in the variance."""
        return self._unless_constant(
            lambda: self.estimates(IndexTerms(self._noise, self._noise > 0))
        )

    def indices_of_mean(self, order: str) -> Estimate:
        """Return the indices of all inputs, of the mean given the inputs."""
        numbers = range(self.blocks.layout.dimension)
        return self._unless_constant(
            lambda: Estimate.stacked(self._index_of_mean(order, i) for i in numbers), len(numbers)
        )

    def _index_of_mean(self, order: str, number: int) -> Estimate:
        layout = self.blocks.layout
        (A, B), again = self.drawn, self._again
        if order == "total_order":
            AB = self._values_at(layout.part_sharing_others(number).matrix)
            numerator = (A - AB) * (again - AB) / 2 - self._noise / 2
        else:
            AB = self._values_at(layout.part_sharing_one(number).matrix)
            numerator = B * (AB - (A + again) / 2)
        between = self._denominator - self._noise
        return self.estimates(IndexTerms(numerator, numerator != 0), between, is_of_mean=True)

    def estimates(
        self,
        terms: IndexTerms,
        denominator: FloatArray | None = None,
        *,
        is_of_mean: bool = False,
    ) -> Estimate:
        """Return an index with its interval; of a whole field the denominator is given."""
        blocks, numerator = self.blocks, terms.numerator
        denominator = self._denominator if denominator is None else denominator
        with np.errstate(divide="ignore", invalid="ignore"):
            value = numerator.mean(axis=-1) / denominator.mean(axis=-1)
        if blocks.replicate_count < 2:
            return Estimate.without_bounds(value, texts.BLOCKS_OF_ONE_REPLICATE)
        # Where a replicate has all of the variance there are no bounds.
        with np.errstate(divide="ignore", invalid="ignore"):
            error, freedom = ratio_jackknife_error(
                numerator, denominator, blocks.replicate, blocks.replicate_count
            )
        half = student_quantile(freedom, self.level) * error
        influence = numerator - value[..., np.newaxis] * denominator
        over_blocks = influence.std(axis=-1, ddof=1) / math.sqrt(blocks.count)
        wide = np.maximum(half, student_quantile(blocks.count - 1, self.level) * over_blocks)
        is_uncertain = self.shape.is_uncertain
        half = np.where(is_uncertain, wide, half)
        below = above = half
        method = np.where(is_uncertain, texts.WIDER_OF_TWO, texts.JACKKNIFE)
        if is_of_mean:
            below, above = self._fieller_margins(influence, denominator, half)
            method = np.asarray(texts.FIELLER_OVER_REPLICATES)
        tail = self.shape.tail_note
        if self.shape.hidden_tail:
            tail = texts.ONLY_BLOCKS.format(blocks=blocks.count)
        found = Estimate(
            value,
            value - below,
            value + above,
            method,
            np.where(is_uncertain, "conservative", "nominal"),
            np.where(is_uncertain, texts.DOUBTFUL_AS.format(reason=tail), self._reservation),
        )
        found = found.remove_bounds_at(error < _ROUNDING, texts.NO_SCATTER_OF_STRATA)
        spread = group_sums(denominator, blocks.replicate, blocks.replicate_count)
        is_in_one = spread.max(axis=-1) == spread.sum(axis=-1)
        found = found.remove_bounds_at(is_in_one, texts.VARIES_IN_ONE_REPLICATE)
        if is_of_mean:
            found = found.remove_bounds_at(~np.isfinite(below), texts.NOISE_HIDES_IT)
        are_few = np.count_nonzero(terms.informative, axis=-1) < _FEWEST_INFORMATIVE
        found = found.remove_bounds_at(are_few, texts.FEW_INFORMATIVE_BLOCKS)
        if self.is_event and not has_enough_runs_around(self.sample, self.sample.values.sum()):
            return Estimate.without_bounds(found.value, texts.TOO_ONE_SIDED)
        return found

    def _fieller_margins(
        self, influence: FloatArray, denominator: FloatArray, half: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the distances to the ends of Fieller's set, from the half-width without it."""
        scale = denominator.mean(axis=-1, keepdims=True)
        of_index, of_total = influence / scale, denominator / scale
        errors = [
            ratio_error(each, self.blocks.replicate, self.blocks.replicate_count)
            for each in (of_index + of_total, of_index - of_total, of_total)
        ]
        (together, freedom), (apart, _), (own, _) = errors
        quantile = student_quantile(freedom, self.level)
        return fieller_margins(half / quantile, (together**2 - apart**2) / 4, own, quantile)

    @property
    def _reservation(self) -> npt.NDArray[np.str_]:
        """Warning of a similar effect that may be hidden in the runs; empty for none."""
        if self.is_event:
            # It has no tail that could be hidden.
            is_small = self.blocks.count < _ENOUGH_FOR_EVENTS
            return np.where(is_small, texts.FEW_BLOCKS.format(blocks=_ENOUGH_FOR_EVENTS), "")
        return np.where(self.shape.is_doubtful, texts.DOUBTFUL_TAIL, "")


def sobol_indices(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Sobol' indices of an output, of its logarithm and of its exceedance of thresholds.

    Yields
    ------
    name : str
        ``first_order``, ``total_order`` and, for a design with second order, ``second_order``;
        ``log_first_order``, ``log_total_order`` where all values are positive;
        ``exceedance_first_order``, ``exceedance_total_order`` where thresholds are requested;
        ``noise_share``, ``mean_first_order``, ``mean_total_order`` where A has two runs. For a
        categorical output, ``category_first_order`` and ``category_total_order`` alone.
    estimate : DataArray
        Along ``input`` (``second_order`` along ``pair``) and ``bound``; the indices of exceedance
        first along ``threshold``, those of categories first along ``category``.
    """
    blocks, level = PickFreezeBlocks.from_runs(runs), quantity.confidence_level
    layout, values = blocks.layout, runs[quantity.output.name].values
    used = np.concatenate([*blocks.rows.values()])
    is_positive = bool(used.size and (values[used] > 0).all())
    for function in output_functions(quantity, has_logarithm=is_positive):
        found = []
        for row in function.rows:  # of many thresholds, the runs are in memory once
            with np.errstate(invalid="ignore", divide="ignore"):
                variable = BlockVariable(blocks, row(values), bool(function.events), level=level)
            found.append({order: variable.indices(order) for order in INDEX_ORDERS})
        for order, adjective in INDEX_ORDERS.items():
            name = f"{adjective} Sobol' indices of {function.title}"
            rows = [each[order] for each in found]
            array = function_array(rows, function, layout.inputs, name, level)
            yield f"{function.prefix}{order}", array.assign_attrs(blocks.attributes)
        if layout.pairs and not function.prefix:
            pairs = variable.indices("second_order")
            name = f"second-order Sobol' indices of {function.title}"
            array = pairs.to_array(
                PAIR, units="1", long_name=name, coordinates=_pair_coordinates(layout), level=level
            )
            yield "second_order", array.assign_attrs(blocks.attributes)
        if layout.noise and not function.prefix:
            share = variable.noise_share().to_array(
                units="1", long_name=f"share of the noise in the variance of {function.title}"
            )
            yield "noise_share", share.assign_attrs(blocks.attributes)
            for order, adjective in INDEX_ORDERS.items():
                name = (
                    f"{adjective} Sobol' indices of the mean of {function.title} given the inputs"
                )
                rows = [variable.indices_of_mean(order)]
                array = function_array(rows, function, layout.inputs, name, level)
                yield f"{OF_MEAN}{order}", array.assign_attrs(blocks.attributes)


def _pair_coordinates(layout: BlockLayout) -> dict[str, Any]:
    names = [(layout.inputs[i], layout.inputs[j]) for i, j in layout.pairs]
    described = {
        PAIR: ([", ".join(pair) for pair in names], "pair of inputs"),
        f"{PAIR}_first": ([one for one, _ in names], "first input of the pair"),
        f"{PAIR}_second": ([other for _, other in names], "second input of the pair"),
    }
    return {
        coordinate: (PAIR, np.array(entries, dtype=object), {"long_name": long_name})
        for coordinate, (entries, long_name) in described.items()
    }


# The same at each place of a field, and of the field as a whole.


def sobol_indices_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
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
    blocks, output = PickFreezeBlocks.from_runs(runs), quantity.output
    inputs, level = blocks.layout.inputs, quantity.confidence_level
    values = runs[output.name].values.astype(np.float64).reshape(runs.sizes[RUN], -1)
    # Sums over the places, each with its weight: of the terms of each order and input, and of the
    # squared distances of the points A and B from the mean of the field.
    numerators = np.zeros((len(INDEX_ORDERS), len(inputs), blocks.count))
    informative, squares = numerators != 0, np.zeros((2, blocks.count))
    at_places: dict[str, list[tuple[IntArray, Estimate]]] = {order: [] for order in INDEX_ORDERS}
    for places, reached, variable, weights in _varying_places(blocks, values, output, level):
        if isinstance(variable, str):
            none = Estimate.without_bounds(np.full((len(places), len(inputs)), np.nan), variable)
            for found in at_places.values():
                found.append((places, none))
            continue
        squares[:, reached] += [np.einsum("p,pb->b", weights, each**2) for each in variable.drawn]
        note = "" if reached.all() else texts.ENDED_BLOCKS
        for row, (order, found) in enumerate(at_places.items()):
            columns = []
            for i in range(len(inputs)):
                terms = variable.terms(order, i)
                columns.append(variable.estimates(terms).with_note(note))
                numerators[row, i, reached] += np.einsum("p,pb->b", weights, terms.numerator)
                informative[row, i, reached] |= terms.informative.any(axis=0)
            found.append((places, Estimate.stacked(columns)))
    distances = np.full(len(values), np.nan)
    for matrix, square in zip((MATRIX_A, MATRIX_B), squares, strict=True):
        distances[blocks.rows[matrix]] = np.sqrt(square)
    whole = BlockVariable(blocks, distances, is_distance=True, level=level)
    for row, (order, adjective) in enumerate(INDEX_ORDERS.items()):
        title = f"{adjective} Sobol' indices of {output.title}"
        joined = Estimate.joined(at_places[order])
        array = input_place_array(joined, output, inputs, title, level)
        yield order, array.assign_attrs(blocks.attributes)
        generalized = joined[0].each()
        if squares.any():
            of_inputs = map(IndexTerms, numerators[row], informative[row])
            generalized = [whole.estimates(each, squares.mean(axis=0)) for each in of_inputs]
        array = input_array(generalized, inputs, f"generalized {title}", level=level)
        yield f"{OF_FIELD}{order}", array.assign_attrs(blocks.attributes)


def _varying_places(
    blocks: PickFreezeBlocks, values: FloatArray, output: Output, level: float
) -> Iterator[tuple[IntArray, BoolArray, BlockVariable | str, FloatArray]]:
    """Yield places of a field that the same blocks reach, a few at a time.

    Yields
    ------
    places : ndarray of int, shape (place,)
        By their positions in the field, flattened.
    reached : ndarray of bool, shape (block,)
        The blocks that reach them.
    variable : BlockVariable or str
        Their values over these blocks, or the reason why they have no indices.
    weights : ndarray, shape (place,)
        The variance at each place, times its part of the grid: of a sum over the blocks that reach
        the place, for all blocks.
    """
    whole = np.concatenate([values[part] for part in blocks.rows.values()])
    # Squares of values over their range do not overflow.
    highest = np.fmax.reduce(whole, axis=None, initial=-np.inf)
    unit = float(highest - np.fmin.reduce(whole, axis=None, initial=np.inf)) or 1.0
    reaches = ~np.isnan(whole).reshape(len(blocks.rows), blocks.count, -1).any(axis=0)
    for group in equal_columns(reaches):
        reached = reaches[:, group[0]]
        some, none = blocks.subset(reached), np.zeros(0)
        if 2 * some.count < blocks.count or not some.count:
            yield group, reached, texts.FEW_BLOCKS_REACH if blocks.count else texts.NO_BLOCK, none
            continue
        step = max(_VALUES_TOGETHER // len(values), 1)
        for start in range(0, len(group), step):
            places = group[start : start + step]
            # The values of a place next to each other, as sums are then the same as of it alone.
            own = np.ascontiguousarray(values[:, places].T)
            varies = ~BlockVariable(some, own).sample.is_constant
            if not varies.all():
                yield places[~varies], reached, texts.CONSTANT_OUTPUT, none
            if varies.any():
                variable = BlockVariable(some, own[varies], level=level)
                weights = output.place_weights[places[varies]] * (variable.shape.std / unit) ** 2
                yield places[varies], reached, variable, weights * (blocks.count / some.count)
