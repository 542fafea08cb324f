"""An archive as JSON for scripts: SI units, every estimate with its bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.archive.read import SCHEMA_ATTRIBUTE, group_names, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE, REQUESTED
from uqpen.core.labels import (
    AGREEMENT,
    CAVEAT,
    CONFIDENCE_LEVEL,
    COST_SPENT,
    DIFFERENCES,
    INPUT,
    JOINT_GROUP,
    LARGEST_CONTRIBUTION,
    LOGARITHMIC,
    MODELS,
    RUNS,
    RUNS_SPENT,
    STOPPING_AT_MOST,
    STOPPING_NOTE,
    STOPPING_RULE,
    SURROGATES,
)
from uqpen.core.statistic_dimensions import DESIGN_POINT, SENSITIVITY_EVENT
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import run_count, status_counts
from uqpen.results.acceptance import Acceptance
from uqpen.results.design_groups import design_json
from uqpen.results.disagreements import disagreements
from uqpen.results.estimate_json import entries_json, estimate_json, json_value
from uqpen.results.failed_runs import FailedRuns, failed_runs
from uqpen.results.failure_tables import ASSOCIATIONS, ENDS
from uqpen.results.field_json import field_json
from uqpen.results.model_form_tables import model_form_json
from uqpen.results.sensitivity_json import sensitivity_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.surrogate_fits import (
    diagnostic_titles,
    fit_diagnostics,
    fit_settings,
    fitted_outputs,
)
from uqpen.results.table import first_runs, output_names
from uqpen.results.user_defined_rows import user_defined_json

__all__ = ["archive_identity", "archive_json", "estimate_json", "failure_json", "joint_json"]

# The statistics of an output that have no dimension.
_SINGLE = tuple(each.name for each in CATALOGUE.values() if not each.dims)

# Attributes of the runs of a design that stopped at a precision, or has given points.
_OF_POINTS = (STOPPING_RULE, STOPPING_AT_MOST, STOPPING_NOTE, AGREEMENT)

# Those with entries, by their keys.
_FAMILIES = {each.shown.json: each.name for each in CATALOGUE.values() if each.shown.json}

# Ending of the coordinate with the number of runs that a tolerance limit of each content needs.
_RUNS_NEEDED = "_runs_needed"


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
        where there is none, with how its interval was made. A field has ``dimensions``, and lists
        along them in place of the numbers of its figures. Of several models, all that under
        ``models.<name>``, their differences under ``differences.<name>``, and the shares of model
        form under ``model_form.<design>.<output>``. The ``confidence_level`` of all intervals,
        where it is not 0.95.
    """
    head = archive_identity(tree)
    if CONFIDENCE_LEVEL in tree.attrs:
        head[CONFIDENCE_LEVEL] = float(tree.attrs[CONFIDENCE_LEVEL])
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
        **model_form_json(tree),
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
    outputs = _outputs_json(statistics, name, first_runs(statistics.tree))
    for output, estimates in outputs.items():
        if largest := statistics.largest_contribution(name, output):
            estimates[LARGEST_CONTRIBUTION] = largest
    return {"source": statistics.citation(name), "outputs": outputs}


def _difference_json(statistics: SourceStatistics, model: xr.DataTree) -> dict[str, Any]:
    """Return the differences of a model's outputs from the first model's, by design."""
    found = {}
    for design in statistics.sources:
        outputs = _outputs_json(statistics, design, read_group(model, RUNS, design))
        known = {name: estimates for name, estimates in outputs.items() if "mean" in estimates}
        found[design] = {"minus": statistics.minus(design), "outputs": known}
    return found


def _surrogate_json(statistics: SourceStatistics, name: str) -> dict[str, Any]:
    """Return the estimates of a surrogate, its settings and its fits."""
    group = statistics.tree.children[SURROGATES].children[name]
    fitted = fitted_outputs(group)
    outputs = _outputs_json(statistics, name, first_runs(statistics.tree))
    return {
        "runs": int(group.attrs[RUNS_SPENT]),
        "made_of": _attributes_json(fit_settings(group)),
        "outputs": {
            output: {**estimates, **_fit_json(group, output)}
            for output, estimates in outputs.items()
            if output in fitted
        },
    }


def _fit_json(group: xr.DataTree, output: str) -> dict[str, Any]:
    """Return the diagnostics of a fit, and titles and units of those that have them."""
    found: dict[str, Any] = {"fit": _attributes_json(fit_diagnostics(group, output))}
    if titles := diagnostic_titles(group, output):
        found["fit_titles"] = titles
    return found


