"""An archive as JSON for scripts: SI units, every figure with its bounds."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.analyses.where_lost import LOSSES
from uqpen.archive.read import SCHEMA_ATTRIBUTE, group, models_in, names_in
from uqpen.evaluation import status_counts
from uqpen.labels import (
    CONDITIONAL,
    DIFFERENCES,
    EXCEEDANCE,
    HOLDS,
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
)
from uqpen.summary.figure import figure
from uqpen.summary.losses import losses
from uqpen.summary.sensitivity_json import sensitivity
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
        "published": {name: _published(tree, name) for name in _publications(tree)},
    }


def _publications(tree: xr.DataTree) -> list[str]:
    """The sources that are neither designs nor surrogates."""
    ours = {*names_in(tree, RUNS), *names_in(tree, SURROGATES)}
    told_by = dict.fromkeys(
        name for kind in (MOMENTS, SENSITIVITY) for name in names_in(tree, kind)
    )
    return [name for name in told_by if name not in ours]


def _published(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """The figures of a publication."""
    runs = group(tree, RUNS, names_in(tree, RUNS)[0])
    attributes = group(tree, MOMENTS, name).attrs | group(tree, SENSITIVITY, name).attrs
    return {
        "source": str(attributes.get("source", "")),
        "outputs": {
            output: _output(tree, name, array)
            | {
                key: str(attributes[f"{output}_{key}"])
                for key in (LARGEST_CONTRIBUTION,)
                if f"{output}_{key}" in attributes
            }
            for output, array in _outputs(runs)
        },
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
    return {
        key: _plain(value)
        for key, value in coefficients.attrs.items()
        if not key.startswith(("of_", "units", "long_name"))
    }


def _plain(value: Any) -> Any:
    """An attribute as JSON knows it, which has no NaN and no infinity."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, list):
        return [_plain(each) for each in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain


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
        "where_lost": _where_lost(group(tree, LOSSES, design)),
        **{name: statuses.attrs[name] for name in (CONDITIONAL, MISSING) if name in statuses.attrs},
        "outputs": {name: _output(tree, design, array) for name, array in _outputs(runs)},
    }


def _where_lost(told: xr.Dataset) -> dict[str, Any]:
    """By input, how the lost runs lie to those that came back."""
    names = told[INPUT].values.tolist() if INPUT in told else []
    return {
        str(name): {
            **{each: figure(told[each][position]) for each in ("larger", "further_out")},
            **{each: _plain(told[each].values[position]) for each in ("lowest", "highest")},
        }
        for position, name in enumerate(names)
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
    return found | sensitivity(group(tree, SENSITIVITY, source), name)
