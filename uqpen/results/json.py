"""An archive as JSON for scripts: SI units, every estimate with its bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.archive.read import SCHEMA_ATTRIBUTE, group_names, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE, MODEL_FORM_STATISTICS, REQUESTED
from uqpen.core.labels import (
    AGREEMENT,
    CAVEAT,
    CODED_INPUTS,
    CONFIDENCE_LEVEL,
    COST_SPENT,
    DIFFERENCES,
    DISTANT_VALUES,
    DROPPED_ROWS,
    LARGEST_CONTRIBUTION,
    LOGARITHMIC,
    MODEL_FORM,
    MODELS,
    NOISE,
    REWEIGHTED,
    RUNS,
    RUNS_SPENT,
    STOPPING_AT_MOST,
    STOPPING_NOTE,
    STOPPING_RULE,
    SURROGATES,
)
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import run_count, status_counts
from uqpen.results.acceptance import acceptance_json
from uqpen.results.design_groups import design_json
from uqpen.results.error_statement import error_json
from uqpen.results.failed_runs import FailedRuns, failed_runs
from uqpen.results.input_measures import sensitivity_json
from uqpen.results.noise import noise_text
from uqpen.results.source_statistics import SourceStatistics, user_defined
from uqpen.results.surrogate_tables import fit_json, fit_settings, fitted_outputs
from uqpen.results.table import (
    cut_coordinates,
    entries_json,
    estimate_json,
    json_value,
    output_names,
)

# The statistics of an output that have no dimension.
_SINGLE = tuple(each.name for each in CATALOGUE.values() if not each.dims)

# Attributes of the runs of a design that stopped at a precision, or has given points.
_OF_POINTS = (
    STOPPING_RULE,
    STOPPING_AT_MOST,
    STOPPING_NOTE,
    REWEIGHTED,
    AGREEMENT,
    CODED_INPUTS,
    DROPPED_ROWS,
    DISTANT_VALUES,
)

# Those with entries, by their keys.
_FAMILIES = {each.shown.json: each.name for each in CATALOGUE.values() if each.shown.json}

# Ending of the coordinate with the number of runs that a tolerance limit of each content needs.
_RUNS_NEEDED = "_runs_needed"


def archive_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return the results of an archive, in nested dicts of plain numbers and texts.

    They are ``designs.<name>`` with ``runs``, ``status.<meaning>`` and ``outputs.<output>``, and
    ``surrogates.<name>`` likewise; each figure ``{estimate, lower, upper}`` in SI units, None where
    there is none, with how its interval was made. A field has ``dimensions``, and lists along them
    in place of the numbers of its figures. Of several models, all that under ``models.<name>``,
    their differences under ``differences.<name>``, and the shares of model form under
    ``model_form.<design>.<output>``. The parts of the error of an answer, where two are known,
    are under ``errors.<answer>``. The ``confidence_level`` of all intervals, where it is
    not 0.95.
    """
    head = archive_identity(tree)
    if CONFIDENCE_LEVEL in tree.attrs:
        head[CONFIDENCE_LEVEL] = float(tree.attrs[CONFIDENCE_LEVEL])
    errors = {"errors": parts} if (parts := error_json(tree)) else {}
    if MODELS not in tree.children:
        return {**head, **_model_json(tree), **errors}
    models = model_trees(tree)
    differences = {
        other: _difference_json(SourceStatistics.of_differences(tree, other), models[other])
        for other in group_names(tree, DIFFERENCES)
    }
    statistics = SourceStatistics.of_model_form(tree)
    found: dict[str, Any] = {}
    for design in statistics.sources:
        for output in statistics.outputs:
            arrays = statistics.statistics(design, output)
            shares = {
                name: entries_json(arrays[name]) for name in MODEL_FORM_STATISTICS if name in arrays
            }
            if shares:
                found.setdefault(design, {})[output] = shares
    return {
        **head,
        "models": {name: _model_json(model) for name, model in models.items()},
        "differences": differences,
        **({MODEL_FORM: found} if found else {}),
        **errors,
    }


def archive_identity(tree: xr.DataTree) -> dict[str, Any]:
    """Return the identity of an archive of any kind."""
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
        **({NOISE: noise} if (noise := noise_text(tree)) else {}),
        "designs": {name: _design_json(statistics, name) for name in group_names(tree, RUNS)},
        "surrogates": {
            name: _surrogate_json(statistics, name) for name in group_names(tree, SURROGATES)
        },
        "published": {
            name: _publication_json(statistics, name) for name in statistics.publications
        },
    }


def _outputs_json(statistics: SourceStatistics, source: str, runs: xr.Dataset) -> dict[str, Any]:
    """Return all estimates of a source, by the outputs that a runs dataset describes."""
    return {
        name: _output_json(statistics, source, runs[name])
        | _attributes_json(statistics.absence(source, name))
        for name in output_names(runs)
    }


