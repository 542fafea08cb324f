"""An archive of a benchmark of methods, as JSON for scripts."""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import BUDGET, KIND, METHOD_DIMENSION, METHODS, VARIANT
from uqpen.results.benchmark_entries import BenchmarkEntry, entries
from uqpen.results.estimate_json import entries_json, estimate_json, json_value
from uqpen.results.json import archive_identity

__all__ = ["benchmark_json"]


def benchmark_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return a benchmark as nested dicts of plain numbers and texts.

    Parameters
    ----------
    tree : DataTree
        An archive of a benchmark of methods.

    Returns
    -------
    dict
        ``methods.<name>`` with ``runs`` and ``replicates`` by budget; ``outputs.<output>`` with
        ``mean``, ``std``, ``quantiles.<p>`` and ``exceedance.<threshold>``, each with
        ``reference``, ``errors.<method>.<budget>``, ``slopes.<method>`` and
        ``verdicts.<variant>.<budget>``.
    """
    methods = read_group(tree, METHODS)
    return {
        **archive_identity(tree),
        "kind": tree.attrs[KIND],
        "repeats": int(methods.attrs["repeats"]),
        "reference_runs": int(methods.attrs["reference_runs"]),
        "methods": {
            str(name): _method_json(methods.isel({METHOD_DIMENSION: position}))
            for position, name in enumerate(methods[METHOD_DIMENSION].values)
        },
        "outputs": _outputs_json(tree),
    }


def _method_json(method: xr.Dataset) -> dict[str, Any]:
    budgets = method[BUDGET].values.tolist()
    return {
        "source": str(method["source"].item()),
        "contests": str(method["contests"].item()).split(),
        **{
            name: {str(b): int(n) for b, n in zip(budgets, method[name].values, strict=True)}
            for name in ("runs", "replicates")
        },
    }


def _outputs_json(tree: xr.DataTree) -> dict[str, dict[str, Any]]:
    """Return all results of each output, by its statistics."""
    found: dict[str, dict[str, Any]] = {}
    for entry in entries(tree):
        output = found.setdefault(entry.output, {})
        if entry.position is None:
            output[entry.statistic] = _statistic_json(entry)
        else:
            key = "quantiles" if entry.statistic == "quantile" else entry.statistic
            output.setdefault(key, {})[entry.entry_name] = _statistic_json(entry)
    return found


def _statistic_json(entry: BenchmarkEntry) -> dict[str, Any]:
    errors, coverage, leads = map(entry.variable, ("error", "coverage", "lead"))
    budgets = [str(budget) for budget in errors[BUDGET].values]
    found: dict[str, Any] = {
        "units": entry.units,
        "reference": estimate_json(entry.reference),
        "relative_to": entry.error_scale,
        "errors": entries_json(errors),
        "slopes": entries_json(entry.variable("slope")),
        "verdicts": {
            str(variant): {budget: _verdict_json(entry, i, j) for j, budget in enumerate(budgets)}
            for i, variant in enumerate(leads[VARIANT].values)
        },
    }
    for by_budget, shares in zip(found["errors"].values(), coverage.values, strict=True):
        for error, share in zip(by_budget.values(), shares, strict=True):
            error["coverage"] = json_value(share)
    return found


def _verdict_json(entry: BenchmarkEntry, variant: int, budget: int) -> dict[str, Any]:
    def text(name: str) -> str:
        return str(entry.variable(name).values[variant, budget])

    return {
        "winner": text("winner") or None,
        "runner_up": text("runner_up") or None,
        "level": text("level").split(),
        "lead": estimate_json(entry.variable("lead")[variant, budget]),
        "verdict": text("verdict"),
        "note": text("remark"),
    }
