"""Shares of an output's variance: of the form of the model, of its inputs, and of both together."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.blocks import LoadedDataset
from uqpen.core.catalogue import MODEL_FORM_STATISTICS
from uqpen.core.labels import (
    LOWER_THRESHOLD,
    MOMENTS,
    OF_EXCEEDANCE,
    QUANTILES,
    SAMPLING,
    STATUS,
    THRESHOLD,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import common_runs, worst_status_runs
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, analyze, run_counts
from uqpen.statistics.distribution_function.probabilities import (
    lower_threshold_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around, quantiles_at
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import clopper_pearson, student_quantile
from uqpen.statistics.moments.sample_moments import combined_error, correlation_of_shares
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import sample_of
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.standard_errors import standard_error

# A smaller share is 0 but for rounding.
_ROUNDING = 1e-12
_SHARES = [each for each in MODEL_FORM_STATISTICS.values() if not each.of]
_OF_EVENTS = [each for each in MODEL_FORM_STATISTICS.values() if each.prefix == OF_EXCEEDANCE]


def model_form_shares(
    runs: Mapping[str, xr.Dataset], quantities: Sequence[QuantityOfInterest]
) -> dict[str, OutputStatistics]:
    """Split the variance of each output over several models that count the same.

    With M for the model and X for the inputs, Var y = Var E[y|M] + Var E[y|X] + the rest, as in an
    analysis of variance with two factors. All models have the same points, so each part is known
    from the same runs. The same is done with the event that a threshold is exceeded.

    Parameters
    ----------
    runs : mapping of str to Dataset
        The runs of each model in one design.

    Returns
    -------
    dict of str to dict of str to DataArray
        By output, ``model_form_share``, ``parameter_share`` and ``interaction_share``; the same of
        events as ``exceedance_model_form_share`` and so on along ``threshold``. Of the runs that
        all models with that output completed. Empty where the design is no sample of the inputs, or
        fewer than two models have the output.
    """
    found: dict[str, OutputStatistics] = {}
    if not all(Sampling(each.attrs[SAMPLING]).is_sample for each in runs.values()):
        return found
    for quantity in quantities:
        output = quantity.output
        having = [each for each in runs.values() if output.name in each]
        if len(having) > 1 and output.is_number and not output.categories:
            found[output.name] = _of_output(common_runs(having), quantity)
    return found


def _of_output(runs: Sequence[xr.Dataset], quantity: QuantityOfInterest) -> OutputStatistics:
    name, level = quantity.output.name, quantity.confidence_level
    worst = worst_status_runs(runs)
    worst = worst.assign({name: worst[name].copy()})
    values = np.stack([np.asarray(each[name].values, dtype=np.float64) for each in runs])
    is_used = (worst[STATUS].values == Status.OK) & np.isfinite(values).all(axis=0)
    kept = np.flatnonzero(is_used)
    sample = replace(sample_of(worst, name), used=kept, values=values[0, kept], level=level)
    of_value = _shares(sample, values[:, kept])
    counts = {**run_counts(LoadedDataset.of(worst)), "runs_used": int(kept.size)}
    arrays = {
        share.name: of_value[number].to_array(units="1", long_name=share.title, level=level)
        for number, share in enumerate(_SHARES)
    }
    if quantity.thresholds:
        events = [
            _shares(sample, (values[:, kept] > each.value).astype(np.float64), is_event=True)
            for each in quantity.thresholds
        ]
        for number, share in enumerate(_OF_EVENTS):
            arrays[share.name] = Estimate.stack(
                [each[number] for each in events],
                THRESHOLD,
                units="1",
                long_name=share.title,
                coordinates=threshold_coordinates(quantity),
                level=level,
            )
    return {key: array.assign_attrs(counts) for key, array in arrays.items()}


def _shares(sample: Sample, values: FloatArray, *, is_event: bool = False) -> Estimate:
    """Estimate the three shares from values of shape (model, run)."""
    nothing = np.full(3, np.nan)
    if not values.shape[1]:
        return Estimate.without_bounds(nothing, texts.NO_RUN)
    if sample.weights is not None:
        return Estimate.without_bounds(nothing, texts.NOT_WEIGHTED)
    if values.min() == values.max():
        return Estimate.without_bounds(
            nothing, texts.CONSTANT_EVENT if is_event else texts.CONSTANT_OUTPUT
        )
    # Deviations over the largest, whose squares do not overflow.
    largest = np.abs(values).max()
    scaled = values / (largest if largest > 0 else 1.0)
    deviations = scaled - scaled.mean()
    shares, errors, freedom = _variance_shares(sample, deviations / np.abs(deviations).max())
    reason = sample.reason_without_intervals
    # Of one model at least: another may show the event always or never.
    if is_event and not has_enough_runs_around(sample, values.sum(axis=1)).any():
        reason = reason or texts.TOO_ONE_SIDED
    if reason:
        return Estimate.without_bounds(shares, reason)
    half = student_quantile(freedom, sample.level) * errors
    label = "nominal"
    if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        label = "conservative"
    method = texts.DELTA_METHOD.format(error_model=sample.error_model)
    note = "" if is_event else _tail_note(sample, values)
    ends = shares - half, np.minimum(shares + half, 1.0)
    return Estimate(shares, *ends, method, label, note)


def _tail_note(sample: Sample, values: FloatArray) -> str:
    """Return the note on the model with the heaviest tail."""
    shapes = [replace(sample, values=each).shape for each in values]
    varying = [each for each in shapes if not each.sample.is_constant]
    if not varying:
        return ""
    heaviest = max(varying, key=lambda each: float(each.kurtosis))
    if heaviest.hidden_tail:
        return texts.DOUBTFUL_AS.format(reason=texts.ONLY_RUNS.format(runs=sample.size))
    if heaviest.is_heavy:
        return texts.DOUBTFUL_AS.format(reason=heaviest.tail_note)
    return texts.DOUBTFUL_TAIL if heaviest.is_doubtful else ""


def _variance_shares(sample: Sample, values: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the three shares, whose sum is 1, their standard errors and the degrees of freedom.

    The errors are those of the delta method.
    """
    runs = values.shape[1]
    unbiased = runs / (runs - 1) if runs > 1 else 1.0
    means = values.mean(axis=1, keepdims=True)
    deviations = values - means
    about_mean = (means - means.mean())[:, 0]
    of_runs = deviations.mean(axis=0)
    differences = deviations - of_runs
    noise, _ = standard_error(sample, differences)
    # The scatter of the models' means by chance is not their form.
    noise_of_form = float(np.nan_to_num(noise**2).mean())
    form = float((about_mean**2).mean()) - noise_of_form
    within = float((deviations**2).mean()) * unbiased
    parameters = float((of_runs**2).mean()) * unbiased
    total = form + within
    shares = np.array([form, parameters, within - parameters]) / total
    shares = np.where(np.abs(shares) < _ROUNDING, 0.0, shares)
    influence_of_form = 2 * (about_mean[:, np.newaxis] * differences).mean(axis=0)
    influence_of_within = (deviations**2).mean(axis=0)
    influence_of_parameters = of_runs**2
    influence_of_both = influence_of_within - influence_of_parameters
    parts = np.stack([influence_of_form, influence_of_parameters, influence_of_both])
    influence_of_total = influence_of_form + influence_of_within
    influence = (parts - shares[:, np.newaxis] * influence_of_total) / total
    linear, freedom = standard_error(sample, influence)
    # Where the models' means agree, the error is that of the squares of the noise. The product
    # of errors bounds their covariance.
    squared = np.sqrt(2) * noise_of_form / total * np.array([1.0, 0.0, 0.0])
    return shares, np.sqrt(linear**2 + squared**2), freedom


