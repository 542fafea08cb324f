"""The view of an archive of a benchmark of methods: its methods, budgets and statistics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.comparison import reference_name
from uqpen.archive.estimates import unpack
from uqpen.archive.read import group_names, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import BENCHMARK_STATISTICS
from uqpen.core.labels import (
    BUDGET,
    COMPARISON_GROUP,
    NOTE,
    REPEAT,
    REPLICATED,
    REPLICATES_OF_BUDGET,
    RUNS_OF_BUDGET,
    RUNS_SPENT,
    SINGLE,
    SOURCE,
    STATISTICS_GROUP,
    VARIANTS,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text
from uqpen.results.table import conversion, entry_label
from uqpen.results.texts import title_with_name
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson

__all__ = [
    "ComparedEntry",
    "ComparedMethod",
    "MethodComparison",
    "lowest_expected_coverage",
]


class ComparedMethod(NamedTuple):
    """A method of a benchmark.

    Attributes
    ----------
    group : str
        Name of its source in the archive.
    source : str
        The name of its design or surrogate in the study.
    variants : tuple of str
        The comparisons that it is in: of single sets of points, of replicated sets, or both.
    series : int
        Number of its colour and marker; the same for a design as one set and in replicates.
    runs, replicates : tuple of int
        At each budget; no runs where it takes no part.
    """

    group: str
    source: str
    variants: tuple[str, ...]
    series: int
    runs: tuple[int, ...]
    replicates: tuple[int, ...]

    @property
    def name(self) -> str:
        """Its name in tables and JSON; with a space if it is not a name in the study."""
        return self.source if SINGLE in self.variants else f"{self.source} {REPLICATED}"


@dataclass(frozen=True)
class MethodComparison:
    """The methods of a benchmark, and what they are compared by.

    Parameters
    ----------
    view : ArchiveView
        An archive of a benchmark of methods, or one output of it.
    """

    view: ArchiveView

    @classmethod
    def of(cls, tree: xr.DataTree) -> MethodComparison:
        """Return the whole of an archive."""
        return cls(ArchiveView(tree, ""))

    @cached_property
    def reference(self) -> str:
        """The source that errors are measured from."""
        return reference_name(self.view.tree)

    @cached_property
    def methods(self) -> list[ComparedMethod]:
        """All methods, in the order of the archive."""
        return list(self._methods())

    def _methods(self) -> Iterator[ComparedMethod]:
        output = next(iter(group_names(self.view.tree, COMPARISON_GROUP)), "")
        for name in self.view.sources if output else ():
            if name == self.reference:
                continue
            attributes = read_group(self.view.tree, STATISTICS_GROUP, name).attrs
            runs, replicates = (
                read_group(self.view.tree, STATISTICS_GROUP, name, output)[each].values.tolist()
                for each in (RUNS_OF_BUDGET, REPLICATES_OF_BUDGET)
            )
            source = str(attributes[SOURCE])
            variants = tuple(str(attributes[VARIANTS]).split())
            series = self.view.series(source)
            yield ComparedMethod(name, source, variants, series, tuple(runs), tuple(replicates))

    def methods_in(self, variant: str) -> list[ComparedMethod]:
        """Return the methods of one of the comparisons."""
        return [method for method in self.methods if variant in method.variants]

    @property
    def variants(self) -> list[str]:
        """The comparisons that differ: only one where no method has replicates."""
        has_replicates = any(SINGLE not in each.variants for each in self.methods)
        return [SINGLE, REPLICATED] if has_replicates else [SINGLE]

    @cached_property
    def entries(self) -> list[ComparedEntry]:
        """All entries of all statistics, output by output."""
        return list(self._entries())

    def _entries(self) -> Iterator[ComparedEntry]:
        for output in group_names(self.view.tree, COMPARISON_GROUP):
            truths = self.view.statistics.statistics(self.reference, output)
            verdicts = read_group(self.view.tree, COMPARISON_GROUP, output)
            for statistic in BENCHMARK_STATISTICS:
                if f"{statistic.name}_verdict" in verdicts and self.view.output in (None, output):
                    sizes = truths[statistic.name].sizes
                    positions = range(sizes[statistic.dims[0]]) if statistic.dims else (None,)
                    yield from (ComparedEntry(self, output, statistic, at) for at in positions)

    @property
    def by_output(self) -> dict[str, list[ComparedEntry]]:
        """The entries of all statistics of each output."""
        outputs = groupby(self.entries, lambda entry: entry.output)
        return {output: list(found) for output, found in outputs}

    def heading(self, output: str) -> str:
        """Return an output's title as a heading has it."""
        described = read_group(self.view.tree, COMPARISON_GROUP, output).attrs
        return title_with_name(str(described.get("long_name", "")) or output, output)

    @property
    def budgets(self) -> list[int]:
        """The numbers of runs that the methods are given."""
        errors = self.entries[0].of(self.methods[0])
        return [int(budget) for budget in errors[BUDGET].values]

    @property
    def repeats(self) -> int:
        """The number of repeats of each method at each budget."""
        return int(self.entries[0].of(self.methods[0]).sizes[REPEAT])

    @property
    def reference_runs(self) -> int:
        """The number of runs of the reference."""
        return int(read_group(self.view.tree, STATISTICS_GROUP, self.reference).attrs[RUNS_SPENT])

    @property
    def reference_runs_used(self) -> int:
        """The number of completed runs of the reference, which all outputs share."""
        return int(self.entries[0].reference.attrs["runs_used"])

    @property
    def runs_charged(self) -> int:
        """The number of runs of all methods in all repeats."""
        return sum(sum(method.runs) for method in self.methods) * self.repeats


