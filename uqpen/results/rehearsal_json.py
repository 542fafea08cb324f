"""Findings of a rehearsal as JSON for scripts."""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.core.labels import BOUNDS, EQUAL, STATED
from uqpen.results.estimate_json import json_value

__all__ = ["rehearsal_json"]

_SIZES = {STATED: "designs", EQUAL: "designs_at_equal_runs"}


def rehearsal_json(findings: xr.Dataset) -> dict[str, Any]:
    """Return the findings of a rehearsal as nested dicts of plain numbers and texts.

    Parameters
    ----------
    findings : Dataset
        The result of `uqpen.rehearsal.rehearse.rehearse`.

    Returns
    -------
    dict
        ``outputs.<output>.<statistic>`` is a list with an object for each entry. In SI units.
    """
    outputs: dict[str, dict[str, list[Any]]] = {}
    for position in range(findings.sizes["entry"]):
        entry = findings.isel(entry=position)
        statistics = outputs.setdefault(str(entry["output"].item()), {})
        statistics.setdefault(str(entry["statistic"].item()), []).append(_entry_json(entry))
    return {**findings.attrs, "seed": int(findings.attrs["seed"]), "outputs": outputs}


def _entry_json(entry: xr.Dataset) -> dict[str, Any]:
    designs: dict[str, dict[str, Any]] = {name: {} for name in _SIZES.values()}
    for position in range(entry.sizes["source"]):
        source = entry.isel(source=position)
        of_size = designs[_SIZES[str(source["size"].item())]]
        of_size[str(source["design"].item())] = _source_json(source)
    names = ("tail_in_surrogate", "tail_in_runs", "hangs_on_tail")
    return {
        "label": entry["label"].item() or None,
        "units": entry["units"].item(),
        "confidence_level": entry["level"].item(),
        "truth": _estimate(entry["truth"]),
        **{name: json_value(entry[name].item()) for name in names},
        **designs,
        "best": str(entry["best"].item()).split(),
    }


def _source_json(source: xr.Dataset) -> dict[str, Any]:
    return {
        "runs": int(source["runs"]),
        "coverage": _estimate(source["coverage"]),
        "falls_short": bool(source["falls_short"]),
        "share_with_interval": json_value(source["given"].item()),
        "half_width": json_value(source["half_width"].item()),
    }


def _estimate(values: xr.DataArray) -> dict[str, Any]:
    return dict(zip(BOUNDS, json_value(values.values), strict=True))
