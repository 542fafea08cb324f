"""Answers over the unknowns of distributions, from the runs of one design by weights.

Points are drawn from a distribution with the mass of all that are possible. Under one of these
a run counts by the ratio of its density to that of the draw, so the same runs answer for each.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from types import MappingProxyType

import numpy as np
import scipy
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUNDED_EVENT, MORE_SPECIMENS, RANK, SAMPLING, SPECIMENS, WEIGHT
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.streams import BLOCK
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.measurements import parameters_text
from uqpen.distributions.unknowns import (
    DRAWS,
    FittedParameters,
    ParameterBox,
    grid_of_boxes,
)
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, output_run_counts, run_counts
from uqpen.statistics.distribution_function.probabilities import event_probability
from uqpen.statistics.distribution_function.quantiles import sample_quantile
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import event_sample, sample_of, samples_of
from uqpen.statistics.sample import Sample
from uqpen.statistics.weights import (
    effective_sizes,
    weighted_cdf,
    weighted_probability_interval,
)

# What has answers over unknowns.
_KNOWN_OVER_UNKNOWNS = tuple(
    CATALOGUE[name] for name in ("mean", "quantile", "exceedance", "below", "share", "cdf")
)

# What is predicted for more specimens.
_OF_MORE = ("mean", "quantile", "exceedance", "below")

# A draw of which fewer runs count than this share of all is told.
_FEW_OF_DRAW = 0.05
# Draws whose weights are in memory together.
_TOGETHER = 50

# Fewest effective runs of each distribution of a box, and their least share of all.
_FEWEST_OF_BOX, _LEAST_SHARE_OF_BOX = 30, 0.1


def statistics_over_unknowns(
    runs: xr.Dataset | BlockedRuns,
    quantities: Sequence[QuantityOfInterest],
    joint: JointDistribution,
    *,
    only: Collection[str] | None = None,
) -> dict[str, OutputStatistics]:
    """Compute the answers over the unknowns of a joint distribution.

    Parameters
    ----------
    runs : Dataset or BlockedRuns
        Of a design whose points are a sample of `joint`, or go over its boxes. Of more than 65 536
        runs the first ones are taken, which are a sample as well.
    quantities : sequence of QuantityOfInterest
    joint : JointDistribution
    only : collection of str, optional
        Groups of statistics, where not all of them are wanted.

    Returns
    -------
    dict of str to dict of str to DataArray
        By output, estimate arrays by statistic: ``plug_in_…``, ``fitted_…`` and, if there were more
        specimens, ``more_specimens_…`` where parameters are uncertain, ``lower_…`` and ``upper_…``
        where some are intervals, and ``total_…`` where there are both. Empty where none is.
    """
    sampling = Sampling(runs.attrs[SAMPLING])
    has_sample = sampling in (Sampling.INDEPENDENT, Sampling.STRATIFIED)
    if not (joint.boxes or (joint.fitted and has_sample)):
        return {}
    if joint.boxes and sampling is not Sampling.OVER_BOX:
        return {}
    handle = LoadedDataset.of(runs)
    taken = handle.read(0, min(handle.size, BLOCK)).assign_attrs(handle.attrs)
    independent = taken.assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)})
    note = texts.FIRST_RUNS.format(runs=BLOCK) if handle.size > BLOCK else ""
    part, of_runs = LoadedDataset(taken), run_counts(LoadedDataset(taken))
    found: dict[str, OutputStatistics] = {}
    records = [each for each in _KNOWN_OVER_UNKNOWNS if only is None or each.group in only]
    for quantity in quantities:
        if quantity.output.dims:
            continue
        output = quantity.output.name
        # Strata of the points are not kept by weights: without them the error is larger.
        sample = replace(sample_of(independent, output), level=quantity.confidence_level)
        sample = replace(sample, replicates=np.zeros_like(sample.replicates))
        counts = output_run_counts(part, of_runs, output)
        templates: OutputStatistics = {}
        for record in records:
            made = dict(resolve(record.by["sample"])(sample, quantity))
            templates |= {record.name: made[record.name]} if record.name in made else {}
            if joint.boxes and "cdf_value" in made:
                found.setdefault(output, {})["cdf_value"] = made["cdf_value"].assign_attrs(counts)
        if handle.size > BLOCK and joint.fitted:
            # The function of all runs has other values.
            templates.pop("cdf", None)
        estimates = _box_estimates if joint.boxes else _fitted_estimates
        found[output] = found.get(output, {}) | {
            name: _array(estimate.with_note(note), template, name, sample.level, counts)
            for name, template, estimate in estimates(
                sample, independent, quantity, joint, templates
            )
        }
        if joint.fitted and not joint.boxes:
            found[output] |= {
                name: array.assign_attrs(counts)
                for name, array in _with_more_specimens(
                    sample, independent, quantity, joint, templates
                )
            }
    return found


class _Ratios:
    """Logarithms of the ratios of densities at all runs, by the distributions of some inputs."""

    def __init__(
        self, runs: xr.Dataset, joint: JointDistribution, entries: Sequence[RandomInput]
    ) -> None:
        self._joint, self._names = joint, [entry.variable.name for entry in entries]
        self._values = {name: runs[name].values for name in self._names}
        self._drawn = joint.log_density(self._values, self._names)
        if WEIGHT in runs.coords:
            # Runs of other distributions count for those of the study by weights already.
            with np.errstate(divide="ignore"):
                self._drawn = self._drawn - np.log(runs[WEIGHT].values)

    def at(self, distributions: Sequence[Distribution]) -> FloatArray:
        """Return the ratios at values of the unknowns, shape (run,)."""
        possible = self._joint.at(dict(zip(self._names, distributions, strict=True)))
        return possible.log_density(self._values, self._names) - self._drawn


def _values_at_ranks(sample: Sample, cdf: xr.DataArray) -> FloatArray:
    """Return the values at which an array has the distribution function of a sample."""
    return sample_quantile(sample, cdf[RANK].values)


def _weighted(sample: Sample, ratios: FloatArray) -> Sample:
    return replace(sample, weights=np.exp(ratios - ratios.max()))


def _array(
    found: Estimate,
    template: xr.DataArray,
    name: str,
    level: float,
    counts: Mapping[str, int | str],
) -> xr.DataArray:
    """Return answers as an estimate array of the entries that another one has."""
    long_name = f"{CATALOGUE[name].title}, of {template.attrs['long_name']}"
    return found.in_place_of(template, level=level).assign_attrs({"long_name": long_name, **counts})


# Parameters fitted to specimens: the plug-in answer, and the interval over the draws.


def events_over_draws(
    runs: xr.Dataset | BlockedRuns,
    probabilities: xr.DataArray,
    events: Sequence[JointEvent],
    joint: JointDistribution,
    level: float,
) -> xr.DataArray:
    """Compute the probabilities of events over parameters that fit the specimens as well.

    Parameters
    ----------
    runs : Dataset or BlockedRuns
        A sample of `joint`. Of more than 65 536 runs the first ones are taken.
    probabilities : DataArray
        Along ``event`` and ``bound``: those of the next one.
    events : sequence of JointEvent
        With all that `probabilities` has.
    joint : JointDistribution
    level : float
        Confidence level.

    Returns
    -------
    DataArray
        Along ``event`` and ``bound``: the median over the draws, and the interval over them.
    """
    handle = LoadedDataset.of(runs)
    taken = handle.read(0, min(handle.size, BLOCK)).assign_attrs(handle.attrs)
    independent = taken.assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)})
    by_condition = {event.condition: event for event in events}
    asked = [by_condition[str(each)] for each in probabilities["event_condition"].values]
    outputs = sorted(set[str]().union(*(each.outputs for each in asked)))
    samples, found = samples_of(LoadedDataset(independent), outputs), []
    for place, event in enumerate(asked):
        sample, occurs = event_sample(event, samples, level)
        templates = {"exceedance": probabilities[[place]]}
        over = _OverDraws(sample, None, templates, np.asarray(occurs, dtype=np.bool_))
        estimate = _through_draws(over, sample, independent, joint).estimate("exceedance")
        note = texts.FIRST_RUNS.format(runs=BLOCK) if handle.size > BLOCK else ""
        found.append(estimate[0].with_note(note))
    long_name = "probability of an event over parameters that fit as well"
    joined = Estimate.stacked(found, axis=0)
    return joined.in_place_of(probabilities, level=level).assign_attrs({"long_name": long_name})


def _fitted_estimates(
    sample: Sample,
    runs: xr.Dataset,
    quantity: QuantityOfInterest,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
) -> Iterator[tuple[str, xr.DataArray, Estimate]]:
    fitted = [e.unknown.fitted for e in joint.fitted if isinstance(e.unknown, FittedParameters)]
    plugged_in = _weighted(sample, _Ratios(runs, joint, joint.fitted).at(fitted))
    over = _over_draws(sample, runs, quantity, joint, templates)
    for name, template in templates.items():
        if name != "cdf":
            plug_in = resolve(CATALOGUE[name].by["part"])(plugged_in, quantity)
            yield f"plug_in_{name}", template, plug_in
        yield f"fitted_{name}", template, over.estimate(name)


def _with_more_specimens(
    sample: Sample,
    runs: xr.Dataset,
    quantity: QuantityOfInterest,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the answers over the draws for more specimens of each input, along ``specimens``."""
    asked = {name: templates[name] for name in _OF_MORE if name in templates}
    found: dict[str, _OverDraws] = {}
    for entry in joint.fitted if asked else ():
        name = entry.variable.name
        if isinstance(entry.unknown, FittedParameters):
            for count, draws in entry.unknown.draws_of_more.items():
                over = _OverDraws(sample, quantity, asked)
                _through_draws(over, sample, runs, joint, instead={name: draws})
                found[f"{count} specimens of {name}"] = over
    for name, template in asked.items() if found else ():
        estimates = [over.estimate(name) for over in found.values()]
        labels = (SPECIMENS, np.array([*found], dtype=object), {"long_name": "specimens"})
        stacked = Estimate.stacked(estimates, axis=0)
        words = ", over parameters that fit more specimens"
        array = stacked.along(template, labels, words, level=sample.level)
        yield f"{MORE_SPECIMENS}{name}", array


