"""Findings of a rehearsal, as tables and as JSON for scripts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUNDS, EQUAL, STATED
from uqpen.core.units import scale
from uqpen.results.digits import estimate_text, grouped_number, number_text, percent_text
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    entry_label,
    json_value,
    label_with_unit,
)
from uqpen.statistics.estimate import LEVEL

# Share of the repeats with an interval from which on no word is said.
_NEARLY_ALL = 0.995
# Half-width of the truth's own interval, in parts of the median half-width, that needs a word.
_COARSE = 0.2

_INDICES = ("first_order", "total_order")
_SHORT = "holds less often than stated"
# The sizes of designs in JSON.
_SIZES = {STATED: "designs", EQUAL: "designs_at_equal_runs"}
_BEST = "* narrowest of those that hold as stated, or within 5 % of that"


def rehearsal_heading(findings: xr.Dataset) -> tuple[str, ...]:
    """Return lines on what was repeated, and how far a coverage is known."""
    repeats = findings.attrs["repeats"]
    error = 100 * math.sqrt(LEVEL * (1 - LEVEL) / repeats)
    return (
        f"repeated {grouped_number(repeats)} times on {findings.attrs['surrogate']}, which is "
        "taken for the truth; no model was run",
        f"a coverage of {percent_text(LEVEL)} has a standard error of {error:.1f} points",
        "failures of the model's runs are not in the surrogate",
    )


def coverage_tables(findings: xr.Dataset) -> Iterator[OutputTable]:
    """Yield, for each output, the share of the intervals that hold, a column for each design.

    Sobol' indices have a table of their own, as few designs estimate them.
    """
    for output, part in _parts(findings, STATED):
        table = OutputTable(f"{output}: intervals that hold [%]", _designs(part))
        counts = [grouped_number(int(runs)) for runs in part["runs"].values]
        table.rows.append(("runs", counts))
        for entry in _entries(part):
            label = f"{_label(entry)}{table.note_mark(_entry_note(entry))}"
            cells = [_coverage_cell(table, each) for each in _sources(entry)]
            table.rows.append((label, cells))
        yield table


def width_tables(findings: xr.Dataset) -> Iterator[OutputTable]:
    """Yield, for each output, the median half-widths at equal numbers of runs, as coverages."""
    for output, part in _parts(findings, EQUAL):
        unit = str(part["display_units"].values[0])
        runs = grouped_number(int(part["runs"].max()))
        title = f"{label_with_unit(output, unit)}: half-widths at {runs} runs"
        table = OutputTable(title, _designs(part))
        for entry in _entries(part):
            best = str(entry["best"].item()).split()
            cells = [_width_cell(each, unit, best) for each in _sources(entry)]
            table.rows.append((_label(entry), cells))
        table.notes.append(_BEST)
        yield table


def _label(entry: xr.Dataset) -> str:
    """Return the label of an entry of a statistic in a table."""
    statistic, label = str(entry["statistic"].item()), str(entry["label"].item())
    record = CATALOGUE[statistic]
    if not record.shown.label:
        return f"{label}, {statistic.replace('_', ' ')}"
    is_number = record.own is not None and record.own.kind == "number"
    return entry_label(record, float(label) if is_number else label)


def _coverage_cell(table: OutputTable, found: xr.Dataset) -> str:
    """Return a coverage in per cent, with marks of its notes."""
    given = float(found["given"])
    if not given:
        return NOTHING + table.note_mark("no repeat has an interval")
    text = estimate_text(*(100 * found["coverage"].values))
    notes = [_SHORT] if found["falls_short"] else []
    if given < _NEARLY_ALL:
        notes.append(f"{percent_text(round(given, 3))} of the repeats have an interval")
    lower, upper = found["truth"].values[1:]
    if (upper - lower) / 2 > _COARSE * float(found["half_width"]):
        notes.append("the true value is not known well enough to judge this interval")
    return text + "".join(table.note_mark(note) for note in notes)


def _entry_note(entry: xr.Dataset) -> str:
    """Return what hangs on the tail that the surrogate does not know; empty for nothing."""
    if not entry["hangs_on_tail"]:
        return ""
    shares = [float(entry[name]) for name in ("tail_in_surrogate", "tail_in_runs")]
    surrogate, runs = (f"{100 * share:.0f} %" for share in shares)
    return (
        "hangs on values beyond the training range, which the surrogate does not know: they "
        f"have {surrogate} of its sampling variance in the surrogate and {runs} in the study's "
        "runs. How often its interval holds on the model may be quite different"
    )


def _width_cell(found: xr.Dataset, unit: str, best: list[str]) -> str:
    width = float(found["half_width"])
    if not math.isfinite(width):
        return NOTHING
    shown = conversion(CATALOGUE[str(found["statistic"].item())], scale(unit), is_difference=True)
    mark = " *" if str(found["design"].item()) in best else ""
    return f"{number_text(float(shown(np.float64(width))), 3)}{mark}"


def _parts(findings: xr.Dataset, size: str) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield each output with its findings for designs of one size: of samples, then of indices."""
    of_size = findings.isel(source=findings["size"].values == size)
    for output in dict.fromkeys(findings["output"].values.tolist()):
        found = of_size.isel(entry=of_size["output"].values == output)
        is_index = np.isin(found["statistic"].values, _INDICES)
        for part in (found.isel(entry=~is_index), found.isel(entry=is_index)):
            has_some = (part["given"].values > 0).any(axis=1)
            if has_some.any():
                yield output, part.isel(source=has_some)


def _designs(findings: xr.Dataset) -> list[str]:
    return list(map(str, findings["design"].values))


def _entries(findings: xr.Dataset) -> Iterator[xr.Dataset]:
    return (findings.isel(entry=position) for position in range(findings.sizes["entry"]))


def _sources(findings: xr.Dataset) -> Iterator[xr.Dataset]:
    return (findings.isel(source=position) for position in range(findings.sizes["source"]))


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
    for entry in _entries(findings):
        statistics = outputs.setdefault(str(entry["output"].item()), {})
        statistics.setdefault(str(entry["statistic"].item()), []).append(_entry_json(entry))
    return {**findings.attrs, "seed": int(findings.attrs["seed"]), "outputs": outputs}


def _entry_json(entry: xr.Dataset) -> dict[str, Any]:
    designs: dict[str, dict[str, Any]] = {name: {} for name in _SIZES.values()}
    for source in _sources(entry):
        of_size = designs[_SIZES[str(source["size"].item())]]
        of_size[str(source["design"].item())] = {
            "runs": int(source["runs"]),
            "coverage": _estimate(source["coverage"]),
            "falls_short": bool(source["falls_short"]),
            "share_with_interval": json_value(source["given"].item()),
            "half_width": json_value(source["half_width"].item()),
        }
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


def _estimate(values: xr.DataArray) -> dict[str, Any]:
    return dict(zip(BOUNDS, json_value(values.values), strict=True))
