"""An archive as JSON for scripts: SI units, every figure with its bounds."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.archive.read import SCHEMA_ATTRIBUTE, group_names, model_trees, read_group
from uqpen.core.labels import (
    CONDITIONAL,
    DIFFERENCES,
    EXCEEDANCE,
    INPUT,
    LARGEST_CONTRIBUTION,
    MISSING,
    MODELS,
    MOMENTS,
    QUANTILES,
    RUN,
    RUNS,
    RUNS_SPENT,
    SENSITIVITY,
    SHARES,
    STATISTICS,
    STATUSES,
    SURROGATES,
    TOLERANCE_LIMITS,
)
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import status_counts
from uqpen.results.estimate_json import estimate_json
from uqpen.results.failed_runs import failed_runs
from uqpen.results.sensitivity_json import sensitivity_json
from uqpen.results.table import output_names
from uqpen.statistics.failure_analysis import FAILURES

__all__ = ["archive_identity", "archive_json", "estimate_json"]

# Key in JSON, group, and the coordinate that its entries are called by.
_FAMILIES = (
    ("quantiles", QUANTILES, "probability"),
    ("hold", TOLERANCE_LIMITS, "hold"),
    ("exceedance", EXCEEDANCE, "threshold"),
    ("shares", SHARES, "category"),
)


def archive_json(tree: xr.DataTree) -> dict[str, Any]:
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
    head = archive_identity(tree)
    if MODELS not in tree.children:
        return {**head, **_model_json(tree)}
    models = model_trees(tree)
    differences = {
        other: _difference_json(tree.children[DIFFERENCES].children[other], models[other])
        for other in group_names(tree, DIFFERENCES)
    }
    return {
        **head,
        "models": {name: _model_json(model) for name, model in models.items()},
        "differences": differences,
    }


def archive_identity(tree: xr.DataTree) -> dict[str, Any]:
    """What tells an archive from others, of whatever kind."""
    return {
        "title": tree.attrs["title"],
        "study_sha256": tree.attrs["study_sha256"],
        "seed": int(tree.attrs["seed"]),
        "schema": int(tree.attrs[SCHEMA_ATTRIBUTE]),
    }


def _model_json(tree: xr.DataTree) -> dict[str, Any]:
    """What is told of one model."""
    return {
        "designs": {name: _design_json(tree, name) for name in group_names(tree, RUNS)},
        "surrogates": {name: _surrogate_json(tree, name) for name in group_names(tree, SURROGATES)},
        "published": {name: _publication_json(tree, name) for name in _publications(tree)},
    }


def _publications(tree: xr.DataTree) -> list[str]:
    """The sources that are neither designs nor surrogates."""
    ours = {*group_names(tree, RUNS), *group_names(tree, SURROGATES)}
    publications = dict.fromkeys(
        name for kind in (MOMENTS, SENSITIVITY) for name in group_names(tree, kind)
    )
    return [name for name in publications if name not in ours]


def _publication_json(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """The figures of a publication."""
    runs = read_group(tree, RUNS, group_names(tree, RUNS)[0])
    attributes = read_group(tree, MOMENTS, name).attrs | read_group(tree, SENSITIVITY, name).attrs
    return {
        "source": str(attributes.get("source", "")),
        "outputs": {
            output: _output_json(tree, name, array)
            | {
                key: str(attributes[f"{output}_{key}"])
                for key in (LARGEST_CONTRIBUTION,)
                if f"{output}_{key}" in attributes
            }
            for output, array in _output_variables(runs)
        },
    }


def _difference_json(tree: xr.DataTree, model: xr.DataTree) -> dict[str, Any]:
    """What a model's outputs differ by from the first's, by design."""
    return {
        design: {
            "minus": read_group(tree, MOMENTS, design).attrs["minus"],
            "outputs": {
                name: _output_json(tree, design, array)
                for name, array in _output_variables(read_group(model, RUNS, design))
                if f"{name}_mean" in read_group(tree, MOMENTS, design)
            },
        }
        for design in group_names(tree, MOMENTS)
    }


def _output_variables(runs: xr.Dataset) -> list[tuple[str, xr.DataArray]]:
    return [(name, runs[name]) for name in output_names(runs)]


def _surrogate_json(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """A surrogate's figures, and what it was made of."""
    dataset = read_group(tree, SURROGATES, name)
    runs = read_group(tree, RUNS, group_names(tree, RUNS)[0])
    return {
        "runs": int(dataset.attrs[RUNS_SPENT]),
        "made_of": {key: _json_value(value) for key, value in dataset.attrs.items()},
        "outputs": {
            output: {
                **_output_json(tree, name, array),
                "fit": _fit_json(dataset[f"{output}_coefficient"]),
            }
            for output, array in _output_variables(runs)
            if output in dataset.attrs["outputs"].split()
        },
    }


def _fit_json(coefficients: xr.DataArray) -> dict[str, Any]:
    """How a surrogate's expansion of an output was found, and how well it fits."""
    return {
        key: _json_value(value)
        for key, value in coefficients.attrs.items()
        if not key.startswith(("of_", "units", "long_name"))
    }


def _json_value(value: Any) -> Any:
    """An attribute as JSON knows it, which has no NaN and no infinity."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, list):
        return [_json_value(each) for each in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain


def _design_json(tree: xr.DataTree, design: str) -> dict[str, Any]:
    runs, statuses = read_group(tree, RUNS, design), read_group(tree, STATUSES, design)
    return {
        "runs": int(runs.sizes[RUN]),
        "status": {status.meaning: count for status, count in status_counts(runs).items()},
        "reasons": [
            {"status": failed.status.meaning, "reason": failed.reason, "runs": failed.runs}
            for failed in failed_runs(tree, design)
        ],
        "lost": {str(name): estimate_json(array) for name, array in statuses.data_vars.items()},
        "where_lost": _failure_json(read_group(tree, FAILURES, design)),
        **{name: statuses.attrs[name] for name in (CONDITIONAL, MISSING) if name in statuses.attrs},
        "outputs": {
            name: _output_json(tree, design, array) for name, array in _output_variables(runs)
        },
    }


def _failure_json(told: xr.Dataset) -> dict[str, Any]:
    """By input, how the lost runs lie to those that came back."""
    names = told[INPUT].values.tolist() if INPUT in told else []
    return {
        str(name): {
            **{each: estimate_json(told[each][position]) for each in ("larger", "further_out")},
            **{each: _json_value(told[each].values[position]) for each in ("lowest", "highest")},
        }
        for position, name in enumerate(names)
    }


def _output_json(tree: xr.DataTree, source: str, array: xr.DataArray) -> dict[str, Any]:
    """All figures that a source tells of an output."""
    name = str(array.name)
    found: dict[str, Any] = {"units": array.attrs.get("units", DIMENSIONLESS)}
    moments = read_group(tree, MOMENTS, source)
    for statistic in STATISTICS:
        if f"{name}_{statistic}" in moments:
            found[statistic] = estimate_json(moments[f"{name}_{statistic}"])
    for key, kind, coordinate in _FAMILIES:
        answers = read_group(tree, kind, source)
        if name in answers:
            labels = answers[f"{name}_{coordinate}"].values
            entries = answers[name]
            found[key] = {str(label): estimate_json(entries[i]) for i, label in enumerate(labels)}
            if key == "hold":
                needed = answers[f"{name}_hold_runs_needed"].values
                for label, runs_needed in zip(labels, needed, strict=True):
                    found[key][str(label)]["runs_needed"] = int(runs_needed)
    return found | sensitivity_json(read_group(tree, SENSITIVITY, source), name)