def _over_draws(
    sample: Sample,
    runs: xr.Dataset,
    quantity: QuantityOfInterest,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
    place: Sequence[Distribution] = (),
) -> _OverDraws:
    """Return the answers over all draws, at a place of the boxes if there are any."""
    return _through_draws(_OverDraws(sample, quantity, templates), sample, runs, joint, place)


def _through_draws(
    over: _OverDraws,
    sample: Sample,
    runs: xr.Dataset,
    joint: JointDistribution,
    place: Sequence[Distribution] = (),
    instead: Mapping[str, Sequence[Distribution]] = MappingProxyType({}),
) -> _OverDraws:
    """Add all draws of the fitted parameters, those of some inputs in place of their own."""
    draws = [
        instead.get(each.variable.name, each.unknown.draws)
        for each in joint.fitted
        if isinstance(each.unknown, FittedParameters)
    ]
    ratios = _Ratios(runs, joint, (*joint.fitted, *joint.boxes))
    every = [*zip(*draws, strict=False)]  # for more specimens there are fewer
    for start in range(0, len(every), _TOGETHER):
        together = every[start : start + _TOGETHER]
        over.add(np.array([ratios.at([*each, *place])[sample.used] for each in together]))
    return over


class _OverDraws:
    """Answers of one output over draws of parameters, each with a draw for its sampling error."""

    def __init__(
        self,
        sample: Sample,
        quantity: QuantityOfInterest | None,
        templates: Mapping[str, xr.DataArray],
        event: BoolArray | None = None,
    ) -> None:
        self._sample, self._quantity, self._templates = sample, quantity, templates
        self._event = event  # (run,): whether it occurs, for its probability in place of others
        self._order = np.argsort(sample.values, kind="stable")
        self._sorted = sample.values[self._order]
        self._few = 0  # draws of which few runs count
        self._found: dict[str, list[FloatArray]] = {name: [] for name in templates}
        self._uniform = _spread_out(DRAWS)
        self._next = 0

    def add(self, ratios: FloatArray) -> None:
        """Take further draws into account, their log ratios of shape (draw, run)."""
        draws = len(ratios)
        uniform = self._uniform[self._next : self._next + draws]
        self._next += draws
        if not self._sample.size:
            return
        largest = ratios.max(axis=1, keepdims=True)
        weights = np.exp(ratios - np.where(np.isfinite(largest), largest, 0.0))
        total = weights.sum(axis=1, keepdims=True)
        shares = weights / np.where(total > 0, total, 1.0)
        sizes = effective_sizes(shares)
        self._few += int((sizes < _FEW_OF_DRAW * self._sample.size).sum())
        for name, found in self._found.items():
            if name == "mean":
                found.append(self._means(shares, sizes, uniform))
            elif name == "quantile":
                found.append(self._quantiles(shares, uniform))
            elif name == "cdf":
                values = _values_at_ranks(self._sample, self._templates["cdf"])
                places = np.searchsorted(self._sorted, values, side="right") - 1
                found.append(np.cumsum(shares[:, self._order], axis=1)[:, places])
            else:
                found.append(self._probabilities(shares, self._events(name), uniform))

    def estimate(self, name: str) -> Estimate:
        """Return the median and the interval over the draws."""
        found = self._found[name]
        if not found:
            shape = self._templates[name].shape[:-1]
            return Estimate.without_bounds(np.full(shape, np.nan), texts.NO_RUN)
        tail = (1 - self._sample.level) / 2
        values = np.concatenate(found)
        finite = np.isfinite(values).all(axis=0)
        low, middle, high = np.quantile(values, [tail, 0.5, 1 - tail], axis=0)
        draws, note = self._next, ""
        if self._few:
            note = texts.FEW_RUNS_OF_DRAWS.format(few=self._few, draws=draws)
        method = texts.CURVES_OF_DRAWS if name == "cdf" else texts.OVER_DRAWS
        estimate = Estimate(middle, low, high, method.format(draws=draws), "nominal")
        missing = self._sample.missing.size
        left_out = texts.WITHOUT_MISSING.format(runs=missing) if missing else ""
        estimate = estimate.with_note(note, left_out, texts.FAMILY_IS_GIVEN)
        reason = self._sample.reason_without_intervals or texts.NO_RUN_OF_DRAW
        if self._sample.reason_without_intervals:
            finite = np.zeros_like(finite)
        return estimate.remove_bounds_at(~finite, reason)

    def _events(self, name: str) -> BoolArray:
        """Return whether each event of a probability occurs, shape (event, run)."""
        values, quantity = self._sample.values, self._quantity
        if self._event is not None:
            rows = [self._event]
        elif quantity is None:
            rows = []
        elif name == "exceedance":
            rows = [values > each.value for each in quantity.thresholds]
        elif name == "below":
            rows = [values < each.value for each in quantity.lower_thresholds]
        else:
            rows = [values == kind for kind in range(len(quantity.output.categories))]
        return np.array(rows, dtype=np.bool_).reshape(len(rows), len(values))

    def _probabilities(
        self, shares: FloatArray, events: BoolArray, uniform: FloatArray
    ) -> FloatArray:
        columns = events.T.astype(np.float64)
        p, squares = shares @ columns, (shares**2) @ columns
        every = (shares**2).sum(axis=1, keepdims=True)
        return _probability_draw(p, squares, every, uniform[:, np.newaxis])

    def _means(self, shares: FloatArray, sizes: FloatArray, uniform: FloatArray) -> FloatArray:
        values = self._sample.values
        centre = float(values.mean())
        mean = shares @ (values - centre)
        squares = (shares**2) @ np.stack([(values - centre) ** 2, values - centre], axis=1)
        every = (shares**2).sum(axis=1)
        variance = squares[:, 0] - 2 * mean * squares[:, 1] + mean**2 * every
        freedom = np.maximum(sizes - 1, 1.0)
        error = np.sqrt(np.maximum(variance, 0.0) * sizes / freedom)
        return np.asarray(centre + mean + error * scipy.special.stdtrit(freedom, uniform))

    def _quantiles(self, shares: FloatArray, uniform: FloatArray) -> FloatArray:
        """Return quantiles at a probability with a draw for the error of the one that is there."""
        wanted = np.array(self._quantity.quantiles if self._quantity else ())
        ordered = shares[:, self._order]
        below, squares = np.cumsum(ordered, axis=1), np.cumsum(ordered**2, axis=1)
        middles = below - ordered / 2
        found = np.empty((len(shares), len(wanted)))
        for row in range(len(shares)):
            places = np.minimum(np.searchsorted(below[row], wanted), below.shape[1] - 1)
            p, own = below[row, places], squares[row, places]
            at = _probability_draw(p, own, squares[row, -1], uniform[row])
            # As far from the level as the draw lies from the share of the runs there.
            found[row] = np.interp(wanted + (at - p), middles[row], self._sorted)
        return found


