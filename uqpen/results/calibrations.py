"""Unknowns from measurements as tables: values, what the data teach, and how well they fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import UnpackedStatistics
from uqpen.archive.groups import group_names, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    BLANK_ROW,
    BOUND,
    CALIBRATIONS,
    DISCREPANCY,
    EXPERIMENT,
    MEASURED,
    MEASURED_ROW,
    PROBABILITY,
    RUNS,
    UNKNOWN,
)
from uqpen.core.status import MANY_FAILED
from uqpen.core.units import scale
from uqpen.results.digits import count_text, estimate_text, number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable, label_with_unit, shown_unit
from uqpen.results.texts import capitalized, unit_suffix
from uqpen.results.validations import UNLIKELY, MeasuredRows


def _calibrations(tree: xr.DataTree) -> Iterator[tuple[str, UnpackedStatistics, xr.Dataset]]:
    """Yield the designs that teach unknowns, each with what its runs say, and the runs."""
    statistics = SourceStatistics(tree)
    for design in group_names(tree, CALIBRATIONS):
        yield design, statistics.of_runs(CALIBRATIONS, design), read_group(tree, RUNS, design)


def calibration_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the tables of each search for least squares and each posterior of a model."""
    for design, found, runs in _calibrations(tree):
        if "posterior_mean" in found:
            yield _posterior_table(design, found, runs)
        if "prediction" in found:
            yield _predictions_table(design, found, runs)
        if "unknown_value" in found:
            yield _unknowns_table(design, found, runs)
            yield _combinations_table(design, found)
        if (table := _fit_table(design, found)).rows:
            yield table


def fitted_rows(tree: xr.DataTree) -> Iterator[tuple[MeasuredRows, MeasuredRows | None]]:
    """Yield the rows of each output that unknown inputs were taught by, and those predicted."""
    for design, found, runs in _calibrations(tree):
        if "measured" not in found:
            continue
        outputs = found["measured_output"].values
        predicted = {each.output: each for each in predicted_rows(design, found, runs)}
        for output in dict.fromkeys(outputs.tolist()):
            own = {MEASURED_ROW: np.flatnonzero(outputs == output)}
            rows = {
                name: array.isel(own) for name, array in found.items() if MEASURED_ROW in array.dims
            }
            yield MeasuredRows(design, str(output), rows, runs), predicted.get(output)


def predicted_rows(
    design: str, found: Mapping[str, xr.DataArray], runs: xr.Dataset
) -> Iterator[MeasuredRows]:
    """Yield the rows of each output that a posterior predicts, without measured values.

    Parameters
    ----------
    design : str
    found : mapping of str to DataArray
        Statistics of the posterior.
    runs : Dataset
        Its runs.
    """
    outputs = found["prediction_output"].values if "prediction" in found else np.empty(0)
    for output in dict.fromkeys(outputs.tolist()):
        own = {BLANK_ROW: np.flatnonzero(outputs == output)}
        rows = {
            name.replace("prediction_row", "experiment_number").removeprefix("prediction_"): each
            for name, array in found.items()
            if BLANK_ROW in array.dims and (each := array.isel(own)).size
        }
        yield MeasuredRows(design, str(output), rows, runs)


def posterior_statements(tree: xr.DataTree) -> Iterator[tuple[str, str]]:
    """Yield what each posterior says, below a head of a few words."""
    for design, found, runs in _calibrations(tree):
        if "posterior_mean" in found:
            sentences = [*_posterior_sentences(found, runs)]
            if DISCREPANCY in runs.attrs and "posterior_std" in found:
                sentences.append(_discrepancy_sentence(tree, found, runs.attrs))
            yield design, " ".join(sentences)


def _discrepancy_sentence(
    tree: xr.DataTree, found: Mapping[str, xr.DataArray], attributes: Mapping[Any, Any]
) -> str:
    """Return what an error of the model itself means for the unknowns."""
    text = f"The model may have an error of its own: {attributes[DISCREPANCY]}."
    for design, other, runs in _calibrations(tree):
        is_without = DISCREPANCY not in runs.attrs and "posterior_std" in other
        if not is_without or runs.attrs[MEASURED] != attributes[MEASURED]:
            continue
        moved = []
        for name in other["posterior_mean"][UNKNOWN].values.tolist():
            at = {UNKNOWN: name}
            (mean, std), (alone, own) = (
                [float(each[f"posterior_{key}"].sel(at)[0]) for key in ("mean", "std")]
                for each in (found, other)
            )
            # The model alone is surer, and is what a reader would believe.
            if abs(mean - alone) > min(std, own):
                moved.append(name)
        if moved:
            return (
                f"{text} Without it ({design}), {', '.join(moved)} would be elsewhere by more than "
                "a standard deviation: these values make this model fit; they are no material data."
            )
        return f"{text} Without it ({design}), all unknowns are within a standard deviation."
    return f"{text} How much hangs on it, a second posterior with discrepancy = false would say."


# Experiments whose failed runs are named.
_MOST_NAMED = 3
# An unknown that has lost less of its prior's standard deviation is not taught.
_HARDLY_LEARNT = 0.05


