"""Statistics of a model, estimated from its surrogate.

They follow from the closed forms of the surrogate where it has them, else from a sample of
admissible draws.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.blocks import LoadedDataset
from uqpen.core.catalogue import CATALOGUE, REQUESTED
from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    CONDITIONAL,
    ESTIMATOR,
    EXCEEDANCE,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    MOMENTS,
    NOTE,
    QUANTILES,
    RUN,
    SENSITIVITY,
    TAILS,
)
from uqpen.core.lookup import resolve
from uqpen.core.model import Dimension
from uqpen.core.variables import field_coordinates
from uqpen.statistics import FIELD_ANALYSES, texts
from uqpen.statistics.analyze import OutputStatistics, analyze, in_catalogue_order
from uqpen.statistics.estimate import NamedArrays
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import samples_of
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.input_measures import input_coordinate
from uqpen.statistics.surrogate.refutation import missing_estimates
from uqpen.statistics.surrogate.surrogate_draws import (
    MOST_INPUTS_FOR_ALL_SETS,
    PickFreezePairs,
    SurrogateDraws,
    VarianceShares,
)
from uqpen.statistics.surrogate.surrogate_indices import surrogate_indices
from uqpen.surrogates.chaos.expansion import input_shares
from uqpen.surrogates.ending_curves import EndingComponents
from uqpen.surrogates.field_fit import FieldFit
from uqpen.surrogates.field_surrogate import FieldSurrogate

_SAMPLED = [*dict.fromkeys(each.group for each in CATALOGUE.values() if each.is_of_surrogates)]


@dataclass(frozen=True)
class SurrogateStatistics:
    """Estimate arrays of a surrogate by output and statistic, before runs correct them."""

    outputs: Mapping[str, OutputStatistics]  # of scalar outputs
    # Of fields, which runs do not correct: each says what the surrogate leaves.
    fields: Mapping[str, OutputStatistics] = field(default_factory=dict)


def surrogate_statistics(
    draws: SurrogateDraws,
    quantities: Sequence[QuantityOfInterest],
    *,
    only: Collection[str] | None = None,
) -> SurrogateStatistics:
    """Estimate all statistics of a fitted surrogate.

    Parameters
    ----------
    quantities : sequence of QuantityOfInterest
        Those of outputs that could not be fitted are left out.
    only : collection of str, optional
        The requested groups; all by default.
    """
    fitted = {output.name for output in draws.model.outputs}
    requested = [
        quantity.without(CATALOGUE["tolerance_limit"])
        for quantity in quantities
        if quantity.output.name in fitted
    ]
    if not requested:
        return SurrogateStatistics({})
    scalars = [quantity for quantity in requested if not quantity.output.dims]
    fields: dict[str, OutputStatistics] = {}
    if isinstance(draws.model, FieldSurrogate):
        fits = draws.model.fields
        draws = replace(draws, model=draws.model.scalars)
        for quantity in (each for each in requested if each.output.dims):
            field = _Field(draws, fits[quantity.output.name], quantity)
            fields[quantity.output.name] = in_catalogue_order(dict(field.statistics(only)))
    return SurrogateStatistics(_by_output(draws, scalars, only), fields)


def _by_output(
    draws: SurrogateDraws, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
) -> dict[str, OutputStatistics]:
    """Return the statistics of each output: sampled, in closed form, and its indices."""
    sampled = [name for name in _SAMPLED if only is None or name in only]
    not_sampled = [each for each in REQUESTED if not each.is_of_surrogates]
    found = analyze(draws.runs, [each.without(*not_sampled) for each in quantities], only=sampled)
    if TAILS in sampled:
        no_runs = draws.runs.isel({RUN: slice(0)})
        for output, arrays in analyze(no_runs, quantities, only=[TAILS]).items():
            for name in arrays.keys() - found[output].keys():
                found[output][name] = missing_estimates(arrays[name], texts.NO_TAIL_OF_SURROGATE)
    for quantity in quantities:
        statistics = found[quantity.output.name]
        for name, array in statistics.items():
            statistics[name] = array.assign_attrs({ESTIMATOR: draws.sampling_estimator})
        # The exact moments of the surrogate where they are the output's.
        forms = draws.closed_forms_of_output(quantity.output.name)
        if forms is not None and "mean" in statistics:
            moments = forms.closed_form_moments(quantity.output.name)
            for name, value in zip(("mean", "std"), moments, strict=True):
                exact = statistics[name].copy(data=[value, math.nan, math.nan])
                statistics[name] = exact.assign_attrs({ESTIMATOR: forms.estimator})
        if only is None or SENSITIVITY in only:
            for name, array in surrogate_indices(draws, quantity):
                statistics[name] = array.assign_attrs({"estimand": draws.estimand})
        found[quantity.output.name] = in_catalogue_order(statistics)
    return found


# Statistics of a field, estimated from the surrogate of its scores.
#
# A field is linear in its scores. So its moments and variance shares at each place are sums over
# pairs of scores: no draw of the whole field is kept. Quantiles and probabilities follow from draws
# of the scores, some places at a time.

# Shares of the variance of a field that its inputs have, from its scores.
#
# The variance at a place is a quadratic form of the components there, and so is the part of it that
# a set of inputs explains. The components are orthonormal, so the mean of such a form over the
# field is its trace. A share of that mean is a generalized index.
#
# References
# ----------
# Lamboni, M., Monod, H. & Makowski, D. (2011). Reliab. Eng. Syst. Saf. 96, 450-459.
# Gamboa, F., Janon, A., Klein, T. & Lagnoux, A. (2014). Electron. J. Stat. 8, 575-603.


# The indices of a field by name, with their titles.
_INDICES = {
    "first_order": "first-order Sobol' indices",
    "total_order": "total-order Sobol' indices",
    "shapley": "Shapley effects",
    "generalized_first_order": "generalized first-order Sobol' indices",
    "generalized_total_order": "generalized total-order Sobol' indices",
}


def _closed_form_shares(
    indices: IntArray, coefficients: FloatArray, components: FloatArray
) -> dict[str, FloatArray]:
    """Compute the indices from orthonormal terms, by name.

    Their shape is (place, input), and (input,) of generalized ones.

    Parameters
    ----------
    indices : ndarray of int, shape (term, input)
        The degrees of the terms.
    coefficients : ndarray, shape (term, component)
        Of each score.
    components : ndarray, shape (component, place)
    """
    whole = input_shares(indices, np.sqrt((coefficients**2).sum(axis=1)))
    found = [input_shares(indices, coefficients @ place) for place in components.T]
    return {
        "first_order": np.array([each.first for each in found]),
        "total_order": np.array([each.total for each in found]),
        "shapley": np.array([each.shapley for each in found]),
        "generalized_first_order": whole.first,
        "generalized_total_order": whole.total,
    }


def _sampled_shares(
    pairs: PickFreezePairs, scores: Sequence[str], components: FloatArray
) -> dict[str, FloatArray]:
    """Estimate the same from pairs of draws of the scores."""
    drawn = pairs.columns(scores)
    size = len(drawn[-1])

    def forms(one: FloatArray, other: FloatArray) -> FloatArray:
        """Return the quadratic form at each place, and at the end its mean over the field."""
        matrix = one.T @ other / size
        return np.append(((matrix @ components) * components).sum(axis=0), np.trace(matrix))

    variance, explained = _explained_shares(drawn, forms)
    return _by_name(pairs.dimension, len(variance), explained)


def _explained_shares(
    drawn: dict[int, FloatArray], forms: Callable[[FloatArray, FloatArray], FloatArray]
) -> tuple[FloatArray, dict[int, FloatArray]]:
    """Return variances, and the shares of them that sets of inputs explain.

    `drawn` has the values of pairs of draws by the set that they share, of the first ones by -1.
    `forms` are means of products over the pairs.
    """
    first, unrelated = drawn[-1], drawn[0]
    centred = first - first.mean(axis=0)
    variance, explained = forms(centred, centred), {}
    with np.errstate(invalid="ignore", divide="ignore"):
        for subset in drawn.keys() - {-1, 0}:
            values = drawn[subset]
            # As for a scalar output: the one errs little where little is explained, the other
            # where little is left.
            share = forms(centred, values - unrelated) / variance
            rest = forms(first - values, first - values) / 2 / variance
            explained[subset] = np.where(share < rest, share, 1 - rest)
    return variance, explained


def _scaled_shares(pairs: PickFreezePairs, fit: FieldFit) -> dict[str, FloatArray]:
    """Estimate the same of scaled curves, at the first places, to which all draws get.

    Farther along, the inputs of the curves that get there depend on each other.
    """
    parts = fit.components
    assert isinstance(parts, EndingComponents)
    evaluations = len(parts.places) * (len(pairs.second) + 1)
    most = int(np.clip(_MOST_CURVE_VALUES // evaluations // 16, _FEWEST_CURVES, _MOST_CURVES))
    drawn = pairs.columns(fit.names, 1 << most.bit_length() - 1)
    variances, shares = [], []
    for position in range(len(parts.places)):
        place = slice(position, position + 1)
        values = {key: parts.curves_at(each, place) for key, each in drawn.items()}
        if not all(np.isfinite(each).all() for each in values.values()):
            break
        at_place, own = _explained_shares(values, lambda a, b: (a * b).mean(axis=0))
        variances.append(at_place.item())
        shares.append({key: each.item() for key, each in own.items()})
    variance, weights = np.array(variances), parts.place_weights[: len(variances)]
    at_places = {key: np.array([each[key] for each in shares]) for key in drawn.keys() - {-1, 0}}
    with np.errstate(invalid="ignore", divide="ignore"):
        whole = {
            key: weights @ np.where(variance > 0, each * variance, 0.0) / (weights @ variance)
            for key, each in at_places.items()
        }
    explained = {key: np.append(each, whole[key]) for key, each in at_places.items()}
    return _by_name(pairs.dimension, len(variance) + 1, explained)


def _by_name(
    dimension: int, count: int, explained: Mapping[int, FloatArray]
) -> dict[str, FloatArray]:
    """Return shares at places, and at the end of the whole field, by the names of the indices."""
    none, all_inputs = np.zeros(count), np.ones(count)
    shares = VarianceShares(dimension, {0: none, (1 << dimension) - 1: all_inputs, **explained})
    shapley = shares.shapley
    return {
        "first_order": shares.first_order[:-1],
        "total_order": shares.total_order[:-1],
        "shapley": np.full((count, shares.dimension), np.nan)[:-1]
        if shapley is None
        else shapley[:-1],
        "generalized_first_order": shares.first_order[-1],
        "generalized_total_order": shares.total_order[-1],
    }


# Values of scaled curves in their indices, and pairs of each replicate: at least, and at most.
_MOST_CURVE_VALUES, _FEWEST_CURVES, _MOST_CURVES = 2**24, 64, 512

# Values of a field that are put together at a time: 32 MB.
_MOST_VALUES = 2**22

_FROM_COEFFICIENTS = "from the coefficients"

_REACHED = "reached"
_BY_DRAWS = (QUANTILES, EXCEEDANCE)

# The dimension of a part of the places.
_PLACE = "place"


@dataclass(frozen=True)
class _Field:
    """Estimates of one field: without bounds, and with a note on what the surrogate leaves.

    They lie along the dimensions of the field, but for generalized indices.
    """

    draws: SurrogateDraws
    fit: FieldFit
    quantity: QuantityOfInterest

    def statistics(self, only: Collection[str] | None) -> NamedArrays:
        """Yield all statistics of some groups, by default of all."""
        if not self.is_scaled and (only is None or MOMENTS in only):
            yield from self.moments()
        for group in (MOMENTS, _REACHED, *_BY_DRAWS) if self.is_scaled else _BY_DRAWS:
            if only is None or group in only:
                yield from self.by_draws(group)
        if only is None or SENSITIVITY in only:
            yield from self.indices()

    @property
    def is_scaled(self) -> bool:
        """True if the components are along a scaled coordinate, so no place is a sum of scores."""
        parts = self.fit.components
        return isinstance(parts, EndingComponents) and parts.is_scaled

    @cached_property
    def sample(self) -> Sample:
        """The scores at the draws, shape (run, component); of scaled curves with their ends."""
        runs = LoadedDataset.of(self.draws.runs)
        names = self.fit.names if self.is_scaled else self.fit.scores
        samples = samples_of(runs, names)
        values = [samples[name].values for name in names]
        return replace(samples[names[0]], values=np.column_stack(values))

    @cached_property
    def terms(self) -> tuple[IntArray, FloatArray] | None:
        """The terms of the scores where their coefficients give all moments."""
        scores = self.fit.scores
        forms = self.draws.closed_forms_of_output(scores[0])
        return forms.closed_form_terms(scores) if forms is not None else None

    def moments(self) -> NamedArrays:
        """Yield mean and standard deviation at each place."""
        parts = self.fit.components.components
        if self.terms:
            indices, coefficients = self.terms
            is_constant = ~indices.any(axis=1)
            centre = coefficients[is_constant].sum(axis=0)
            matrix = coefficients[~is_constant].T @ coefficients[~is_constant]
        elif self.sample.size > 1:
            centre = self.sample.values.mean(axis=0)
            matrix = np.atleast_2d(np.cov(self.sample.values, rowvar=False))
        else:
            centre, matrix = np.full(len(parts), np.nan), np.full((len(parts),) * 2, np.nan)
        variance = ((matrix @ parts) * parts).sum(axis=0)
        mean = self.fit.components.sums(centre[None])[0]
        estimator = _FROM_COEFFICIENTS if self.terms else self.draws.sampling_estimator
        output = self.quantity.output
        for name, values, title in (
            ("mean", mean, "mean"),
            ("std", np.sqrt(np.maximum(variance, 0)), "standard deviation"),
        ):
            title = f"{title} of {output.title}"
            yield name, self._array(values, title, estimator, texts.NO_RUN, unit=output.unit)

    def by_draws(self, group: str) -> NamedArrays:
        """Yield the statistics of an analysis of fields, some places at a time."""
        found: dict[str, list[xr.DataArray]] = {}
        for part in self._parts():
            for reference in FIELD_ANALYSES[group]:
                for name, array in resolve(reference)(part, self.quantity):
                    found.setdefault(name, []).append(array)
        for name, arrays in found.items():
            first = arrays[0]
            array = self._array(
                np.concatenate([array.values[..., 0] for array in arrays]),
                first.attrs["long_name"],
                self.draws.sampling_estimator,
                texts.NO_RUN,
                unit=first.attrs["units"],
                own=tuple(map(str, first.dims[1:-1])),
                coordinates={
                    key: each
                    for key, each in first.coords.variables.items()
                    if key not in (*INTERVAL_TEXTS, BOUND, _PLACE)
                },
            )
            yield name, array

    def _parts(self) -> Iterator[FieldSample]:
        """Yield the field at the draws, in parts of some places each."""
        components, size = self.fit.components, max(_MOST_VALUES // max(self.sample.size, 1), 1)
        for start in range(0, len(components.mean), size):
            part = slice(start, start + size)
            if isinstance(components, EndingComponents) and self.is_scaled:
                values = components.curves_at(self.sample.values, part)
            else:
                values = components.at(part).sums(self.sample.values)
            along = Dimension(_PLACE, "1", values=tuple(range(values.shape[1])))
            output = replace(self.quantity.output, dims=(along,), may_end=self.is_scaled)
            yield FieldSample(replace(self.sample, values=values), output)

    def indices(self) -> NamedArrays:
        """Yield Sobol' indices and Shapley effects at each place and of the whole field."""
        joint, components, shares = self.draws.joint, self.fit.components, None
        parts = components.components
        if self.terms and not self.is_scaled:
            estimator = _FROM_COEFFICIENTS
            shares = _closed_form_shares(*self.terms, parts)
        else:
            estimator = self.draws.pairs_estimator
            if self.is_scaled and not joint.conditional_reason:
                shares = _scaled_shares(self.draws.pairs, self.fit)
            elif not joint.conditional_reason:
                shares = _sampled_shares(self.draws.pairs, self.fit.scores, parts)
        names = [entry.variable.name for entry in joint.random]
        for name, title in _INDICES.items():
            is_of_places = not name.startswith("generalized_")
            places = (parts.shape[1],) if is_of_places else ()
            values = None if shares is None else shares[name]
            reason = joint.conditional_reason
            if values is None or ("total" in name and not joint.is_independent):
                values = np.full((*places, len(names)), np.nan)
                reason = reason or texts.DEPENDENT_INPUTS
            elif (
                name == "shapley"
                and len(names) > MOST_INPUTS_FOR_ALL_SETS
                and not (self.terms and not self.is_scaled)
            ):
                reason = reason or texts.TOO_MANY_SUBSETS.format(inputs=len(names))
            up_to = ""
            if isinstance(components, EndingComponents) and self.is_scaled and shares is not None:
                last = components.dimension.values[len(shares["first_order"]) - 1]
                up_to = f" up to {components.dimension.place_text(last)}" * (not is_of_places)
            array = self._array(
                values,
                f"{title} of {self.quantity.output.title}{up_to}",
                estimator,
                reason or texts.CONSTANT_AT_DRAWS,
                own=(INPUT,),
                coordinates=input_coordinate(names),
                beyond=texts.NOT_ALL_REACH if self.is_scaled else "",
            )
            yield name, array.assign_attrs(estimand=self.draws.estimand)

    def _array(
        self,
        values: FloatArray,
        title: str,
        estimator: str,
        reason: str,
        *,
        unit: str = "1",
        own: tuple[str, ...] = (),
        coordinates: Mapping[Any, Any] = MappingProxyType({}),
        beyond: str = "",
    ) -> xr.DataArray:
        """Return an estimate array, of places and along some dimensions or along these alone.

        What is NaN has a reason; `beyond` is that of places behind the values, if it is another
        one than that of the components.
        """
        dims = self.quantity.output.dims if values.ndim > len(own) else ()
        reasons = np.full(values.shape, reason, dtype=object)
        attributes = {ESTIMATOR: estimator}
        if dims and self.is_scaled and not beyond:
            attributes[CONDITIONAL] = texts.REACHED
        parts = self.fit.components
        if dims and isinstance(parts, EndingComponents):
            width = [(0, len(parts.places) - len(values)), *[(0, 0)] * (values.ndim - 1)]
            values = np.pad(values, width, constant_values=np.nan)
            reasons = np.pad(reasons, width, constant_values=beyond or parts.beyond_text)
        shape = (*(len(each.values) for each in dims), *values.shape[values.ndim - len(own) :])
        bounds = np.full((values.size, len(BOUNDS)), np.nan)
        bounds[:, 0] = values.ravel()
        return estimate_array(
            bounds,
            dict(zip((*(each.name for each in dims), *own), shape, strict=True)),
            {
                INTERVAL: "none",
                INTERVAL_LABEL: "none",
                NOTE: np.where(np.isfinite(values), self.fit.text, reasons).astype(object),
            },
            units=unit,
            long_name=title,
            attributes=attributes,
            coordinates={**field_coordinates(dims), **coordinates},
        )