# Differences between models at common points, where the random draw affects all alike.

_GROUPS = (MOMENTS, QUANTILES)


def model_differences(
    first: xr.Dataset,
    other: xr.Dataset,
    quantities: Sequence[QuantityOfInterest],
    *,
    of_answers: bool = False,
) -> dict[str, OutputStatistics]:
    """Statistics of the differences between another model's outputs and those of the first.

    Two models at the same points differ far less than their runs scatter, so the difference has a
    smaller error than either.

    Parameters
    ----------
    first, other : Dataset
        Runs of the two models in one design. Those of the rounds that both have run are compared.
    of_answers : bool
        True for the differences of the standard deviations, of the quantiles and of the requested
        probabilities, too.

    Returns
    -------
    dict of str to dict of str to DataArray
        By output, moments and quantiles of other minus first over the runs that both models
        completed; ``difference_of_std``, ``difference_of_quantile``, ``exceedance`` and ``below``.
        Empty where the design is no sample of the inputs.
    """
    if not Sampling(first.attrs[SAMPLING]).is_sample:
        return {}
    requested = [
        replace(quantity, thresholds=(), lower_thresholds=(), tolerance_contents=())
        for quantity in quantities
        if quantity.output.name in first and not quantity.output.categories
    ]
    first, other = common_runs([first, other])
    runs = worst_status_runs([first, other])
    came_back = runs[STATUS].values == Status.OK
    for quantity in requested:
        name = quantity.output.name
        difference = other[name].values - first[name].values
        difference[~came_back] = np.nan
        runs[name] = other[name].copy(data=difference)
    found = analyze(runs, requested, only=_GROUPS)
    for quantity in quantities if of_answers else ():
        name = quantity.output.name
        if name not in found:
            continue
        sample = replace(sample_of(runs, name), level=quantity.confidence_level)
        found[name] |= _event_differences(first, other, sample, quantity)
        if quantity.output.is_number:
            one, two = (
                replace(sample, values=each[name].values[sample.used]) for each in (first, other)
            )
            quantiles = [quantile_difference(one, two, each) for each in quantity.quantiles]
            differences = {"std": std_difference(one, two), "quantile": Estimate.stacked(quantiles)}
            # They have the entries of those of the difference.
            found[name] |= {
                f"difference_of_{key}": each.in_place_of(found[name][key], level=sample.level)
                for key, each in differences.items()
            }
    return found