def _posterior_sentences(found: Mapping[str, xr.DataArray], runs: xr.Dataset) -> Iterator[str]:
    mean = found["posterior_mean"]
    if "posterior_std" not in found:
        yield f"{capitalized(str(mean['note'].values[0]))}."
        return
    if (failed := float(found["posterior_failed_share"])) > MANY_FAILED:
        yield f"{failed:.0%} of the draws around the posterior failed, and are left out of it."
        shares = found["experiment_failed_share"]
        if shares.size > 1:
            often = shares[np.argsort(-shares.values, kind="stable")[:_MOST_NAMED]]
            named = (f"{int(each[EXPERIMENT])} ({float(each):.0%})" for each in often if each > 0)
            yield f"Failed runs are mostly of experiments {', '.join(named)}."
    taught, rest = [], []
    for place, name in enumerate(mean[UNKNOWN].values.tolist()):
        if found["learnt"].values[place] < _HARDLY_LEARNT:
            rest.append(name)
            continue
        like = str(found["unit_like"].values[place])
        unit, convert = unknown_unit(name, like, runs)
        quantiles = found["posterior_quantile"][{UNKNOWN: place}]
        ends = (quantiles.sel({PROBABILITY: each}).values[0] for each in _QUANTILES.values())
        shown = [float(convert(each)) for each in (mean.values[place, 0], *ends)]
        taught.append(f"{name} = {estimate_text(*shown)}{unit_suffix(unit)}")
    if taught:
        yield f"The measurements of {runs.attrs[MEASURED]} leave {', '.join(taught)} (95 %)."
    if rest:
        yield f"They say nothing on {', '.join(rest)}."
    yield _verdict(found)


def _verdict(found: Mapping[str, xr.DataArray]) -> str:
    """Return whether a posterior is good, in words."""
    mean = found["posterior_mean"]
    if "confirmed" in found:
        if found["confirmed"] == 0:
            return f"{capitalized(str(mean['note'].values[0]))}."
        size = float(found["effective_number"])
        return f"Runs of the model confirm it: {size:.2g} of their weighted draws are effective."
    if found["sampled_well"] == 1:
        return "The posterior is sampled well."
    notes = zip(mean[UNKNOWN].values.tolist(), mean["note"].values.tolist(), strict=True)
    faults = "; ".join(f"{name}: {note}" for name, note in notes if note)
    return f"The posterior is not sampled well: {faults}."


def fit_statements(tree: xr.DataTree) -> Iterator[tuple[str, str]]:
    """Yield what each search for least squares says, below a head of a few words."""
    for design, found, runs in _calibrations(tree):
        if "unknown_value" in found:
            yield design, " ".join(_fit_sentences(found, runs))


def _fit_sentences(found: Mapping[str, xr.DataArray], runs: xr.Dataset) -> Iterator[str]:
    p_value, values = float(found["fit_p_value"]), found["measured"].size
    what = f"{count_text(values, 'measured value')} of {runs.attrs[MEASURED]}"
    if math.isnan(p_value):
        yield f"The model is fitted to {what}, whose scatter gives the size of their errors."
    elif p_value < UNLIKELY:
        yield f"The model does not fit {what}, even at its best (p = {number_text(p_value, 2)})."
    else:
        yield f"The model fits {what} (p = {number_text(p_value, 2)})."
    names = found["unknown_value"][UNKNOWN].values.tolist()
    taught, rest = [], []
    for place, name in enumerate(names):
        error, prior = (float(found[key][place]) for key in ("standard_error", "prior_std"))
        if not error < (1 - _HARDLY_LEARNT) * prior:
            rest.append(name)
            continue
        unit = shown_unit(runs[name].attrs)
        shown = scale(unit).from_si(found["unknown_value"].values[place])
        taught.append(f"{name} = {estimate_text(*shown.tolist())}{unit_suffix(unit)}")
    if taught:
        yield f"They give {', '.join(taught)}."
    if rest:
        yield f"They say nothing on {', '.join(rest)} alone."
        error = float(found["combination_error"][0])
        if error < 1 - _HARDLY_LEARNT and len(names) > 1:
            text = combination_text(found["combination_weight"].values[0], names)
            yield (
                f"The combination {text}, each in standard deviations of its prior, is known to "
                f"{number_text(error, 2)}."
            )
    correlation = float(found["residual_correlation"])
    if abs(correlation) > 2 / math.sqrt(values):
        yield (
            f"The residuals follow each other (lag-1 correlation {number_text(correlation, 2)}): "
            "the model lacks something, or errors that are stated as independent are not."
        )


# Parts of a combination that are not written.
_SMALL_PART = 0.05


def combination_text(weights: FloatArray, names: Sequence[str]) -> str:
    """Return a combination of unknowns as a formula, the largest part first.

    >>> combination_text(np.array([-0.8, 0.6]), ["rate", "limit"])
    '0.80 rate - 0.60 limit'
    """
    order = np.argsort(-np.abs(weights), kind="stable")
    shown = [at for at in order.tolist() if abs(weights[at]) >= _SMALL_PART]
    sign = math.copysign(1.0, weights[shown[0]])
    text = ""
    for at in shown:
        weight = sign * weights[at]
        link = (" - " if weight < 0 else " + ") if text else ""
        text += f"{link}{abs(weight):.2f} {names[at]}"
    return text