def _spread_out(count: int) -> FloatArray:
    """Return numbers between 0 and 1 that are spread evenly, also those of any part in a row.

    Multiples of the golden ratio need no random stream.
    """
    return np.asarray((np.arange(count) + 0.5) * ((math.sqrt(5) - 1) / 2) % 1.0)


def _probability_draw(
    p: FloatArray, squares: FloatArray, every: FloatArray, uniform: FloatArray
) -> FloatArray:
    """Return a draw of a probability given the runs: beta, at the effective number of runs.

    Parameters
    ----------
    p : ndarray, shape (...)
        Share of the weight in the event.
    squares, every : ndarray, shape (...)
        Sums of the squares of the weights over the event and over all runs; the weights add to 1.
    uniform : ndarray, shape (...)
        Where in the distribution the draw lies.
    """
    error = (1 - 2 * p) * squares + p**2 * every
    is_known = (error > 0) & (p > 0) & (p < 1)
    runs = np.where(is_known, p * (1 - p) / np.where(is_known, error, 1.0), 1 / every)
    inside = np.clip(p, 0.0, 1.0)
    return np.asarray(
        scipy.special.betaincinv(inside * runs + 0.5, (1 - inside) * runs + 0.5, uniform)
    )


# Parameters that are intervals: the least and the largest answer over the box.