def std_difference(first: Sample, other: Sample) -> Estimate:
    """Return the difference of two standard deviations over pairs of runs, other minus first.

    Its error is that of the mean of (u²/s) / 2 of the one minus that of the other, where u are the
    deviations and s is the standard deviation.
    """
    if first.size < 2:
        return Estimate.without_bounds(math.nan, first.reason_without_intervals or texts.NO_RUN)
    stds = [float(each.values.std(ddof=1)) for each in (first, other)]
    value = stds[1] - stds[0]
    heavy = (each.shape.tail_note for each in (first, other) if each.shape.may_be_heavy)
    reasons = (first.reason_without_intervals, texts.NOT_WEIGHTED * (first.weights is not None))
    if reason := next(filter(None, (*reasons, *heavy)), ""):
        return Estimate.without_bounds(value, reason)
    parts = [
        (each.values - each.values.mean()) ** 2 / (2 * std) if std > 0 else np.zeros(each.size)
        for each, std in zip((first, other), stds, strict=True)
    ]
    error, freedom = standard_error(first, parts[1] - parts[0])
    half = student_quantile(freedom, first.level) * float(error)
    method = texts.DELTA_METHOD.format(error_model=first.error_model)
    return Estimate(value, value - half, value + half, method, "nominal")


def quantile_difference(first: Sample, other: Sample, probability: float) -> Estimate:
    """Return the difference of two quantiles over pairs of runs, other minus first.

    The intervals of both are joined by MOVER, with the correlation of lying below each. Where this
    is the same for all runs, it may still be another in 3.7/n of all, so that the interval is never
    0 ± 0.
    """
    own, others = (quantiles_at(each, [probability])[0] for each in (first, other))
    value = float(others.value - own.value)
    if not np.isfinite([own.bounds, others.bounds]).all():
        return Estimate.without_bounds(value, str(own.note or others.note))
    events = first.values <= own.value, other.values <= others.value
    unseen = -math.log((1 - first.level) / 2) / first.size
    largest = 1 - unseen / (2 * probability * (1 - probability))
    correlation = min(correlation_of_shares(first, *events), largest)
    # Errors of the same sign cancel, so those to either side count the same.
    one, other_one = (float(each.upper - each.lower) / 2 for each in (own, others))
    half = combined_error(one, other_one, max(correlation, -1.0))
    return Estimate(value, value - half, value + half, texts.MOVER_OF_QUANTILES, "conservative")


