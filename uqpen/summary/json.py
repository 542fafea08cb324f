"""An archive as JSON for scripts: SI units, every figure with its bounds."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.archive.read import SCHEMA_ATTRIBUTE, group, models_in, names_in
from uqpen.archive.told import told
from uqpen.evaluation import status_counts
from uqpen.labels import (
    BOUND,
    CONDITIONAL,
    DIFFERENCES,
    EXCEEDANCE,
    HOLDS,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    MISSING,
    MODELS,
    MOMENTS,
    NOTE,
    QUANTILES,
    RUN,
    RUNS,
    RUNS_SPENT,
    SENSITIVITY,
    SHARES,
    STATISTICS,
    STATUSES,
    SUFFIXES,
    SURROGATES,
)
from uqpen.summary.losses import losses
from uqpen.summary.table import output_names
from uqpen.units import DIMENSIONLESS

__all__ = ["as_json", "figure", "identity"]

# Key in JSON, group, and the coordinate that its entries are called by.
_FAMILIES = (
    ("quantiles", QUANTILES, "probability"),
    ("hold", HOLDS, "hold"),
    ("exceedance", EXCEEDANCE, "threshold"),
    ("shares", SHARES, "category"),
)


def as_json(tree: xr.DataTree) -> dict[str, Any]:
    """What an archive says, in nested dicts of plain numbers and texts.

    Parameters
    ----------
    tree : DataTree
        An archive.

    Returns
    -------
    dict
        ``designs.<name>`` with ``runs``, ``status.<meaning>`` and ``outputs.<output>``, and
        ``surrogates.<name>`` likewise; each figure ``{estimate, lower, upper}`` in SI units, None
        where there is none, with how its interval was made. Of several models, all that under
        ``models.<name>``, and what they differ by under ``differences.<name>``.
    """
    head = identity(tree)
    if MODELS not in tree.children:
        return {**head, **_model(tree)}
    models = models_in(tree)
    differences = {
        other: _differences(tree.children[DIFFERENCES].children[other], models[other])
        for other in names_in(tree, DIFFERENCES)
    }
    return {
        **head,
        "models": {name: _model(model) for name, model in models.items()},
        "differences": differences,
    }


def identity(tree: xr.DataTree) -> dict[str, Any]:
    """What tells an archive from others, of whatever kind."""
    return {
        "title": tree.attrs["title"],
        "study_sha256": tree.attrs["study_sha256"],
        "seed": int(tree.attrs["seed"]),
        "schema": int(tree.attrs[SCHEMA_ATTRIBUTE]),
    }


def _model(tree: xr.DataTree) -> dict[str, Any]:
    """What is told of one model."""
    return {
        "designs": {name: _design(tree, name) for name in names_in(tree, RUNS)},
        "surrogates": {name: _surrogate(tree, name) for name in names_in(tree, SURROGATES)},
    }


def _differences(tree: xr.DataTree, model: xr.DataTree) -> dict[str, Any]:
    """What a model's outputs differ by from the first's, by design."""
    return {
        design: {
            "minus": group(tree, MOMENTS, design).attrs["minus"],
            "outputs": {
                name: _output(tree, design, array)
                for name, array in _outputs(group(model, RUNS, design))
                if f"{name}_mean" in group(tree, MOMENTS, design)
            },
        }
        for design in names_in(tree, MOMENTS)
    }


def _outputs(runs: xr.Dataset) -> list[tuple[str, xr.DataArray]]:
    return [(name, runs[name]) for name in output_names(runs)]


def _surrogate(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """A surrogate's figures, and what it was made of."""
    made = group(tree, SURROGATES, name)
    runs = group(tree, RUNS, names_in(tree, RUNS)[0])
    return {
        "runs": int(made.attrs[RUNS_SPENT]),
        "made_of": {key: _plain(value) for key, value in made.attrs.items()},
        "outputs": {
            output: {**_output(tree, name, array), "fit": _fit(made[f"{output}_coefficient"])}
            for output, array in _outputs(runs)
            if output in made.attrs["outputs"].split()
        },
    }


