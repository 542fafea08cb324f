"""Bounds over intervals: each with its interval, and the range between the outer limits of both."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUNDED_EVENT,
    BOUNDS_GROUP,
    INTERVAL_ENDS,
    INTERVAL_LEVEL,
    PARAMETER_INTERVALS,
    PROBABILITY,
    RUNS,
    SAMPLING,
)
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import UnitRule
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import estimate_texts, percent_text, percent_texts, range_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    entry_label,
    estimate_json,
    estimate_remark,
    quantile_label,
)


class FoundBounds(NamedTuple):
    """Both bounds of a probability, a mean or a quantile, as a design has found them."""

    title: str  # what is bounded: ``"P(depth > 3 m)"``, say
    unit: str  # that a value is shown in; empty for a probability
    # That the runs of the design have for it; -1 where all runs are of all bounds.
    number: int
    lower: xr.DataArray  # (bound,): the lower bound, in SI units
    upper: xr.DataArray  # the same of the upper one
    # The interval over uncertain parameters as well; None where a study has none.
    total: xr.DataArray | None = None

    @property
    def range(self) -> tuple[float, float] | None:
        """Lower limit of the lower bound, upper limit of the upper one; None without bounds."""
        found = float(self.lower[1]), float(self.upper[2])
        return found if np.isfinite(found).all() else None

    @property
    def level(self) -> str:
        """Probability that the range contains both bounds; empty without bounds."""
        level = self.lower.attrs.get(INTERVAL_LEVEL)
        return "" if self.range is None or level is None else percent_text(float(level))

    def texts(self, bound: xr.DataArray) -> list[str]:
        """Return a bound and both of its limits, in the digits that they have."""
        if not self.unit:
            return [*percent_texts(*bound.values.tolist())]
        unit = "" if self.unit == DIMENSIONLESS else f" {self.unit}"
        shown = scale(self.unit).from_si(bound.values).tolist()
        return [f"{each}{unit}" for each in estimate_texts(*shown)]


def found_bounds(statistics: SourceStatistics, design: str) -> Iterator[FoundBounds]:
    """Yield the bounds that a design has found, those of events first."""
    described = read_group(statistics.tree, RUNS, design).attrs
    if described.get(SAMPLING) == Sampling.OVER_BOX:
        yield from _bounds_over_box(statistics, design)
    if described.get(SAMPLING) != Sampling.TOWARDS_BOUNDS:
        return
    from uqpen.surrogates.interval_bounds import bounded_in  # few archives have bounds

    of_events = statistics.of_runs(BOUNDS_GROUP, design)
    for number, each in enumerate(bounded_in(described)):
        if each.event is not None:
            ends = (of_events[f"{end}_probability"][number] for end in ("lower", "upper"))
            yield FoundBounds(f"P({each.event})", "", number, *ends)
            continue
        (output,), p = each.outputs, each.probability
        title, name = ("mean", "mean") if p is None else (quantile_label(p), "quantile")
        arrays = (
            statistics.statistics(design, output)[f"{end}_{name}"] for end in ("lower", "upper")
        )
        ends = (array if p is None else array.sel({PROBABILITY: p}) for array in arrays)
        yield FoundBounds(f"{title} of {output}", statistics.unit(output), number, *ends)


# The statistics that have bounds over parameters that are intervals, in the order of their places.
_OVER_BOX = [CATALOGUE[name] for name in ("exceedance", "below", "share", "quantile", "mean")]


def _bounds_over_box(statistics: SourceStatistics, design: str) -> Iterator[FoundBounds]:
    """Yield the bounds over parameters that are intervals: of events, then of each output."""
    of_events = statistics.of_runs(BOUNDS_GROUP, design)
    if "lower_probability" in of_events:
        both = of_events["lower_probability"], of_events["upper_probability"]
        for lower, upper in zip(*both, strict=True):
            yield FoundBounds(f"P({lower[BOUNDED_EVENT].item()})", "", -1, lower, upper)
    for output in statistics.scalar_outputs:
        of_output = statistics.statistics(design, output)
        for record in (each for each in _OVER_BOX if f"lower_{each.name}" in of_output):
            ends = of_output[f"lower_{record.name}"], of_output[f"upper_{record.name}"]
            unit = "" if record.unit is UnitRule.NONE else statistics.unit(output)
            total = of_output.get(f"total_{record.name}")
            if not record.dims:
                yield FoundBounds(f"{record.title} of {output}", unit, -1, *ends, total)
                continue
            for place, (lower, upper) in enumerate(zip(*ends, strict=True)):
                label = entry_label(record, lower[record.dims[0]].item())
                own = None if total is None else total[place]
                yield FoundBounds(f"{label} of {output}", unit, -1, lower, upper, own)


def interval_inputs(tree: xr.DataTree, design: str) -> str:
    """Return the inputs of a design that are intervals, and parameters of others that are."""
    found = []
    for name, each in read_group(tree, RUNS, design).variables.items():
        if INTERVAL_ENDS in each.attrs:
            found.append(str(name))
        elif PARAMETER_INTERVALS in each.attrs:
            found.append(f"{each.attrs[PARAMETER_INTERVALS]} of {name}")
    return ", ".join(found)


def bound_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table of each design for bounds: both bounds with their limits, and the range."""
    statistics = SourceStatistics(tree)
    for design in statistics.sources:
        every = [*found_bounds(statistics, design)]
        if not every:
            continue
        levels = {each.level for each in every} - {""}
        columns = ["lower bound", "upper bound", ", ".join(["range", *levels])]
        has_total = any(each.total is not None for each in every)
        columns += ["range, with uncertain parameters"] * has_total
        title = f"{design}: bounds over all values of {interval_inputs(tree, design)}"
        table = OutputTable(title, columns)
        for each in every:
            cells = []
            for bound in (each.lower, each.upper):
                value, *limits = each.texts(bound)
                text = f"{value} ({range_text(*limits)})" if each.range else NOTHING
                cells.append(text + table.note_mark(*estimate_remark(bound).split("; ")))
            ends = each.texts(each.lower)[1], each.texts(each.upper)[2]
            cells.append(range_text(*ends) if each.range else NOTHING)
            if has_total:
                if each.total is None or not np.isfinite(each.total.values).all():
                    cells.append(NOTHING)
                else:
                    marks = table.note_mark(*estimate_remark(each.total).split("; "))
                    cells.append(range_text(*each.texts(each.total)[1:]) + marks)
            table.rows.append((each.title, cells))
        yield table


def bound_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return all bounds that a design has found, by what they are of, with their ranges."""
    found = {
        each.title: {
            "lower": estimate_json(each.lower),
            "upper": estimate_json(each.upper),
            "range": each.range and list(each.range),
            **({} if each.total is None else {"total": estimate_json(each.total)}),
        }
        for each in found_bounds(statistics, design)
    }
    return {BOUNDS_GROUP: found} if found else {}
