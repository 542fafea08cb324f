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
from typing import Any

import numpy as np
import scipy
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUNDED_EVENT,
    MORE_SPECIMENS,
    PROBABILITY,
    RANK,
    SAMPLING,
    SPECIMENS,
    WEIGHT,
)
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.streams import BLOCK
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.measurements import parameters_text
from uqpen.distributions.unknowns import DRAWS, grid_of_boxes
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, output_run_counts, run_counts
from uqpen.statistics.distribution_function.probabilities import event_probability
from uqpen.statistics.distribution_function.quantiles import sample_quantile
from uqpen.statistics.estimate import Estimate, NamedArrays
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
    if not (sampling is Sampling.OVER_BOX if joint.boxes else joint.fitted and has_sample):
        return {}
    taken, note = _first_runs(runs)
    part = LoadedDataset(taken)
    of_runs = run_counts(part)
    found: dict[str, OutputStatistics] = {}
    records = [each for each in _KNOWN_OVER_UNKNOWNS if only is None or each.group in only]
    for quantity in quantities:
        if quantity.output.dims:
            continue
        output = quantity.output.name
        # Strata of the points are not kept by weights: without them the error is larger.
        sample = replace(sample_of(taken, output), level=quantity.confidence_level)
        sample = replace(sample, replicates=np.zeros_like(sample.replicates))
        counts = output_run_counts(part, of_runs, output)
        own: OutputStatistics = {}
        templates: OutputStatistics = {}
        for record in records:
            made = dict(resolve(record.by["sample"])(sample, quantity))
            templates |= {record.name: made[record.name]} if record.name in made else {}
            if joint.boxes and "cdf_value" in made:
                own["cdf_value"] = made["cdf_value"].assign_attrs(counts)
        if note and joint.fitted:
            # The function of all runs has other values.
            templates.pop("cdf", None)
        estimates = _box_estimates if joint.boxes else _fitted_estimates
        for name, template, estimate in estimates(sample, taken, quantity, joint, templates):
            array = estimate.with_note(note).in_place_of(template, level=sample.level)
            long_name = f"{CATALOGUE[name].title}, of {template.attrs['long_name']}"
            own[name] = array.assign_attrs({"long_name": long_name, **counts})
        if joint.fitted and not joint.boxes:
            more = _with_more_specimens(sample, taken, quantity, joint, templates)
            own |= {name: array.assign_attrs(counts) for name, array in more}
        found[output] = own
    return found


def _first_runs(runs: xr.Dataset | BlockedRuns) -> tuple[xr.Dataset, str]:
    """Return the runs that are taken, as independent draws, and the note that there are others."""
    handle = LoadedDataset.of(runs)
    taken = handle.read(0, min(handle.size, BLOCK))
    taken = taken.assign_attrs({**handle.attrs, SAMPLING: str(Sampling.INDEPENDENT)})
    return taken, texts.FIRST_RUNS.format(runs=BLOCK) if handle.size > BLOCK else ""