def _box_estimates(
    sample: Sample,
    runs: xr.Dataset,
    quantity: QuantityOfInterest,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
) -> Iterator[tuple[str, xr.DataArray, Estimate]]:
    entries = joint.boxes
    boxes = [each.unknown for each in entries if isinstance(each.unknown, ParameterBox)]
    places = [*grid_of_boxes(boxes)]
    ratios, sizes = _Ratios(runs, joint, entries), []
    found: dict[str, list[Estimate]] = {name: [] for name in templates}
    for place in places:
        own = _weighted(sample, ratios.at(place))
        sizes.append(own.effective_size)
        for name, estimates in found.items():
            if name == "cdf":
                estimates.append(_cdf(own, _values_at_ranks(sample, templates[name])))
            else:
                estimates.append(resolve(CATALOGUE[name].by["part"])(own, quantity))
    at, reason = _texts_of(entries, places), _reason_without_bounds(min(sizes), sample.size)
    for name, template in templates.items():
        for end, estimate in _ends(Estimate.stacked(found[name], axis=0), at, reason):
            yield f"{end}_{name}", template, estimate
    if joint.fitted and not reason:
        yield from _totals(sample, runs, quantity, joint, templates)


def _texts_of(
    entries: Sequence[RandomInput], places: Sequence[tuple[Distribution, ...]]
) -> list[str]:
    """Return each place of the boxes in words."""
    return [
        ", ".join(
            f"{entry.variable.name} of {parameters_text(each, entry.display_unit)}"
            for entry, each in zip(entries, place, strict=True)
        )
        for place in places
    ]