def _fit(coefficients: xr.DataArray) -> dict[str, Any]:
    """How a surrogate's expansion of an output was found, and how well it fits."""
    attributes = {key: _plain(value) for key, value in coefficients.attrs.items()}
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in attributes.items()
        if not key.startswith(("of_", "units", "long_name"))
    }


def _plain(value: Any) -> Any:
    """An attribute as JSON knows it."""
    return value.item() if hasattr(value, "item") else value


def _design(tree: xr.DataTree, design: str) -> dict[str, Any]:
    runs, statuses = group(tree, RUNS, design), group(tree, STATUSES, design)
    return {
        "runs": int(runs.sizes[RUN]),
        "status": {status.meaning: count for status, count in status_counts(runs).items()},
        "reasons": [
            {"status": loss.status.meaning, "reason": loss.reason, "runs": loss.runs}
            for loss in losses(tree, design)
        ],
        "lost": {str(name): figure(array) for name, array in statuses.data_vars.items()},
        **{name: statuses.attrs[name] for name in (CONDITIONAL, MISSING) if name in statuses.attrs},
        "outputs": {name: _output(tree, design, array) for name, array in _outputs(runs)},
    }


def _output(tree: xr.DataTree, source: str, array: xr.DataArray) -> dict[str, Any]:
    """All figures that a source tells of an output."""
    name = str(array.name)
    found: dict[str, Any] = {"units": array.attrs.get("units", DIMENSIONLESS)}
    moments = group(tree, MOMENTS, source)
    for statistic in STATISTICS:
        if f"{name}_{statistic}" in moments:
            found[statistic] = figure(moments[f"{name}_{statistic}"])
    for key, kind, coordinate in _FAMILIES:
        answers = group(tree, kind, source)
        if name in answers:
            labels = answers[f"{name}_{coordinate}"].values
            entries = answers[name]
            found[key] = {str(label): figure(entries[i]) for i, label in enumerate(labels)}
            if key == "hold":
                needed = answers[f"{name}_hold_runs_needed"].values
                for label, runs_needed in zip(labels, needed, strict=True):
                    found[key][str(label)]["runs_needed"] = int(runs_needed)
    answers = group(tree, SENSITIVITY, source)
    if sensitivity := _sensitivity(answers, name):
        found["sensitivity"] = sensitivity
    if of_exceedance := _sensitivity_of_exceedance(answers, name):
        found["sensitivity_of_exceedance"] = of_exceedance
    return found


def _sensitivity(answers: xr.Dataset, output: str) -> dict[str, dict[str, Any]]:
    """Each input's part in an output, by input and measure."""
    found: dict[str, dict[str, Any]] = {}
    for variable, array in answers.data_vars.items():
        measure = str(variable).removeprefix(f"{output}_")
        if measure == variable or measure not in SUFFIXES or array.dims != (INPUT, BOUND):
            continue
        for position, name in enumerate(array[INPUT].values):
            found.setdefault(str(name), {})[measure] = figure(array[position])
    return found


def _sensitivity_of_exceedance(answers: xr.Dataset, output: str) -> dict[str, dict[str, Any]]:
    """Each input's part in an output's exceeding a value, by threshold, input and measure."""
    found: dict[str, dict[str, Any]] = {}
    stem, thresholds = f"{output}_exceedance_", f"{output}_threshold"
    for variable, array in answers.data_vars.items():
        if not str(variable).startswith(stem) or array.dims != (thresholds, INPUT, BOUND):
            continue
        measure = str(variable).removeprefix(stem)
        for row, threshold in enumerate(array[thresholds].values):
            of_threshold = found.setdefault(str(threshold), {})
            for column, name in enumerate(array[INPUT].values):
                of_threshold.setdefault(str(name), {})[measure] = figure(array[row, column])
    return found


def figure(array: xr.DataArray) -> dict[str, Any]:
    """An estimate, its bounds, and how they were made."""
    bounds = zip(array[BOUND].values.tolist(), array.values.tolist(), strict=True)
    figure: dict[str, Any] = {str(k): v if math.isfinite(v) else None for k, v in bounds}
    figure |= {what: told(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := told(array, NOTE):
        figure[NOTE] = note
    return figure
