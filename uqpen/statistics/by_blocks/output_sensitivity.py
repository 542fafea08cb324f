"""Sensitivity measures from the accumulators of a set of outputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics import texts
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample, BlockedShape
from uqpen.statistics.by_blocks.cell_sums import CellSums
from uqpen.statistics.by_blocks.output_set import OutputSet
from uqpen.statistics.by_blocks.output_variables import OutputVariables
from uqpen.statistics.by_blocks.power_sums import PowerSums
from uqpen.statistics.by_blocks.products import Products, partial
from uqpen.statistics.by_blocks.rank_scores import unresolved_share
from uqpen.statistics.by_blocks.replicate_sums import ReplicateSums
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel
from uqpen.statistics.sample_shape import SampleShape, shape_of
from uqpen.statistics.sensitivity.correlations import (
    CORRELATIONS,
    FEWEST_RUNS,
    correlation_array,
    shape_reason,
)
from uqpen.statistics.sensitivity.delta import FEWEST_RUNS as FEWEST_RUNS_FOR_DELTA
from uqpen.statistics.sensitivity.delta import delta_array, delta_of_counts
from uqpen.statistics.sensitivity.explained_variance import LocalRegressions
from uqpen.statistics.sensitivity.given_data import indices_name
from uqpen.statistics.sensitivity.input_measures import event_array, input_array, reason_of_output
from uqpen.statistics.sensitivity.sampled_variable import SampledVariable
from uqpen.statistics.tally import Tally

__all__ = ["OutputSensitivity"]

_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class OutputSensitivity:
    """Sensitivity measures of an output, after both passes over its runs.

    Parameters
    ----------
    found : OutputSet
    variables : OutputVariables
        One of the set.
    sample : BlockedSample
        Of the output, over all runs.
    """

    found: OutputSet
    variables: OutputVariables
    sample: BlockedSample

    def arrays(self) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield first-order indices, correlations and delta, with the names of their statistics."""
        if not self.found.inputs:
            return
        yield from self._first_order()
        if not self.variables.quantity.output.categories:
            yield from self._correlations()
            yield self._delta()

    @cached_property
    def _is_constant_input(self) -> list[bool]:
        """True for each input with one value in all runs: then one splitter has all of them."""
        found = []
        for name in self.found.inputs:
            filled = np.flatnonzero(self.found.cells[name].counts.any(axis=0))
            found.append(filled.size < 2 and bool((filled % 2).all()))
        return found

    def _first_order(self) -> Iterator[tuple[str, xr.DataArray]]:
        quantity, title = self.variables.quantity, self.variables.quantity.output.title
        inputs, level = self.sample.inputs, self.sample.level
        rows = [self._indices(row, each) for row, each in enumerate(self._sampled)]
        if quantity.output.categories:
            name = indices_name(f"the kind of {title}", self.sample)
            along = category_coordinates(quantity)
            yield "category_first_order", event_array(rows, along, inputs, name, level)
            return
        name = indices_name(title, self.sample)
        yield "first_order", input_array(rows.pop(0), inputs, name, level=level)
        if self.variables.has_logarithm:
            indices = rows.pop(0)
            if self.sample.size and self.sample.powers.whole.smallest[0] > 0:
                name = indices_name(f"the logarithm of {title}", self.sample)
                yield "log_first_order", input_array(indices, inputs, name, level=level)
        if quantity.thresholds:
            name = indices_name(f"whether {title} exceeds a value", self.sample)
            along = threshold_coordinates(quantity)
            yield "exceedance_first_order", event_array(rows, along, inputs, name, level)

    @cached_property
    def _sampled(self) -> list[SampledVariable]:
        """The functions of the output, as the analyses of indices take them."""
        quantity, sample = self.variables.quantity, self.sample
        if kinds := quantity.output.categories:
            return [self._event(sample.values == kind) for kind in range(len(kinds))]
        is_doubtful = bool(shape_of(sample).is_doubtful)
        of_values = [sample.powers]
        if self.variables.has_logarithm:
            of_values.append(self.found.powers[self.variables.log_name])
        return [
            *(_Variable(replace(sample, powers=each), is_doubtful) for each in of_values),
            *(self._event(sample.values > each.value) for each in quantity.thresholds),
        ]

    def _event(self, events: BoolArray) -> SampledVariable:
        tally = cast(Tally, events)
        powers = PowerSums.of_events(tally) if tally.size else PowerSums.empty(1)
        values = cast(FloatArray, events)
        return _Variable(replace(self.sample, values=values, powers=powers), is_event=True)

    def _indices(self, row: int, variable: SampledVariable) -> list[Estimate]:
        """Estimate the index of each input, of one function of the output."""
        before = self.found.variables.index(self.variables)
        number = row + sum(each.count for each in self.found.variables[:before])
        columns = [
            self._index(number, variable, name, is_constant=is_constant)
            for name, is_constant in zip(self.found.inputs, self._is_constant_input, strict=True)
        ]
        return LocalRegressions(self.sample).with_note(EstimateVector.stack(columns)).each()

    def _index(
        self, number: int, variable: SampledVariable, name: str, *, is_constant: bool
    ) -> EstimateVector:
        reason = variable.too_few_runs
        if not reason and variable.sample.is_constant:
            reason = variable.text_of_constant
        if not reason and is_constant:
            reason = texts.CONSTANT_INPUT
        if reason:
            return EstimateVector.without_bounds(np.asarray(np.nan), reason)
        shares = _Shares(self.found, self.found.sums[name], number)
        found = LocalRegressions(self.sample).estimates(variable, shares, shares.finer)
        method = texts.SCATTER_OF_PARTS.format(of=_parts_of(self.sample))
        return replace(found, method=np.where(found.has_bounds, method, found.method))

    def _correlations(self) -> Iterator[tuple[str, xr.DataArray]]:
        among_all, within = self.found.rank_products
        values = _Correlations(self, self.found.products.whole, self.found.products)
        cells = [self.found.cells[name].counts.sum(axis=0) for name in self.found.names]
        ranks = _Correlations(self, among_all, within, max(map(unresolved_share, cells)))
        reason = shape_reason(shape_of(self.sample)) if self.sample.size else ""
        for statistic, (is_ranked, is_partial, _) in CORRELATIONS.items():
            columns = ranks if is_ranked else values
            estimates = columns.estimates("" if is_ranked else reason, is_partial=is_partial)
            yield (
                statistic,
                correlation_array(statistic, estimates, self.sample, self.variables.quantity),
            )

    def _delta(self) -> tuple[str, xr.DataArray]:
        estimates = []
        for name, is_constant in zip(self.found.inputs, self._is_constant_input, strict=True):
            if reason := self.reason(FEWEST_RUNS_FOR_DELTA, is_constant=is_constant):
                estimates.append(Estimate.without_bounds(math.nan, reason))
                continue
            counts = self.found.scores.tables[name, self.variables.output].astype(np.float64)
            value = delta_of_counts(counts[counts.sum(axis=1) > 0])
            reason = self.sample.reason_without_intervals or texts.NO_INTERVAL_OF_DELTA
            estimates.append(Estimate.without_bounds(value, reason))
        return delta_array(estimates, self.sample, self.variables.quantity)

    def reason(self, fewest: int, *, is_constant: bool) -> str:
        """Reason why an input has no measure; empty where it has one."""
        reason = reason_of_output(self.sample, fewest)
        return reason or (texts.CONSTANT_INPUT if is_constant else "")

    def without_measure(self) -> list[str]:
        """Reasons why inputs have no correlation, one for each."""
        return [self.reason(FEWEST_RUNS, is_constant=each) for each in self._is_constant_input]