def _publication_json(statistics: SourceStatistics, name: str) -> dict[str, Any]:
    outputs = _outputs_json(statistics, name, statistics.runs)
    for output, estimates in outputs.items():
        if largest := statistics.largest_contribution(name, output):
            estimates[LARGEST_CONTRIBUTION] = largest
    return {"source": statistics.citation(name), "outputs": outputs}


def _difference_json(statistics: SourceStatistics, model: xr.DataTree) -> dict[str, Any]:
    """Return the differences of a model's outputs from the first model's, by design."""
    found = {}
    for design in statistics.sources:
        outputs = _outputs_json(statistics, design, read_group(model, RUNS, design))
        known = {
            name: estimates
            for name, estimates in outputs.items()
            if not estimates.keys().isdisjoint(_SINGLE)
        }
        found[design] = {"minus": statistics.minus(design), "outputs": known}
    return found


def _surrogate_json(statistics: SourceStatistics, name: str) -> dict[str, Any]:
    """Return the estimates of a surrogate, its settings and its fits."""
    group = statistics.tree.children[SURROGATES].children[name]
    fitted = fitted_outputs(group)
    outputs = _outputs_json(statistics, name, statistics.runs)
    return {
        "runs": int(group.attrs[RUNS_SPENT]),
        "made_of": _attributes_json(fit_settings(group)),
        "outputs": {
            output: {**estimates, **fit_json(group, output)}
            for output, estimates in outputs.items()
            if output in fitted
        },
    }


def _attributes_json(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    return {str(key): json_value(value) for key, value in attributes.items()}


def _design_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    runs = read_group(statistics.tree, RUNS, design)
    cost, decision = statistics.cost_spent(design), statistics.decision(design)
    return {
        "runs": run_count(runs),
        **({} if cost is None else {COST_SPENT: cost}),
        "status": {status.meaning: count for status, count in status_counts(runs).items()},
        "reasons": [_reason_json(each) for each in failed_runs(statistics.tree, design)],
        **design_json(statistics, design),
        **statistics.run_accounts(design),
        **{key: json_value(runs.attrs[key]) for key in _OF_POINTS if key in runs.attrs},
        **({} if decision is None else {"decision": _attributes_json(decision.to_json())}),
        "outputs": _outputs_json(statistics, design, runs),
    }


def _reason_json(failed: FailedRuns) -> dict[str, Any]:
    """Return one reason of failed runs; an example where its numbers are masked."""
    found = {"status": failed.status.meaning, "reason": failed.reason, "runs": failed.runs}
    return found | ({"example": failed.example} if failed.example else {})


def _output_json(statistics: SourceStatistics, source: str, array: xr.DataArray) -> dict[str, Any]:
    """Return all estimates that a source has of an output."""
    output, along = str(array.name), field_dimensions(array)
    found: dict[str, Any] = {"units": array.attrs.get("units", DIMENSIONLESS)}
    found |= _places_json(array)
    if caveat := statistics.caveat(source, output):
        found[CAVEAT] = caveat
    if statistics.wants_logarithm(output):
        found["scale"] = LOGARITHMIC
    arrays = statistics.statistics(source, output)
    found |= {name: estimate_json(arrays[name]) for name in _SINGLE if name in arrays}
    for key, name in _FAMILIES.items():
        if name in arrays:
            found[key] = _family_json(arrays[name], is_field=bool(along))
    reason = statistics.reason_without(source)
    if lacking := {
        each.shown.json: reason
        for each in REQUESTED
        if reason and each.name not in arrays and statistics.by_source(output, each.name)
    }:
        found["not_estimated"] = lacking
    found |= sensitivity_json(arrays, field=along)
    if other := user_defined(arrays):
        found["other"] = {name: entries_json(each, _described_json) for name, each in other.items()}
    return found


def _places_json(variable: xr.DataArray) -> dict[str, Any]:
    """Return ``dimensions`` and the place ``at`` which an output was cut; nothing without any.

    Coordinates are in SI units.
    """
    dimensions = {
        name: {
            "size": int(variable.sizes[name]),
            "units": str(variable[name].attrs.get("units", DIMENSIONLESS)),
            "coordinates": variable[name].values.tolist(),
        }
        for name in field_dimensions(variable)
    }
    places = {str(each.name): each.item() for each in cut_coordinates(variable)}
    found = {"dimensions": dimensions, "at": places}
    return {key: content for key, content in found.items() if content}


def _family_json(array: xr.DataArray, *, is_field: bool) -> dict[str, Any]:
    """Return the entries of a statistic, by their labels; those of a field have no verdict."""
    entries = entries_json(array)
    for entry, each in zip(entries.values(), array, strict=True) if not is_field else ():
        entry |= acceptance_json(each)
    for name in (each for each in array.coords if str(each).endswith(_RUNS_NEEDED)):
        for entry, needed in zip(entries.values(), array[name].values, strict=True):
            entry["runs_needed"] = int(needed)
    return entries


def _described_json(array: xr.DataArray) -> dict[str, Any]:
    """Return an estimate that the catalogue does not know, with its unit and its title."""
    described = {key: str(array.attrs.get(key, "")) for key in ("units", "long_name")}
    return {**estimate_json(array), **described}
