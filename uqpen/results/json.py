"""An archive as JSON for scripts: SI units, every figure with its bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqpen.archive.read import SCHEMA_ATTRIBUTE, group_names, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    CONDITIONAL,
    DIFFERENCES,
    INPUT,
    LARGEST_CONTRIBUTION,
    MISSING,
    MODELS,
    RUN,
    RUNS,
    RUNS_SPENT,
    STATUS,
    SURROGATES,
)
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import status_counts
from uqpen.results.estimate_json import estimate_json
from uqpen.results.failed_runs import failed_runs
from uqpen.results.outside_rows import outside_json
from uqpen.results.sensitivity_json import sensitivity_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.surrogate_fits import fit_diagnostics, fit_settings, fitted_outputs
from uqpen.results.table import output_names

__all__ = ["archive_identity", "archive_json", "estimate_json"]

# The statistics of an output that have no dimension.
_SINGLE = tuple(each.name for each in CATALOGUE.values() if not each.dims)

# The statistics that have one, each with its key in JSON.
_FAMILIES = (
    ("quantiles", "quantile"),
    ("hold", "tolerance_limit"),
    ("exceedance", "exceedance"),
    ("shares", "share"),
)

# How many runs a tolerance limit of each content takes.
_RUNS_NEEDED = "content_runs_needed"
_ASSOCIATIONS, _ENDS = ("larger", "further_out"), ("lowest", "highest")


def archive_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return the results of an archive, in nested dicts of plain numbers and texts.

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
        other: _difference_json(SourceStatistics.of_differences(tree, other), models[other])
        for other in group_names(tree, DIFFERENCES)
    }
    return {
        **head,
        "models": {name: _model_json(model) for name, model in models.items()},
        "differences": differences,
    }


def archive_identity(tree: xr.DataTree) -> dict[str, Any]:
    """Return what identifies an archive, of whatever kind."""
    return {
        "title": tree.attrs["title"],
        "study_sha256": tree.attrs["study_sha256"],
        "seed": int(tree.attrs["seed"]),
        "schema": int(tree.attrs[SCHEMA_ATTRIBUTE]),
    }


def _model_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return the results of one model."""
    statistics = SourceStatistics(tree)
    return {
        "designs": {name: _design_json(statistics, name) for name in group_names(tree, RUNS)},
        "surrogates": {
            name: _surrogate_json(statistics, name) for name in group_names(tree, SURROGATES)
        },
        "published": {
            name: _publication_json(statistics, name) for name in statistics.publications
        },
    }


def _publication_json(statistics: SourceStatistics, name: str) -> dict[str, Any]:
    """The figures of a publication."""
    outputs = {}
    for output, array in _output_variables(_first_runs(statistics.tree)):
        outputs[output] = _output_json(statistics, name, array)
        if largest := statistics.largest_contribution(name, output):
            outputs[output][LARGEST_CONTRIBUTION] = largest
    return {"source": statistics.citation(name), "outputs": outputs}


def _difference_json(statistics: SourceStatistics, model: xr.DataTree) -> dict[str, Any]:
    """Return the differences of a model's outputs from the first model's, by design."""
    return {
        design: {
            "minus": statistics.minus(design),
            "outputs": {
                name: _output_json(statistics, design, array)
                for name, array in _output_variables(read_group(model, RUNS, design))
                if statistics.get(design, name, "mean") is not None
            },
        }
        for design in statistics.sources
    }


def _first_runs(tree: xr.DataTree) -> xr.Dataset:
    """The runs of a model's first design, which describe its outputs."""
    return read_group(tree, RUNS, group_names(tree, RUNS)[0])


def _output_variables(runs: xr.Dataset) -> list[tuple[str, xr.DataArray]]:
    return [(name, runs[name]) for name in output_names(runs)]


def _surrogate_json(statistics: SourceStatistics, name: str) -> dict[str, Any]:
    """A surrogate's figures, and what it was made of."""
    group = statistics.tree.children[SURROGATES].children[name]
    return {
        "runs": int(group.attrs[RUNS_SPENT]),
        "made_of": {key: _json_value(value) for key, value in fit_settings(group).items()},
        "outputs": {
            output: {
                **_output_json(statistics, name, array),
                "fit": {
                    key: _json_value(value) for key, value in fit_diagnostics(group, output).items()
                },
            }
            for output, array in _output_variables(_first_runs(statistics.tree))
            if output in fitted_outputs(group)
        },
    }


def _json_value(value: Any) -> Any:
    """An attribute as JSON knows it, which has no NaN and no infinity."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, list):
        return [_json_value(each) for each in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain


def _design_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    tree = statistics.tree
    runs, failures = read_group(tree, RUNS, design), statistics.failures(design)
    chances = failures.get("probability", xr.DataArray())
    ends = chances[STATUS].values.tolist() if STATUS in chances.coords else []
    return {
        "runs": int(runs.sizes[RUN]),
        "status": {status.meaning: count for status, count in status_counts(runs).items()},
        "reasons": [
            {"status": failed.status.meaning, "reason": failed.reason, "runs": failed.runs}
            for failed in failed_runs(tree, design)
        ],
        "lost": {name: estimate_json(chances[position]) for position, name in enumerate(ends)},
        "where_lost": _failure_json(failures),
        **{name: chances.attrs[name] for name in (CONDITIONAL, MISSING) if name in chances.attrs},
        "outputs": {
            name: _output_json(statistics, design, array) for name, array in _output_variables(runs)
        },
    }


def _failure_json(failures: Mapping[str, xr.DataArray]) -> dict[str, Any]:
    """Return, by input, how the failed runs lie relative to the completed runs."""
    arrays = {name: failures[name] for name in (*_ASSOCIATIONS, *_ENDS) if name in failures}
    first = next(iter(arrays.values()), None)
    names = [] if first is None else first[INPUT].values.tolist()
    return {
        str(name): {
            key: _json_value(array.values[position])
            if key in _ENDS
            else estimate_json(array[position])
            for key, array in arrays.items()
        }
        for position, name in enumerate(names)
    }


def _output_json(statistics: SourceStatistics, source: str, array: xr.DataArray) -> dict[str, Any]:
    """Return all figures that a source has of an output."""
    found: dict[str, Any] = {"units": array.attrs.get("units", DIMENSIONLESS)}
    arrays = statistics.statistics(source, str(array.name))
    found |= {name: estimate_json(arrays[name]) for name in _SINGLE if name in arrays}
    for key, name in _FAMILIES:
        if name in arrays:
            found[key] = _entries_json(arrays[name], CATALOGUE[name].dims[0])
    found |= sensitivity_json(arrays)
    if other := outside_json(arrays):
        found["other"] = other
    return found


def _entries_json(array: xr.DataArray, dimension: str) -> dict[str, Any]:
    """Return the entries of a statistic, by their labels."""
    labels = array[dimension].values
    entries = {str(label): estimate_json(array[i]) for i, label in enumerate(labels)}
    if _RUNS_NEEDED in array.coords:
        for label, needed in zip(labels, array[_RUNS_NEEDED].values, strict=True):
            entries[str(label)]["runs_needed"] = int(needed)
    return entries