class _Ratios:
    """Logarithms of the ratios of densities at all runs, by the distributions of some inputs."""

    def __init__(self, runs: xr.Dataset, joint: JointDistribution, names: Sequence[str]) -> None:
        self._joint, self._names = joint, names
        self._values = {name: runs[name].values for name in names}
        self._drawn = joint.log_density(self._values, names)
        if WEIGHT in runs.coords:
            # Runs of other distributions count for those of the study by weights already.
            with np.errstate(divide="ignore"):
                self._drawn = self._drawn - np.log(runs[WEIGHT].values)

    def at(self, distributions: Sequence[Distribution]) -> FloatArray:
        """Return the ratios at values of the unknowns, shape (run,)."""
        possible = self._joint.at(dict(zip(self._names, distributions, strict=True)))
        return possible.log_density(self._values, self._names) - self._drawn

    def weighted(self, sample: Sample, distributions: Sequence[Distribution]) -> Sample:
        """Return a sample with the weights at values of the unknowns."""
        ratios = self.at(distributions)
        return replace(sample, weights=np.exp(ratios - ratios.max()))


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
    taken, note = _first_runs(runs)
    by_condition = {event.condition: event for event in events}
    asked = [by_condition[str(each)] for each in probabilities["event_condition"].values]
    outputs = sorted(set[str]().union(*(each.outputs for each in asked)))
    samples, found = samples_of(LoadedDataset(taken), outputs), []
    for place, event in enumerate(asked):
        sample, occurs = event_sample(event, samples, level)
        template = {"exceedance": probabilities[[place]]}
        over = _over_draws(sample, taken, joint, template, {"exceedance": occurs[np.newaxis]})
        found.append(over["exceedance"][0].with_note(note))
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
    ratios = _Ratios(runs, joint, [*joint.fitted])
    plugged_in = ratios.weighted(sample, [each.fitted for each in joint.fitted.values()])
    over = _over_draws(sample, runs, joint, templates, _events(sample, quantity))
    for name, template in templates.items():
        if name != "cdf":
            plug_in = resolve(CATALOGUE[name].by["part"])(plugged_in, quantity)
            yield f"plug_in_{name}", template, plug_in
        yield f"fitted_{name}", template, over[name]


def _with_more_specimens(
    sample: Sample,
    runs: xr.Dataset,
    quantity: QuantityOfInterest,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
) -> NamedArrays:
    """Yield the answers over the draws for more specimens of each input, along ``specimens``."""
    asked = {name: templates[name] for name in _OF_MORE if name in templates}
    if not asked:
        return
    events = _events(sample, quantity)
    found = {
        f"{count} specimens of {name}": _over_draws(
            sample, runs, joint, asked, events, instead={name: draws}
        )
        for name, each in joint.fitted.items()
        for count, draws in each.draws_of_more.items()
    }
    labels = (SPECIMENS, np.array([*found], dtype=object), {"long_name": "specimens"})
    words = ", over parameters that fit more specimens"
    for name, template in asked.items() if found else ():
        stacked = Estimate.stacked((over[name] for over in found.values()), axis=0)
        yield f"{MORE_SPECIMENS}{name}", stacked.along(template, labels, words, level=sample.level)


def _events(sample: Sample, quantity: QuantityOfInterest) -> dict[str, BoolArray]:
    """Return whether the events of each kind of probability occur, shape (event, run)."""
    limits, lower = (
        np.array([each.value for each in thresholds])[:, np.newaxis]
        for thresholds in (quantity.thresholds, quantity.lower_thresholds)
    )
    kinds = np.arange(len(quantity.output.categories))[:, np.newaxis]
    values = sample.values
    return {"exceedance": values > limits, "below": values < lower, "share": values == kinds}


