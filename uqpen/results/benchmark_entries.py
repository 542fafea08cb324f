"""What an archive of methods head to head holds, one entry of a statistic at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import (
    ENTRIES,
    ESTIMATES,
    EXCEEDANCE,
    MOMENTS,
    QUANTILES,
    REFERENCE,
    VERDICTS,
)
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import estimate_text
from uqpen.results.table import exceedance_label, quantile_label

__all__ = ["BenchmarkEntry", "entries"]

# Where a statistic of the reference stands among those of a study.
_IN_MOMENTS = ("mean", "std")


@dataclass(frozen=True)
class BenchmarkEntry:
    """One entry of a statistic: its variables, without the dimension of the entries.

    Parameters
    ----------
    tree : DataTree
        An archive of methods head to head.
    output, statistic : str
        Of what.
    position : int or None
        Which of the entries; None of a statistic that has one only.
    """

    tree: xr.DataTree
    output: str
    statistic: str
    position: int | None

    def variable(self, kind: str, suffix: str = "") -> xr.DataArray:
        """Its variable in a group."""
        array = read_group(self.tree, kind, self.output)[f"{self.statistic}{suffix}"]
        return array if self.position is None else array[{ENTRIES[self.statistic]: self.position}]

    @property
    def entry_name(self) -> str | float:
        """What tells it from others of its statistic."""
        if self.position is None:
            return ""
        names = read_group(self.tree, ESTIMATES, self.output)[ENTRIES[self.statistic]]
        entry: str | float = names.values.tolist()[self.position]
        return entry

    @property
    def label(self) -> str:
        """The statistic as a table of a study calls it."""
        if self.statistic == "quantile":
            return quantile_label(float(self.entry_name))
        if self.statistic == EXCEEDANCE:
            return exceedance_label(str(self.entry_name))
        return {"std": "sd"}.get(self.statistic, self.statistic)

    @property
    def single_set_standings(self) -> list[tuple[str, float]]:
        """Of the single sets at each budget, who is level and the lower bound of the lead."""
        levels, leads = self.variable(VERDICTS, "_level"), self.variable(VERDICTS, "_lead")
        return list(zip(levels.values[0].tolist(), leads.values[0, :, 1].tolist(), strict=True))

    @property
    def reference(self) -> xr.DataArray:
        """The reference's estimate, as its analysis made it."""
        if self.statistic in _IN_MOMENTS:
            return read_group(self.tree, REFERENCE, MOMENTS)[f"{self.output}_{self.statistic}"]
        where = EXCEEDANCE if self.statistic == EXCEEDANCE else QUANTILES
        return read_group(self.tree, REFERENCE, where)[self.output][self.position]

    @property
    def reference_text(self) -> str:
        """The reference's estimate in the unit that the study shows."""
        unit = str(self.variable(ESTIMATES).attrs["display_units"])
        measure = scale(unit)
        convert = measure.difference_from_si if self.statistic == "std" else measure.from_si
        text = estimate_text(*(float(value) for value in convert(self.reference.values)))
        return text if unit == DIMENSIONLESS else f"{text} {unit}"


def _statistic_entries(tree: xr.DataTree, output: str, statistic: str) -> Iterator[BenchmarkEntry]:
    if statistic not in ENTRIES:
        yield BenchmarkEntry(tree, output, statistic, None)
        return
    count = read_group(tree, ESTIMATES, output).sizes[ENTRIES[statistic]]
    yield from (BenchmarkEntry(tree, output, statistic, position) for position in range(count))


def entries(tree: xr.DataTree) -> Iterator[BenchmarkEntry]:
    """All entries of all statistics, output by output."""
    for output in group_names(tree, ESTIMATES):
        for statistic in read_group(tree, ESTIMATES, output).data_vars:
            yield from _statistic_entries(tree, output, str(statistic))