@dataclass(frozen=True)
class ComparedEntry:
    """One entry of a statistic of an output, of all methods.

    Parameters
    ----------
    comparison : MethodComparison
    output : str
    statistic : Statistic
        Of the catalogue.
    position : int or None
        Among the entries; None for a statistic with a single one.
    """

    comparison: MethodComparison
    output: str
    statistic: Statistic
    position: int | None

    def of(self, method: ComparedMethod, what: str = "") -> xr.DataArray:
        """Return the estimates of a method, or its ``"error"``, ``"coverage"`` or ``"slope"``."""
        return self._archived(method.group, f"{self.statistic.name}_{what}".removesuffix("_"))

    @property
    def reference(self) -> xr.DataArray:
        """The reference's estimate, as its analysis made it."""
        return self._archived(self.comparison.reference, self.statistic.name)

    def _archived(self, source: str, name: str) -> xr.DataArray:
        array = self.comparison.view.statistics.get(source, self.output, name)
        assert array is not None, name
        return self._selected(array)

    def finding(self, what: str) -> xr.DataArray:
        """Return what is said of all methods: ``"verdict"``, say, along variant and budget."""
        verdicts = read_group(self.comparison.view.tree, COMPARISON_GROUP, self.output)
        array = unpack(verdicts, f"{self.statistic.name}_{what}")
        assert array is not None, what
        return self._selected(array)

    def _selected(self, array: xr.DataArray) -> xr.DataArray:
        if self.position is None:
            return array
        return array[dict.fromkeys(self.statistic.dims, self.position)]

    @property
    def entry_name(self) -> str | float:
        """The coordinate that identifies it within its statistic; empty for a single one."""
        if self.position is None:
            return ""
        entry: str | float = self.reference[self.statistic.dims[0]].values.tolist()
        return entry

    @property
    def label(self) -> str:
        """The statistic as a table of a study calls it."""
        return entry_label(self.statistic, self.entry_name)

    @property
    def units(self) -> str:
        """The unit of its estimates."""
        return str(self.reference.attrs["units"])

    @property
    def display_units(self) -> str:
        """The unit that the study shows."""
        has_unit = self.statistic.unit is not UnitRule.NONE
        return self.comparison.view.unit(self.output) if has_unit else DIMENSIONLESS

    @property
    def error_scale(self) -> float:
        """The size that errors are relative to."""
        return float(self.finding("scale"))

    @property
    def reference_error(self) -> float:
        """Half the reference's interval, in per cent of the scale of errors; NaN for none."""
        _, lower, upper = self.reference.values.tolist()
        relative_to = self.error_scale
        return 100 * (upper - lower) / 2 / relative_to if relative_to > 0 else float("nan")

    def percent_errors(self, method: ComparedMethod) -> FloatArray:
        """Return the errors of a method in per cent, for a logarithmic axis.

        Returns
        -------
        ndarray, shape (budget, bound)
            NaN where there is none, and for an error of 0, which such an axis does not show.
        """
        found: FloatArray = 100 * self.of(method, "error").values.astype(np.float64)
        return np.where(np.isfinite(found) & (found > 0), found, np.nan)

    @property
    def error_notes(self) -> list[str]:
        """The notes on the intervals of its errors, each once."""
        notes = (
            note
            for method in self.comparison.methods
            for note in np.ravel(self.of(method, "error").coords[NOTE].values)
        )
        return [note for note in dict.fromkeys(map(str, notes)) if note]

    @property
    def single_set_standings(self) -> list[tuple[str, float]]:
        """The methods that are level, and the lower bound of the lead, of single sets by budget."""
        levels, leads = self.finding("level"), self.finding("lead")
        return list(zip(levels.values[0].tolist(), leads.values[0, :, 1].tolist(), strict=True))

    @property
    def reference_text(self) -> str:
        """The reference's estimate in the unit that the study shows."""
        unit = self.display_units
        convert = conversion(self.statistic.name, scale(unit))
        text = estimate_text(*(float(value) for value in convert(self.reference.values)))
        return text if unit == DIMENSIONLESS else f"{text} {unit}"


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
