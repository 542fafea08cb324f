"""An archive as JSON for scripts: SI units, every figure with its bounds."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.archive.read import SCHEMA_ATTRIBUTE, group, names_in
from uqpen.archive.told import told
from uqpen.evaluation import status_counts
from uqpen.labels import (
    BOUND,
    CONDITIONAL,
    EXCEEDANCE,
    HOLDS,
    INTERVAL,
    INTERVAL_LABEL,
    MISSING,
    MOMENTS,
    NOTE,
    QUANTILES,
    RUN,
    RUNS,
    SHARES,
    STATISTICS,
    STATUSES,
)
from uqpen.summary.losses import losses
from uqpen.summary.tables import output_names
from uqpen.units import DIMENSIONLESS

__all__ = ["as_json"]


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
        ``designs.<name>`` with ``runs``, ``status.<meaning>`` and ``outputs.<output>``; each figure
        ``{estimate, lower, upper}`` in SI units, None where there is none, with how its interval
        was made.
    """
    return {
        "title": tree.attrs["title"],
        "study_sha256": tree.attrs["study_sha256"],
        "seed": int(tree.attrs["seed"]),
        "schema": int(tree.attrs[SCHEMA_ATTRIBUTE]),
        "designs": {name: _design(tree, name) for name in names_in(tree, RUNS)},
    }


def _design(tree: xr.DataTree, design: str) -> dict[str, Any]:
    runs, statuses = group(tree, RUNS, design), group(tree, STATUSES, design)
    return {
        "runs": int(runs.sizes[RUN]),
        "status": {status.meaning: count for status, count in status_counts(runs).items()},
        "reasons": [
            {"status": loss.status.meaning, "reason": loss.reason, "runs": loss.runs}
            for loss in losses(tree, design)
        ],
        "lost": {str(name): _figure(array) for name, array in statuses.data_vars.items()},
        **{name: statuses.attrs[name] for name in (CONDITIONAL, MISSING) if name in statuses.attrs},
        "outputs": {name: _output(tree, design, name, runs) for name in output_names(runs)},
    }


def _output(tree: xr.DataTree, design: str, name: str, runs: xr.Dataset) -> dict[str, Any]:
    found: dict[str, Any] = {"units": runs[name].attrs.get("units", DIMENSIONLESS)}
    moments = group(tree, MOMENTS, design)
    for statistic in STATISTICS:
        if f"{name}_{statistic}" in moments:
            found[statistic] = _figure(moments[f"{name}_{statistic}"])
    for key, kind, coordinate in _FAMILIES:
        answers = group(tree, kind, design)
        if name in answers:
            labels = answers[f"{name}_{coordinate}"].values
            array = answers[name]
            found[key] = {str(label): _figure(array[i]) for i, label in enumerate(labels)}
            if key == "hold":
                needed = answers[f"{name}_hold_runs_needed"].values
                for label, runs_needed in zip(labels, needed, strict=True):
                    found[key][str(label)]["runs_needed"] = int(runs_needed)
    return found


def _figure(array: xr.DataArray) -> dict[str, Any]:
    bounds = zip(array[BOUND].values.tolist(), array.values.tolist(), strict=True)
    figure: dict[str, Any] = {str(k): v if math.isfinite(v) else None for k, v in bounds}
    figure |= {what: told(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := told(array, NOTE):
        figure[NOTE] = note
    return figure
