"""What a comparison of methods cost, its tables, and the reference that errors are held to."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group
from uqpen.archive.told import told
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number
from uqpen.labels import BUDGET, ERRORS, ESTIMATES, INTERVAL, METHODS
from uqpen.report.blocks import Block, Table, Text
from uqpen.report.head_to_head.contest import (
    by_output,
    called,
    indented,
    own_error,
    runs_of_reference,
)
from uqpen.report.sections.archive import study_of
from uqpen.report.sections.archive_tables import provenance_of
from uqpen.summary.digits import grouped
from uqpen.summary.head_to_head import LEGEND, contests, methods_table, percentage
from uqpen.summary.head_to_head_entries import Entry
from uqpen.summary.table import NOTHING, OutputTable, remark
from uqpen.units import scale

__all__ = ["cost", "provenance", "reference", "tables"]


def cost(tree: xr.DataTree) -> Iterator[Block]:
    """What each method makes of the runs that it is given."""
    yield Table(indented(methods_table(tree)))
    methods = group(tree, METHODS)
    charged = int(methods["runs"].sum()) * int(methods.attrs["repeats"])
    yield Text(
        f"All repeats together are charged {grouped(charged)} runs, and the reference "
        f"{grouped(int(methods.attrs['reference_runs']))}."
    )
    if (methods["runs"] < methods[BUDGET]).where(methods["runs"] > 0, other=False).any():
        yield Text(
            "Where a method makes fewer runs than it is given, no more of its blocks or replicates "
            "fit. Its errors stand at the number that it is given; slopes are over the runs made."
        )


def tables(tree: xr.DataTree) -> Iterator[Block]:
    """The tables that the command line shows, with their legend."""
    yield Text(LEGEND)
    for contest in contests(tree):
        yield Table(indented(contest.table), is_folded=True)


def reference(tree: xr.DataTree) -> Iterator[Block]:
    """The values that errors are held to, and how sure they are."""
    made, used = runs_of_reference(tree)
    yield Text(
        f"It made {grouped(made)} runs, of which {grouped(used)} came back and count."
        if used < made
        else f"It made {grouped(made)} runs, all of which came back."
    )
    for output, found in by_output(tree).items():
        yield Table(_values(tree, output, found))


def _values(tree: xr.DataTree, output: str, found: list[Entry]) -> OutputTable:
    columns = ["value", "its own error", "errors are relative to", "how its interval was made"]
    table = OutputTable(f"Reference of {called(tree, output)}", columns)
    for entry in found:
        truth = entry.truth
        value = entry.shown_truth if math.isfinite(truth.values[0]) else NOTHING
        value += table.mark(remark(truth))
        cells = [value, _own_error(entry), _relative_to(entry), told(truth, INTERVAL) or NOTHING]
        table.rows.append((entry.label, cells))
    return table


def _own_error(entry: Entry) -> str:
    """Half its interval over what errors are relative to."""
    own = own_error(entry)
    return NOTHING if math.isnan(own) else f"± {percentage(own / 100)} %"


def _relative_to(entry: Entry) -> str:
    """What errors are relative to, in the unit that is shown."""
    unit = str(entry.of(ESTIMATES).attrs["display_units"])
    value = float(np.asarray(scale(unit).difference_from_si(float(entry.of(ERRORS, "_scale")))))
    if not math.isfinite(value + float(entry.truth.values[0])):
        return NOTHING
    return f"{value:.4g}{after_number(unit)}"


def provenance(tree: xr.DataTree) -> Iterator[Block]:
    """The study's text, and what made the archive."""
    part = Part(tree, "")
    yield from study_of(part)
    yield Table(provenance_of(part))