def _reason_without_bounds(least: float, runs: int) -> str:
    """Return why weights allow no bounds, where so few runs count; empty where they do."""
    if least >= max(_FEWEST_OF_BOX, _LEAST_SHARE_OF_BOX * runs):
        return ""
    return texts.FEW_RUNS_OF_BOX.format(
        least=least,
        share=100 * least / max(runs, 1),
        fewest=_FEWEST_OF_BOX,
        most=100 * _LEAST_SHARE_OF_BOX,
    )


def event_bounds_over_boxes(
    runs: xr.Dataset, events: Sequence[JointEvent], joint: JointDistribution, level: float
) -> OutputStatistics:
    """Estimate the bounds of the probabilities of events over parameters that are intervals.

    Parameters
    ----------
    runs : Dataset
        Of a design whose points go over the boxes of `joint`.
    events : sequence of JointEvent
    joint : JointDistribution
    level : float
        Confidence level of the intervals.

    Returns
    -------
    dict of str to DataArray
        ``lower_probability`` and ``upper_probability`` along ``bounded_event`` and ``bound``; empty
        without events.
    """
    independent = runs.assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)})
    samples = samples_of(
        LoadedDataset(independent), sorted(set[str]().union(*(each.outputs for each in events)))
    )
    boxes = [each.unknown for each in joint.boxes if isinstance(each.unknown, ParameterBox)]
    places, ratios = [*grid_of_boxes(boxes)], _Ratios(runs, joint, joint.boxes)
    at = _texts_of(joint.boxes, places)
    found: dict[str, list[Estimate]] = {"lower": [], "upper": []}
    for event in events:
        sample, occurs = event_sample(event, samples, level)
        weighted = [_weighted(sample, ratios.at(place)) for place in places]
        each = Estimate.stacked([event_probability(own, occurs) for own in weighted], axis=0)
        least = min(own.effective_size for own in weighted)
        reason = _reason_without_bounds(least, sample.size)
        for end, estimate in _ends(each, at, reason):
            found[end].append(estimate)
    names = np.array([event.condition for event in events], dtype=object)
    return {
        f"{end}_probability": Estimate.stack(
            estimates,
            BOUNDED_EVENT,
            units="1",
            long_name=f"{end} bound of the probability of an event over the intervals",
            coordinates={BOUNDED_EVENT: (BOUNDED_EVENT, names, {"long_name": "event"})},
            level=level,
        )
        for end, estimates in found.items()
        if events
    }


