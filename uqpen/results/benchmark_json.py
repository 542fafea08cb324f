"""An archive of a benchmark of methods, as JSON for scripts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from uqpen.core.labels import KIND, VARIANT
from uqpen.results.estimate_json import entries_json, estimate_json, json_value
from uqpen.results.json import archive_identity
from uqpen.results.method_comparison import ComparedEntry, MethodComparison

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
    comparison = MethodComparison.of(tree)
    outputs: dict[str, dict[str, Any]] = {}
    for entry in comparison.entries:
        output, statistic = outputs.setdefault(entry.output, {}), entry.statistic
        if statistic.dims:
            output.setdefault(statistic.shown.json, {})[entry.entry_name] = _statistic_json(entry)
        else:
            output[statistic.name] = _statistic_json(entry)
    return {
        **archive_identity(tree),
        "kind": tree.attrs[KIND],
        "repeats": comparison.repeats,
        "reference_runs": comparison.reference_runs,
        "methods": {
            method.name: {
                "source": method.source,
                "contests": list(method.variants),
                "runs": _by_budget(comparison, method.runs),
                "replicates": _by_budget(comparison, method.replicates),
            }
            for method in comparison.methods
        },
        "outputs": outputs,
    }


def _by_budget(comparison: MethodComparison, counts: Sequence[int]) -> dict[str, int]:
    return {str(at): count for at, count in zip(comparison.budgets, counts, strict=True)}


def _statistic_json(entry: ComparedEntry) -> dict[str, Any]:
    methods = entry.comparison.methods
    errors = {method.name: entries_json(entry.of(method, "error")) for method in methods}
    for method in methods:
        shares = entry.of(method, "coverage").values
        for error, share in zip(errors[method.name].values(), shares, strict=True):
            error["coverage"] = json_value(share)
    return {
        "units": entry.units,
        "reference": estimate_json(entry.reference),
        "relative_to": entry.error_scale,
        "errors": errors,
        "slopes": {m.name: estimate_json(entry.of(m, "slope")) for m in methods},
        "verdicts": {
            str(variant): {
                str(budget): _verdict_json(entry, i, j)
                for j, budget in enumerate(entry.comparison.budgets)
            }
            for i, variant in enumerate(entry.finding("lead")[VARIANT].values)
        },
    }


def _verdict_json(entry: ComparedEntry, variant: int, budget: int) -> dict[str, Any]:
    def text(name: str) -> str:
        return str(entry.finding(name).values[variant, budget])

    return {
        "winner": text("winner") or None,
        "runner_up": text("runner_up") or None,
        "level": text("level").split(),
        "lead": estimate_json(entry.finding("lead")[variant, budget]),
        "verdict": text("verdict"),
        "note": text("remark"),
    }