def _event_differences(
    first: xr.Dataset, other: xr.Dataset, sample: Sample, quantity: QuantityOfInterest
) -> OutputStatistics:
    """Return the differences of probabilities, from the pairs of runs whose event changes."""
    name = quantity.output.name
    pair = [each[name].values[sample.used] for each in (first, other)]
    found: OutputStatistics = {}
    for statistic, compare, along, requested in (
        ("exceedance", operator.gt, threshold_coordinates, quantity.thresholds),
        ("below", operator.lt, lower_threshold_coordinates, quantity.lower_thresholds),
    ):
        if requested:
            events = [[compare(values, each.value) for values in pair] for each in requested]
            estimates = [event_difference(sample, *each) for each in events]
            found[statistic] = Estimate.stack(
                estimates,
                THRESHOLD if statistic == "exceedance" else LOWER_THRESHOLD,
                units="1",
                long_name=f"difference of the probability that {quantity.output.title} lies there",
                coordinates=along(quantity),
                level=sample.level,
            ).assign_attrs(run_counts(LoadedDataset.of(worst_status_runs([first, other]))))
    return found


def event_difference(sample: Sample, first: BoolArray, other: BoolArray) -> Estimate:
    """Return the difference of the probabilities of an event in pairs of runs, other minus first.

    Only the pairs whose event changes count. Clopper and Pearson's intervals of the probabilities
    of both kinds of change are joined by MOVER, with the correlation of two counts of a multinomial
    distribution. Where no event changes, each kind still has a probability of up to 3.7/n, so that
    the interval is never 0 ± 0.

    Parameters
    ----------
    sample : Sample
        Its runs are the pairs that both have completed.
    first, other : ndarray of bool, shape (run,)

    References
    ----------
    Zou, G. Y. (2007). Psychol. Methods 12, 399-413; Newcombe, R. G. (1998). Stat. Med. 17, 2635.
    """
    size = sample.size
    counts = np.array([(other & ~first).sum(), (first & ~other).sum()])
    if not size:
        return Estimate.without_bounds(math.nan, texts.NO_RUN)
    to, away = shares = counts / size
    reason = sample.reason_without_intervals
    if not reason and sample.weights is not None:
        reason = texts.NOT_WEIGHTED
    if reason:
        return Estimate.without_bounds(float(to - away), reason)
    lower, upper = clopper_pearson(counts, size, sample.level)
    rest = math.sqrt((1 - to) * (1 - away))
    correlation = -math.sqrt(to * away) / rest if rest else 0.0

    def margin(one: float, opposite: float) -> float:
        return math.sqrt(one**2 + opposite**2 - 2 * correlation * one * opposite)

    below, above = shares - lower, upper - shares
    ends = (
        max(to - away - margin(below[0], above[1]), -1.0),
        min(to - away + margin(above[0], below[1]), 1.0),
    )
    return Estimate(float(to - away), *ends, texts.DISCORDANT_PAIRS, "conservative")