def _over_draws(
    sample: Sample,
    runs: xr.Dataset,
    joint: JointDistribution,
    templates: Mapping[str, xr.DataArray],
    events: Mapping[str, BoolArray],
    place: Sequence[Distribution] = (),
    instead: Mapping[str, Sequence[Distribution]] = MappingProxyType({}),
) -> dict[str, Estimate]:
    """Return answers over all draws of the parameters, each with a draw for its sampling error.

    They are at a place of the boxes if there are any. Inputs may have other draws `instead`.
    """
    draws = [instead.get(name, each.draws) for name, each in joint.fitted.items()]
    every = [*zip(*draws, strict=False)]  # for more specimens there are fewer
    ratios = _Ratios(runs, joint, [*joint.fitted, *joint.boxes])
    # Multiples of the golden ratio are spread evenly, also those of any part in a row.
    spread = np.asarray((np.arange(DRAWS) + 0.5) * ((math.sqrt(5) - 1) / 2) % 1.0)
    order = np.argsort(sample.values, kind="stable")
    ascending = sample.values[order]
    few, found = 0, {name: list[FloatArray]() for name in templates}
    for start in range(0, len(every), _TOGETHER) if sample.size else ():
        together = every[start : start + _TOGETHER]
        uniform = spread[start : start + len(together)]
        logarithms = np.array([ratios.at([*each, *place])[sample.used] for each in together])
        largest = logarithms.max(axis=1, keepdims=True)
        weights = np.exp(logarithms - np.where(np.isfinite(largest), largest, 0.0))
        total = weights.sum(axis=1, keepdims=True)
        shares = weights / np.where(total > 0, total, 1.0)
        sizes = effective_sizes(shares)
        few += int((sizes < _FEW_OF_DRAW * sample.size).sum())
        for name, template in templates.items():
            if name == "mean":
                answers = _means(sample.values, shares, sizes, uniform)
            elif name == "quantile":
                wanted = template[PROBABILITY].values
                answers = _quantiles(ascending, shares[:, order], wanted, uniform)
            elif name == "cdf":
                values = sample_quantile(sample, template[RANK].values)
                places = np.searchsorted(ascending, values, side="right") - 1
                answers = np.cumsum(shares[:, order], axis=1)[:, places]
            else:
                columns, every_square = events[name].T.astype(np.float64), shares**2
                answers = _probability_draw(
                    shares @ columns,
                    every_square @ columns,
                    every_square.sum(axis=1, keepdims=True),
                    uniform[:, np.newaxis],
                )
            found[name].append(answers)
    note = texts.FEW_RUNS_OF_DRAWS.format(few=few, draws=len(every)) if few else ""
    return {
        name: _of_draws(sample, name, np.concatenate(each), note)
        if each
        else Estimate.without_bounds(np.full(templates[name].shape[:-1], np.nan), texts.NO_RUN)
        for name, each in found.items()
    }


def _of_draws(sample: Sample, name: str, values: FloatArray, note: str) -> Estimate:
    """Return the median and the interval over the answers of all draws, along the first axis."""
    tail = (1 - sample.level) / 2
    low, middle, high = np.quantile(values, [tail, 0.5, 1 - tail], axis=0)
    method = texts.CURVES_OF_DRAWS if name == "cdf" else texts.OVER_DRAWS
    estimate = Estimate(middle, low, high, method.format(draws=len(values)), "nominal")
    missing = sample.missing.size
    left_out = texts.WITHOUT_MISSING.format(runs=missing) if missing else ""
    reason = sample.reason_without_intervals
    return estimate.with_note(note, left_out, texts.FAMILY_IS_GIVEN).remove_bounds_at(
        ~np.isfinite(values).all(axis=0) | bool(reason), reason or texts.NO_RUN_OF_DRAW
    )


def _means(
    values: FloatArray, shares: FloatArray, sizes: FloatArray, uniform: FloatArray
) -> FloatArray:
    centre = float(values.mean())
    mean = shares @ (values - centre)
    squares = (shares**2) @ np.stack([(values - centre) ** 2, values - centre], axis=1)
    every = (shares**2).sum(axis=1)
    variance = squares[:, 0] - 2 * mean * squares[:, 1] + mean**2 * every
    freedom = np.maximum(sizes - 1, 1.0)
    error = np.sqrt(np.maximum(variance, 0.0) * sizes / freedom)
    return np.asarray(centre + mean + error * scipy.special.stdtrit(freedom, uniform))


