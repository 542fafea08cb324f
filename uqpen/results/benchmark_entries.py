"""The view of an archive of a benchmark of methods, one entry of a statistic at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.benchmark_layout import BENCHMARK_GROUP
from uqpen.archive.estimates import unpack
from uqpen.archive.read import group_names, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import NOTE, REFERENCE
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import estimate_text
from uqpen.results.table import conversion, entry_label
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson

__all__ = [
    "BenchmarkEntry",
    "entries",
    "lowest_expected_coverage",
    "output_title",
    "reference_attributes",
]


@dataclass(frozen=True)
class BenchmarkEntry:
    """One entry of a statistic: its variables, without the dimension of the entries.

    Parameters
    ----------
    tree : DataTree
        An archive of a benchmark of methods.
    output, statistic : str
        The names of the output, and of the statistic in the catalogue.
    position : int or None
        Among the entries; None for a statistic with a single one.
    """

    tree: xr.DataTree
    output: str
    statistic: str
    position: int | None

    def variable(self, name: str) -> xr.DataArray:
        """Return a variable of the entry, one of `BENCHMARK_VARIABLES`."""
        array = unpack(self._dataset, name)
        assert array is not None, name
        return self._selected(array)

    @property
    def reference(self) -> xr.DataArray:
        """The reference's estimate, as its analysis made it."""
        array = unpack(read_group(self.tree, REFERENCE, self.output), self.statistic)
        assert array is not None, self.statistic
        return self._selected(array)

    @property
    def _dataset(self) -> xr.Dataset:
        return read_group(self.tree, BENCHMARK_GROUP, self.output, self.statistic)

    def _selected(self, array: xr.DataArray) -> xr.DataArray:
        if self.position is None:
            return array
        return array[dict.fromkeys(CATALOGUE[self.statistic].dims, self.position)]

    @property
    def entry_name(self) -> str | float:
        """The coordinate that identifies it within its statistic; empty for a single one."""
        if self.position is None:
            return ""
        (dimension,) = CATALOGUE[self.statistic].dims
        entry: str | float = self._dataset[dimension].values.tolist()[self.position]
        return entry

    @property
    def label(self) -> str:
        """The statistic as a table of a study calls it."""
        return entry_label(CATALOGUE[self.statistic], self.entry_name)

    @property
    def units(self) -> str:
        """The unit of its estimates."""
        return str(self._dataset["estimate"].attrs["units"])

    @property
    def display_units(self) -> str:
        """The unit that the study shows."""
        return str(self._dataset["estimate"].attrs["display_units"])

    @property
    def error_scale(self) -> float:
        """The size that errors are relative to."""
        return float(self.variable("scale"))

    def percent_errors(self, position: int) -> FloatArray:
        """Return the errors of a method in per cent, for a logarithmic axis.

        Returns
        -------
        ndarray, shape (budget, bound)
            NaN where there is none, and for an error of 0, which such an axis does not show.
        """
        found: FloatArray = 100 * self.variable("error").values[position].astype(np.float64)
        return np.where(np.isfinite(found) & (found > 0), found, np.nan)

    @property
    def error_notes(self) -> list[str]:
        """The notes on the intervals of its errors, each once."""
        notes = np.ravel(self.variable("error").coords[NOTE].values)
        return [note for note in dict.fromkeys(map(str, notes)) if note]

    @property
    def single_set_standings(self) -> list[tuple[str, float]]:
        """The methods that are level, and the lower bound of the lead, of single sets by budget."""
        levels, leads = self.variable("level"), self.variable("lead")
        return list(zip(levels.values[0].tolist(), leads.values[0, :, 1].tolist(), strict=True))

    @property
    def reference_text(self) -> str:
        """The reference's estimate in the unit that the study shows."""
        unit = self.display_units
        convert = conversion(CATALOGUE[self.statistic], scale(unit))
        text = estimate_text(*(float(value) for value in convert(self.reference.values)))
        return text if unit == DIMENSIONLESS else f"{text} {unit}"


def entries(tree: xr.DataTree) -> Iterator[BenchmarkEntry]:
    """Yield all entries of all statistics, output by output."""
    for output in group_names(tree, BENCHMARK_GROUP):
        for statistic in group_names(tree.children[BENCHMARK_GROUP], output):
            dims = CATALOGUE[statistic].dims
            sizes = read_group(tree, BENCHMARK_GROUP, output, statistic).sizes
            positions = range(sizes[dims[0]]) if dims else (None,)
            yield from (BenchmarkEntry(tree, output, statistic, each) for each in positions)


def output_title(tree: xr.DataTree, output: str) -> str:
    """Return the title of an output."""
    described = read_group(tree, BENCHMARK_GROUP, output).attrs
    return str(described.get("long_name", "")) or output


def lowest_expected_coverage(level: float, repeats: int) -> float:
    """Return the least share of intervals that 95 % chance scatter allows.

    Parameters
    ----------
    level : float
        Nominal level of the intervals.
    repeats : int
        Number of intervals.
    """
    covered = np.arange(repeats + 1)
    _, upper = clopper_pearson(covered, repeats, LEVEL)
    return float(covered[upper >= level][0] / repeats)


def reference_attributes(tree: xr.DataTree) -> Mapping[Any, Any]:
    """Return the counts of the runs of the reference, which all outputs share."""
    return next(entries(tree)).reference.attrs