def unknown_unit(
    name: str, like: str, runs: xr.Dataset
) -> tuple[str, Callable[[FloatArray], FloatArray]]:
    """Return the unit in which an unknown is shown, and its conversion from SI."""
    unit = shown_unit(runs[like].attrs)
    return unit, scale(unit).from_si if like == name else scale(unit).difference_from_si


def _posterior_table(
    design: str, found: Mapping[str, xr.DataArray], runs: xr.Dataset
) -> OutputTable:
    is_weighted = "surrogate_mean" in found
    beside = ["by the surrogate", "its sd"] if is_weighted else ["R-hat", "effective draws"]
    columns = ["mean", "sd", *_QUANTILES, "prior sd", "learnt", *beside]
    table = OutputTable(f"{design}: posterior", columns)
    for place, mean in enumerate(found["posterior_mean"]):
        name, at = str(mean[UNKNOWN].item()), {UNKNOWN: place}
        unit, convert = unknown_unit(name, str(found["unit_like"].values[place]), runs)
        difference = scale(unit).difference_from_si
        cells = [table.cell(mean, convert)]
        if "posterior_std" not in found:
            cells += [NOTHING] * (len(columns) - 1)
        else:
            quantiles = found["posterior_quantile"][at]
            cells.append(table.cell(found["posterior_std"][at], difference))
            cells += [
                table.cell(quantiles.sel({PROBABILITY: each}), convert)
                for each in _QUANTILES.values()
            ]
            cells.append(number_text(float(difference(found["prior_std"].values[place]))))
            cells.append(f"{max(float(found['learnt'][at]), 0.0):.1%}")
            if is_weighted:
                cells.append(table.cell(found["surrogate_mean"][at], convert))
                cells.append(table.cell(found["surrogate_std"][at], difference))
            else:
                cells += [number_text(float(found[key][at])) for key in ("rhat", "effective_draws")]
        table.rows.append((label_with_unit(name, unit), cells))
    return table


def _predictions_table(
    design: str, found: Mapping[str, xr.DataArray], runs: xr.Dataset
) -> OutputTable:
    """Return what a posterior predicts where nothing was measured."""
    table = OutputTable(f"{design}: predictions", ["prediction", "sd"])
    for of in predicted_rows(design, found, runs):
        stds = of.scale.difference_from_si(of.statistics["std"].values)
        for place, std in enumerate(np.asarray(stds).tolist()):
            cells = [table.cell(of.statistics["prediction"][{BLANK_ROW: place}], of.scale.from_si)]
            cells.append(number_text(std) if math.isfinite(std) else NOTHING)
            title = label_with_unit(f"{of.output}, row {of.label(place)}", of.unit)
            table.rows.append((title, cells))
    return table


# Ends of the middle 95 % of a posterior, by their titles.
_QUANTILES = {"2.5 %": 0.025, "97.5 %": 0.975}


def _unknowns_table(
    design: str, found: Mapping[str, xr.DataArray], runs: xr.Dataset
) -> OutputTable:
    columns = ["value", "profile", "standard error", "prior sd", "learnt"]
    table = OutputTable(f"{design}: unknowns", columns)
    names = found["unknown_value"][UNKNOWN].values.tolist()
    for place, name in enumerate(names):
        unit = shown_unit(runs[name].attrs)
        shown = scale(unit)
        errors = [float(found[key][place]) for key in ("standard_error", "prior_std")]
        estimates = [found[key][place] for key in ("unknown_value", "profile_value")]
        cells = [
            *(table.cell(each, shown.from_si) for each in estimates),
            *(number_text(float(shown.difference_from_si(each))) for each in errors),
            f"{max(1 - errors[0] / errors[1], 0.0):.1%}" if np.isfinite(errors[0]) else NOTHING,
        ]
        table.rows.append((label_with_unit(name, unit), cells))
    return table


def _combinations_table(design: str, found: Mapping[str, xr.DataArray]) -> OutputTable:
    table = OutputTable(f"{design}: what the data teach", ["known to", "learnt"])
    table.columns[0] += table.note_mark("in standard deviations of the priors")
    weights = found["combination_weight"]
    names = weights[UNKNOWN].values.tolist()
    for each, error in zip(weights.values, found["combination_error"].values.tolist(), strict=True):
        learnt = "yes" if error < 1 else "no: no more than the prior says"
        table.rows.append((combination_text(each, names), [number_text(error), learnt]))
    return table


def _fit_table(design: str, found: Mapping[str, xr.DataArray]) -> OutputTable:
    table = OutputTable(f"{design}: fit", ["value"])
    for name, array in found.items():
        title = str(array.attrs.get("long_name", name))
        if not array.dims:
            text = number_text(float(array)) if np.isfinite(array) else NOTHING
            table.rows.append((title, [text]))
        elif array.dims == (BOUND,):
            table.rows.append((title, [table.cell(array)]))
    return table