def _attributes_json(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    return {str(key): json_value(value) for key, value in attributes.items()}


def _design_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    tree = statistics.tree
    runs = read_group(tree, RUNS, design)
    cost = statistics.cost_spent(design)
    return {
        "runs": run_count(runs),
        **({} if cost is None else {COST_SPENT: cost}),
        "status": {status.meaning: count for status, count in status_counts(runs).items()},
        "reasons": [_reason_json(failed) for failed in failed_runs(tree, design)],
        **design_json(statistics, design),
        **statistics.run_accounts(design),
        **{key: json_value(runs.attrs[key]) for key in _OF_POINTS if key in runs.attrs},
        **_decision_json(statistics, design),
        "outputs": _outputs_json(statistics, design, runs),
    }


def _decision_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return the decision on the claim of a design, if it has one."""
    decision = statistics.decision(design)
    if decision is None:
        return {}
    return {"decision": {key: json_value(value) for key, value in decision.to_json().items()}}


def _reason_json(failed: FailedRuns) -> dict[str, Any]:
    """Return one reason of failed runs; an example where its numbers are masked."""
    found = {"status": failed.status.meaning, "reason": failed.reason, "runs": failed.runs}
    return found | ({"example": failed.example} if failed.example else {})


def joint_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return the probabilities of events of several outputs, where a study asks for them."""
    joint = statistics.joint_probability(design)
    if joint is None:
        return {}
    names = group_names(statistics.tree, JOINT_GROUP)
    found = {name: statistics.joint_probability(name) for name in names}
    arrays = {name: array for name, array in found.items() if array is not None}
    entries = _family_json(joint)
    for entry, condition in zip(entries.values(), joint["event_condition"].values, strict=True):
        entry["condition"] = str(condition)
        pairs = (
            (each.first, each.second)
            for each in disagreements(arrays)
            if each.condition == condition and design in (each.first, each.second)
        )
        if others := sorted(name for pair in pairs for name in pair if name != design):
            entry["disagrees_with"] = others
    of_design = statistics.joint_statistics(design)
    for name, array in of_design.items():
        for of_event in array if SENSITIVITY_EVENT in array.dims else ():
            entry = entries[str(of_event[SENSITIVITY_EVENT].item())]
            entry.setdefault("sensitivities", {})[name] = entries_json(of_event)
    if points := _design_points_json(of_design):
        next(iter(entries.values()))["design_points"] = points
    return {JOINT_GROUP: entries}


def _design_points_json(statistics: Mapping[str, xr.DataArray]) -> list[dict[str, Any]]:
    """Return the design points of an event, the nearest first; empty where none is known."""
    indices = statistics.get("reliability_index")
    if indices is None:
        return []
    points: list[dict[str, Any]] = [
        {"run": int(run)} for run in indices[f"{DESIGN_POINT}_run"].values
    ]
    for name, array in statistics.items():
        for point, entry in zip(points, array, strict=True) if DESIGN_POINT in array.dims else ():
            of_inputs = INPUT in entry.dims
            point[name] = entries_json(entry) if of_inputs else estimate_json(entry)
    return points


def failure_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return the shares of failed runs, and how they lie relative to the others by input."""
    failures, found = statistics.failures(design), dict[str, Any]()
    for key in (*ASSOCIATIONS, *ENDS):
        for entry in failures.get(key, ()):
            value = json_value(entry.values) if key in ENDS else estimate_json(entry)
            found.setdefault(str(entry[INPUT].item()), {})[key] = value
    chances = statistics.status_probabilities(design)
    lost = {status: estimate_json(chance) for status, chance in chances.items()}
    return {"lost": lost, "where_lost": found}


def _output_json(statistics: SourceStatistics, source: str, array: xr.DataArray) -> dict[str, Any]:
    """Return all estimates that a source has of an output."""
    found: dict[str, Any] = {"units": array.attrs.get("units", DIMENSIONLESS)}
    found |= field_json(array)
    if caveat := statistics.caveat(source, str(array.name)):
        found[CAVEAT] = caveat
    if statistics.wants_logarithm(str(array.name)):
        found["scale"] = LOGARITHMIC
    along = field_dimensions(array)
    arrays = statistics.statistics(source, str(array.name))
    found |= {name: estimate_json(arrays[name]) for name in _SINGLE if name in arrays}
    for key, name in _FAMILIES.items():
        if name in arrays:
            found[key] = _family_json(arrays[name], along)
    missing = (each for each in REQUESTED if each.name not in arrays)
    reason = statistics.reason_without(source)
    if lacking := {
        each.shown.json: reason
        for each in missing
        if reason and statistics.by_source(str(array.name), each.name)
    }:
        found["not_estimated"] = lacking
    found |= sensitivity_json(arrays, field=along)
    if other := user_defined_json(arrays, field=along):
        found["other"] = other
    return found


def _family_json(array: xr.DataArray, field: Sequence[str] = ()) -> dict[str, Any]:
    """Return the entries of a statistic, by their labels; those of a field have no verdict."""
    entries = entries_json(array, field=field)
    for entry, each in zip(entries.values(), array, strict=True) if not field else ():
        if acceptance := Acceptance.from_array(each):
            entry |= {
                "at_least": acceptance.at_least,
                "at_most": acceptance.at_most,
                "verdict": str(acceptance.verdict),
            }
    for name in (each for each in array.coords if str(each).endswith(_RUNS_NEEDED)):
        for entry, needed in zip(entries.values(), array[name].values, strict=True):
            entry["runs_needed"] = int(needed)
    return entries