def _totals(
    sample: Sample,
    runs: xr.Dataset,
    quantity: QuantityOfInterest,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
) -> Iterator[tuple[str, xr.DataArray, Estimate]]:
    """Yield intervals over uncertain parameters and intervals together, computed and not added.

    They reach from the least lower limit to the largest upper one of the corners and the middle.
    """
    boxes = [each.unknown for each in joint.boxes if isinstance(each.unknown, ParameterBox)]
    middle = tuple(
        box.at(tuple((lower + upper) / 2 for lower, upper in box.ends.values())) for box in boxes
    )
    places = [middle, *product(*(box.corners() for box in boxes))]
    names = {name: each for name, each in templates.items() if name != "cdf"}
    found = [_over_draws(sample, runs, quantity, joint, names, place) for place in places]
    for name, template in names.items():
        each = [over.estimate(name) for over in found]
        ends = np.array([estimate.bounds for estimate in each])
        total = replace(each[0], lower=ends[..., 1].min(axis=0), upper=ends[..., 2].max(axis=0))
        method = texts.OVER_BOX.replace("{points}", str(len(places)))
        yield f"total_{name}", template, total.with_method(method)


def _cdf(sample: Sample, values: FloatArray) -> Estimate:
    """Return the distribution function of weighted runs at some values, pointwise."""
    assert sample.run_weights is not None
    below, errors = weighted_cdf(sample.values, sample.run_weights, values)
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(below, reason)
    ends = weighted_probability_interval(below, errors, sample.run_weights, sample.level)
    found = Estimate(below, *ends, texts.CLOPPER_PEARSON_WEIGHTED, "nominal")
    return found.remove_bounds_at((below <= 0) | (below >= 1), texts.CONSTANT_EVENT)


def _ends(each: Estimate, at: Sequence[str], reason: str) -> Iterator[tuple[str, Estimate]]:
    """Yield the least and the largest of estimates along the first axis, each with its limit.

    With a reason they have none.

    The limit of the upper bound is the largest upper limit of all, which is at least the one where
    the true bound is. So no search needs a correction.
    """
    known = np.asarray(each.has_bounds).all(axis=0)
    reasons = np.asarray(each.note, dtype=object)
    bounds = each.bounds
    for end, place in (
        ("lower", np.asarray(np.argmin(bounds[..., 0], axis=0))),
        ("upper", np.asarray(np.argmax(bounds[..., 0], axis=0))),
    ):
        value, lower, upper = (
            np.take_along_axis(bounds[..., column], place[np.newaxis], axis=0)[0]
            for column in range(3)
        )
        if end == "lower":
            lower = bounds[..., 1].min(axis=0)
        else:
            upper = bounds[..., 2].max(axis=0)
        which = texts.END_OF_BOX[end]
        said = np.array(
            [which.format(at=text) for text in map(at.__getitem__, place.ravel())], dtype=object
        )
        found = Estimate(value, lower, upper, "", "conservative")
        own = np.take_along_axis(np.asarray(each.method, dtype=object), place[np.newaxis], axis=0)
        method = texts.OVER_BOX.replace("{points}", str(len(at)))
        found = replace(found, method=own[0], note=said.reshape(place.shape)).with_method(method)
        # Where one distribution has no interval, its limit may be the largest.
        without = np.array(
            [
                next((str(text) for text in column if text), texts.NO_RUN)
                for column in np.where(each.has_bounds, "", reasons).reshape(len(at), -1).T
            ],
            dtype=object,
        )
        refused = replace(Estimate.without_bounds(value), note=without.reshape(np.shape(value)))
        if reason:
            yield end, Estimate.without_bounds(value, reason)
        else:
            yield end, found.replace_at(~known, refused)