def _quantiles(
    ascending: FloatArray, shares: FloatArray, wanted: FloatArray, uniform: FloatArray
) -> FloatArray:
    """Return quantiles at a probability with a draw for the error of the one that is there."""
    below, squares = np.cumsum(shares, axis=1), np.cumsum(shares**2, axis=1)
    middles = below - shares / 2
    found = np.empty((len(shares), len(wanted)))
    for row in range(len(shares)):
        places = np.minimum(np.searchsorted(below[row], wanted), below.shape[1] - 1)
        p, own = below[row, places], squares[row, places]
        at = _probability_draw(p, own, squares[row, -1], uniform[row])
        # As far from the level as the draw lies from the share of the runs there.
        found[row] = np.interp(wanted + (at - p), middles[row], ascending)
    return found


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
    ratios, places, at = _over_boxes(runs, joint)
    sizes: list[float] = []
    found: dict[str, list[Estimate]] = {name: [] for name in templates}
    for place in places:
        own = ratios.weighted(sample, place)
        sizes.append(own.effective_size)
        for name, estimates in found.items():
            if name == "cdf":
                values = sample_quantile(sample, templates[name][RANK].values)
                estimates.append(_cdf(own, values))
            else:
                estimates.append(resolve(CATALOGUE[name].by["part"])(own, quantity))
    reason = _reason_without_bounds(min(sizes), sample.size)
    for name, template in templates.items():
        for end, estimate in _ends(Estimate.stacked(found[name], axis=0), at, reason):
            yield f"{end}_{name}", template, estimate
    if joint.fitted and not reason:
        yield from _totals(sample, runs, quantity, joint, templates)


def _over_boxes(
    runs: xr.Dataset, joint: JointDistribution
) -> tuple[_Ratios, list[tuple[Distribution, ...]], list[str]]:
    """Return the ratios over the boxes, the places that are looked at, and these in words."""
    units = {each.variable.name: each.display_unit for each in joint.random}
    places = [*grid_of_boxes([*joint.boxes.values()])]
    in_words = [
        ", ".join(
            f"{name} of {parameters_text(each, units[name])}"
            for name, each in zip(joint.boxes, place, strict=True)
        )
        for place in places
    ]
    return _Ratios(runs, joint, [*joint.boxes]), places, in_words


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
    ratios, places, at = _over_boxes(runs, joint)
    found: dict[str, list[Estimate]] = {"lower": [], "upper": []}
    for event in events:
        sample, occurs = event_sample(event, samples, level)
        weighted = [ratios.weighted(sample, place) for place in places]
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
    boxes = joint.boxes.values()
    middle = tuple(
        box.at(tuple((lower + upper) / 2 for lower, upper in box.ends.values())) for box in boxes
    )
    places = [middle, *product(*(box.corners() for box in boxes))]
    names, events = {**templates}, _events(sample, quantity)
    names.pop("cdf", None)
    found = [_over_draws(sample, runs, joint, names, events, place) for place in places]
    method = texts.OVER_BOX.replace("{points}", str(len(places)))
    for name, template in names.items():
        each = Estimate.stacked((over[name] for over in found), axis=0)
        ends = {"lower": each.lower.min(axis=0), "upper": each.upper.max(axis=0)}
        yield f"total_{name}", template, replace(each[0], **ends).with_method(method)


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
    method = texts.OVER_BOX.replace("{points}", str(len(at)))
    # Where one distribution has no interval, its limit may be the largest.
    without = each[_places(np.argmin(each.has_bounds, axis=0))].note
    for end, place in (
        ("lower", np.argmin(each.value, axis=0)),
        ("upper", np.argmax(each.value, axis=0)),
    ):
        found = each[_places(place)]
        refused = Estimate.without_bounds(found.value, reason)
        if reason:
            yield end, refused
            continue
        limit = each.lower.min(axis=0) if end == "lower" else each.upper.max(axis=0)
        said = np.array([texts.END_OF_BOX[end].format(at=text) for text in at], dtype=object)
        found = replace(found, **{end: limit}, label="conservative", note=said[place])
        is_unknown = ~each.has_bounds.all(axis=0)
        yield end, found.with_method(method).replace_at(is_unknown, replace(refused, note=without))


def _places(first: Any) -> tuple[Any, ...]:
    """Return the index of one entry along the first axis for each place along the others."""
    return first, *np.indices(np.shape(first))