@dataclass(frozen=True)
class _Variable(SampledVariable):
    """A function of an output over runs, known by its power sums."""

    @cached_property
    def shape(self) -> SampleShape:
        sample = cast(BlockedSample, self.sample)
        return BlockedShape(sample, sample.powers)


@dataclass(frozen=True, eq=False)
class _Shares:
    """The share of a variable's variance that an input explains, with its error."""

    found: OutputSet
    sums: CellSums | ReplicateSums
    number: int

    def estimates(self, variable: SampledVariable) -> EstimateVector:
        """Return the share with its bounds."""
        value, error = self._share(), self.sums.errors(self.found.totals)[self.number]
        freedom = self.found.table.grouping.batches - 1
        none = np.zeros(())
        return variable.estimates(value, np.asarray(error), freedom, none)

    def finer(self, rows: BoolArray) -> FloatArray:
        """Return the share that half the cells would explain, by what twice the cells lose."""
        coarser = self.sums.shares(self.found.totals, joined=2)[self.number]
        return np.asarray(2 * self._share() - coarser).reshape(1)

    def _share(self) -> FloatArray:
        return np.asarray(self.sums.shares(self.found.totals)[self.number])


@dataclass(frozen=True, eq=False)
class _Correlations:
    """Correlations of the output with each input, over all runs and over each batch."""

    of: OutputSensitivity
    whole: Products
    batches: Products
    resolution: float = 0.0

    def estimates(self, reason: str, *, is_partial: bool) -> list[Estimate]:
        """Estimate the correlation with each input; without bounds for a reason."""
        reasons = self.of.without_measure()
        inputs = [k for k, each in enumerate(reasons) if not each]
        found = [Estimate.without_bounds(math.nan, each) for each in reasons]
        if not inputs:
            return found
        columns = [*inputs, self._place]
        whole, batches = self.whole.matrices(), self.batches.matrices()
        value = self._taken(whole, columns, self.resolution, is_partial=is_partial)[0]
        scattered = self._taken(batches, columns, 0.0, is_partial=is_partial)
        for number, k in enumerate(inputs):
            found[k] = self._estimate(value[number], scattered[:, number], reason)
        return found

    @property
    def _place(self) -> int:
        return self.of.found.names.index(self.of.variables.output)

    @staticmethod
    def _taken(
        matrices: FloatArray, columns: Sequence[int], resolution: float, *, is_partial: bool
    ) -> FloatArray:
        """Correlations of the last of some columns with the others, shape (batch, input)."""
        mine = matrices[:, columns][:, :, columns]
        if not is_partial:
            return mine[:, -1, :-1]
        return np.stack([partial(each, resolution) for each in mine])

    def _estimate(self, value: float, scattered: FloatArray, reason: str) -> Estimate:
        if math.isnan(value):
            return Estimate.without_bounds(math.nan, texts.LINEARLY_DEPENDENT)
        sample = self.of.sample
        if reason := sample.reason_without_intervals or reason:
            return Estimate.without_bounds(value, reason)
        known = scattered[~np.isnan(scattered)]
        if known.size < 2:
            return Estimate.without_bounds(value, texts.NO_SCATTER_OF_RUNS)
        with np.errstate(divide="ignore", invalid="ignore"):
            transformed = np.arctanh(np.clip(known, -1, 1))
            error = float(transformed.std(ddof=1)) / math.sqrt(known.size)
        if 1 - abs(value) < _ROUNDING or not _ROUNDING < error < math.inf:
            return Estimate.without_bounds(value, texts.NO_SCATTER_OF_RUNS)
        half, centre = student_quantile(known.size - 1, sample.level) * error, math.atanh(value)
        ends = math.tanh(centre - half), math.tanh(centre + half)
        method = texts.SCATTER_OF_PARTS_ON_FISHER.format(of=_parts_of(sample))
        is_single = sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET
        return Estimate(value, *ends, method, "conservative" if is_single else "nominal")


def _parts_of(sample: BlockedSample) -> str:
    """Return what the batches are."""
    return "replicates" if sample.is_replicated else "parts of the runs"
