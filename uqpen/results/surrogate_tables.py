"""Surrogates of an archive: their fits, corrected estimates, and predictions of failed runs.

A surrogate is its group of an archive, a DataTree, or the name of that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.labels import (
    EQUIVALENT_RUNS,
    MISSING_BEYOND,
    MISSING_HIGHEST,
    MISSING_LOWEST,
    MISSING_PREDICTED,
    MISSING_SHARES,
    NOT_FITTED,
    RUNS_SPENT,
    SURROGATE_ESTIMATE,
    SURROGATES,
)
from uqpen.core.units import scale
from uqpen.results.digits import estimate_text, grouped_number, number_text
from uqpen.results.source_statistics import COMPARED, SourceStatistics, labelled_entries
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    first_runs,
    json_value,
    label_with_unit,
    shown_unit,
)
from uqpen.surrogates.diagnostics import (
    DIAGNOSTICS,
    FIELD,
    refuted_outputs,
    shown_diagnostics,
    shown_titles,
    unfitted_outputs,
)
from uqpen.surrogates.field_fit import FIT_TEXT

# The attribute of a surrogate's group with the names of the outputs that it was fitted to.
FITTED = "outputs"

_PLAIN_RUNS = "the number of runs with as narrow an interval, without the surrogate"
_NO_RESULTS = "these are predictions of the surrogate, not results"


def fitted_outputs(surrogate: xr.DataTree) -> list[str]:
    """Return the outputs that a surrogate was fitted to."""
    return str(surrogate.attrs[FITTED]).split()


def fit_settings(surrogate: xr.DataTree) -> dict[str, Any]:
    """Return the kind, design and runs of a surrogate, and ``<output>_not_fitted`` with reasons."""
    reasons = {f"{key}_{NOT_FITTED}": reason for key, reason in unfitted_outputs(surrogate).items()}
    last = {key: surrogate.attrs[key] for key in (RUNS_SPENT, "check")}
    first = {str(key): value for key, value in surrogate.attrs.items() if key not in last}
    return {**first, **reasons, **last}


def fit_diagnostics(surrogate: xr.DataTree, output: str) -> dict[str, Any]:
    """Return the diagnostics of the fit to an output by name, such as ``check_q2_of_output``.

    They are attributes, or variables of a group of their own.
    """
    fit = surrogate.children[output]
    # Others describe the output, or are parts of the fitted model.
    found = {str(k): each for k, each in fit.attrs.items() if not str(k).startswith(("of_", FIELD))}
    return {**found, **{name: array.values for name, array in _variables(fit).items()}}


def fit_json(surrogate: xr.DataTree, output: str) -> dict[str, Any]:
    """Return the diagnostics of a fit, and unit and title of each that is a variable."""
    diagnostics = fit_diagnostics(surrogate, output)
    titles = {
        name: {key: str(array.attrs.get(key, "")) for key in ("units", "long_name")}
        for name, array in _variables(surrogate.children[output]).items()
    }
    found: dict[str, Any] = {"fit": {key: json_value(each) for key, each in diagnostics.items()}}
    return found | ({"fit_titles": titles} if titles else {})


def _variables(fit: xr.DataTree) -> dict[str, xr.DataArray]:
    group = fit.children.get(DIAGNOSTICS)
    return {} if group is None else {str(name): each for name, each in group.data_vars.items()}


def fit_table(name: str, made: xr.DataTree) -> OutputTable:
    """Return the fit of a surrogate to each output, or the reason if there is none."""
    title = f"{name}: fit to {made.attrs['runs_used']} runs, check by {made.attrs['check']}"
    fits = {output: shown_diagnostics(made.children[output]) for output in fitted_outputs(made)}
    columns = shown_titles(made.children[output] for output in fits)
    table = OutputTable(title, columns)
    refuted = refuted_outputs(made)
    for output, diagnostics in fits.items():
        texts = {each.title: each.text for each in diagnostics}
        cells = [texts.get(column) or NOTHING for column in columns]
        text = str(made.children[output].attrs.get(FIT_TEXT, ""))
        cells[-1] += table.note_mark(text, refuted.get(output, ""))
        table.rows.append((output, cells))
    for output, reason in unfitted_outputs(made).items():
        cells = [f"not fitted{table.note_mark(reason)}", *[NOTHING] * (len(columns) - 1)]
        table.rows.append((output, cells))
    return table


def correction_tables(tree: xr.DataTree, surrogate: str) -> Iterator[OutputTable]:
    """Yield a table for each output of a model whose estimates by a surrogate are corrected."""
    statistics = SourceStatistics(tree)
    for output in statistics.scalar_outputs:
        unit = statistics.unit(output)
        table = OutputTable(f"{surrogate}: {label_with_unit(output, unit)}", [])
        table.columns = ["corrected", "surrogate", f"plain runs{table.note_mark(_PLAIN_RUNS)}"]
        for statistic in COMPARED:
            array = statistics.get(surrogate, output, statistic.name)
            if array is None or SURROGATE_ESTIMATE not in array.coords:
                continue
            convert = conversion(statistic, scale(unit))
            for label, entries in labelled_entries(statistic, {surrogate: array}):
                estimate = entries[surrogate]
                alone = float(estimate.coords[SURROGATE_ESTIMATE])
                text = NOTHING
                if math.isfinite(alone):
                    text = estimate_text(float(convert(alone)), math.nan, math.nan)
                if text != NOTHING or np.isfinite(estimate.values).any():
                    runs = equivalent_runs_text(estimate) or NOTHING
                    table.rows.append((label, [table.cell(estimate, convert), text, runs]))
        if table.rows:
            yield table


def is_corrected(estimate: xr.DataArray | None) -> bool:
    """Return True for a single estimate by a surrogate with an interval from real runs."""
    return (
        estimate is not None
        and EQUIVALENT_RUNS in estimate.coords
        and bool(np.isfinite(estimate.values).all())
    )


def equivalent_runs_text(estimate: xr.DataArray) -> str:
    """Return how many plain runs have an interval as narrow, to two digits; empty if unknown."""
    runs = float(estimate.coords.get(EQUIVALENT_RUNS, math.nan))
    return grouped_number(int(float(f"{runs:.2g}"))) if math.isfinite(runs) else ""


def missing_run_tables(tree: xr.DataTree, surrogate: str) -> Iterator[OutputTable]:
    """Yield the table of a surrogate's predictions at the inputs of failed runs, if any."""
    made, runs = tree.children[SURROGATES].children[surrogate], first_runs(tree)
    title = f"{surrogate}: predictions at the inputs of failed runs of {made.attrs['design']}"
    table = OutputTable(title, ["runs", "from", "to", "beyond"])
    for output in fitted_outputs(made):
        found = made.children[output].attrs
        if MISSING_PREDICTED not in found:
            continue
        unit = shown_unit(runs.variables[output].attrs)
        ends = scale(unit).from_si(np.array([found[MISSING_LOWEST], found[MISSING_HIGHEST]]))
        predicted = int(found[MISSING_PREDICTED])
        count = grouped_number(predicted)
        cells = [count + table.note_mark(_NO_RESULTS), *map(number_text, ends), NOTHING]
        table.rows.append((label_with_unit(output, unit), cells))
        shares = np.atleast_1d(found.get(MISSING_SHARES, [])).tolist()
        beyond = np.atleast_1d(found.get(MISSING_BEYOND, [])).tolist()
        for text, share in zip(beyond, shares, strict=True):
            label = f"{output} {text}"
            number = f"{grouped_number(round(share * predicted))} of {count}"
            table.rows.append((label, [NOTHING, NOTHING, NOTHING, number]))
    if table.rows:
        yield table
