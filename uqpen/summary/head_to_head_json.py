"""An archive of methods head to head as JSON for scripts."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.archive.read import group
from uqpen.labels import BUDGET, ERRORS, ESTIMATES, KIND, METHOD, METHODS, SLOPES, VARIANT, VERDICTS
from uqpen.summary.figure import figure
from uqpen.summary.head_to_head_entries import Entry, entries
from uqpen.summary.json import identity

__all__ = ["as_json"]


def as_json(tree: xr.DataTree) -> dict[str, Any]:
    """What a comparison says, in nested dicts of plain numbers and texts.

    Parameters
    ----------
    tree : DataTree
        An archive of methods head to head.

    Returns
    -------
    dict
        ``methods.<name>`` with ``runs`` and ``replicates`` by budget; ``outputs.<output>`` with
        ``mean``, ``std``, ``quantiles.<p>`` and ``exceedance.<threshold>``, each with
        ``reference``, ``errors.<method>.<budget>``, ``slopes.<method>`` and
        ``verdicts.<variant>.<budget>``.
    """
    methods = group(tree, METHODS)
    return {
        **identity(tree),
        "kind": tree.attrs[KIND],
        "repeats": int(methods.attrs["repeats"]),
        "reference_runs": int(methods.attrs["reference_runs"]),
        "methods": {
            str(name): _method(methods.isel({METHOD: position}))
            for position, name in enumerate(methods[METHOD].values)
        },
        "outputs": _outputs(tree),
    }


def _method(method: xr.Dataset) -> dict[str, Any]:
    budgets = method[BUDGET].values.tolist()
    return {
        "source": str(method["source"].item()),
        "contests": str(method["contests"].item()).split(),
        **{
            name: {str(b): int(n) for b, n in zip(budgets, method[name].values, strict=True)}
            for name in ("runs", "replicates")
        },
    }


def _outputs(tree: xr.DataTree) -> dict[str, dict[str, Any]]:
    """All that is told of each output, by its statistics."""
    found: dict[str, dict[str, Any]] = {}
    for entry in entries(tree):
        output = found.setdefault(entry.output, {})
        if entry.position is None:
            output[entry.statistic] = _told(entry)
        else:
            key = "quantiles" if entry.statistic == "quantile" else entry.statistic
            output.setdefault(key, {})[entry.called] = _told(entry)
    return found


def _told(entry: Entry) -> dict[str, Any]:
    errors, coverage, slopes = entry.of(ERRORS), entry.of(ERRORS, "_coverage"), entry.of(SLOPES)
    names = [str(name) for name in errors[METHOD].values]
    budgets = [str(budget) for budget in errors[BUDGET].values]
    return {
        "units": entry.of(ESTIMATES).attrs["units"],
        "reference": figure(entry.truth),
        "relative_to": float(entry.of(ERRORS, "_scale")),
        "errors": {
            name: {
                budget: {**figure(errors[i, j]), "coverage": _number(float(coverage[i, j]))}
                for j, budget in enumerate(budgets)
            }
            for i, name in enumerate(names)
        },
        "slopes": {name: figure(slopes[i]) for i, name in enumerate(names)},
        "verdicts": {
            str(variant): {budget: _verdict(entry, i, j) for j, budget in enumerate(budgets)}
            for i, variant in enumerate(entry.of(VERDICTS, "_lead")[VARIANT].values)
        },
    }


def _verdict(entry: Entry, variant: int, budget: int) -> dict[str, Any]:
    def text(what: str) -> str:
        return str(entry.of(VERDICTS, f"_{what}").values[variant, budget])

    return {
        "winner": text("winner") or None,
        "runner_up": text("runner_up") or None,
        "level": text("level").split(),
        "lead": figure(entry.of(VERDICTS, "_lead")[variant, budget]),
        "verdict": text("verdict"),
        "note": text("note"),
    }


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
