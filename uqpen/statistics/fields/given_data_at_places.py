"""First-order indices from any sample, at each place of a field and of the field as a whole."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.fields.distances import DistanceShape
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.fields.place_arrays import input_place_array
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.explained_variance import LocalRegressions, VarianceParts
from uqpen.statistics.sensitivity.given_data import indices_name
from uqpen.statistics.sensitivity.input_measures import input_array
from uqpen.statistics.sensitivity.local_regression import ResidualVariance
from uqpen.statistics.sensitivity.sampled_variable import SampledVariable

__all__ = ["first_order_at_places"]

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

    def place_indices(self) -> EstimateVector:
        """Estimate the indices at each place, and add the places up."""
        return EstimateVector.joined(
            (part.places, part.regressions.indices(part.variable, partial(self._add, part)))
            for part in self._parts()
        )

    def _add(
        self, places: _Part, column: int, lines: ResidualVariance, parts: VarianceParts
    ) -> None:
        self.sums[column].add(places, lines, parts)

    def generalized_indices(self, at_places: EstimateVector) -> list[Estimate]:
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
                values = group.values[start : start + size]
                variable = SampledVariable(replace(group.runs, values=values))
                yield _Part(places, runs, regressions, variable, self._weights(places, variable))

    def _weights(self, places: IntArray, variable: SampledVariable) -> FloatArray:
        if variable.too_few_runs:
            return np.zeros(len(places))
        return self.field.weights[places] * (variable.shape.std / self.unit) ** 2
