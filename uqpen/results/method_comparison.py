"""The view of an archive of a benchmark of methods: its methods, budgets and statistics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import array_entries, unpack
from uqpen.archive.read import group_names, is_benchmark, read_group
from uqpen.archive.structure import reference_name
from uqpen.core.catalogue import BENCHMARK_STATISTICS
from uqpen.core.labels import (
    BUDGET,
    COMPARISON_GROUP,
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
from uqpen.results.source_style import source_slots
from uqpen.results.table import conversion, entry_label
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
    variants : sequence of str
        The comparisons that it is in: of single sets of points, of replicated sets, or both.
    series : int
        Number of its colour and marker; the same for a design as one set and in replicates.
    runs, replicates : sequence of int
        At each budget; no runs where it takes no part.
    """

    group: str
    source: str
    variants: Sequence[str]
    series: int
    runs: Sequence[int]
    replicates: Sequence[int]

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
    # By group and name: to take an array out of its group takes its time.
    _arrays: dict[tuple[str, ...], list[xr.DataArray]] = field(
        default_factory=dict, compare=False, repr=False
    )

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
        if not is_benchmark(self.view.tree):
            return []
        described = {
            name: read_group(self.view.tree, STATISTICS_GROUP, name).attrs
            for name in self.view.sources
            if name != self.reference
        }
        text = str(self.view.archive.attrs.get("study_text", ""))
        slots = source_slots(text, (str(each[SOURCE]) for each in described.values()))
        found = []
        for name, attributes in described.items():
            by_budget = self._of_budgets(name)
            runs, replicates = (
                by_budget[each].values.tolist() for each in (RUNS_OF_BUDGET, REPLICATES_OF_BUDGET)
            )
            source, variants = str(attributes[SOURCE]), str(attributes[VARIANTS]).split()
            found.append(ComparedMethod(name, source, variants, slots[source], runs, replicates))
        return found

    def _of_budgets(self, method: str) -> xr.Dataset:
        """Return what a method has of the first output."""
        return read_group(self.view.tree, STATISTICS_GROUP, method, self.view.outputs[0])

    def methods_in(self, variant: str) -> list[ComparedMethod]:
        """Return the methods of one of the comparisons."""
        return [method for method in self.methods if variant in method.variants]

    @property
    def variants(self) -> list[str]:
        """The comparisons that differ: only one where no method has replicates."""
        has_replicates = any(SINGLE not in each.variants for each in self.methods)
        return [SINGLE, REPLICATED] if has_replicates else [SINGLE]

    @cached_property
    def by_output(self) -> dict[str, list[ComparedEntry]]:
        """The entries of all statistics of each output."""
        found: dict[str, list[ComparedEntry]] = {}
        for output in group_names(self.view.tree, COMPARISON_GROUP):
            verdicts = read_group(self.view.tree, COMPARISON_GROUP, output)
            for statistic in BENCHMARK_STATISTICS if self.view.output in (None, output) else ():
                if f"{statistic.name}_verdict" in verdicts:
                    sizes = [verdicts.sizes[dimension] for dimension in statistic.dims]
                    positions = range(sizes[0] if sizes else 1)
                    entries = (ComparedEntry(self, output, statistic, at) for at in positions)
                    found.setdefault(output, []).extend(entries)
        return found

    @property
    def entries(self) -> list[ComparedEntry]:
        """All entries of all statistics, output by output."""
        return [entry for entries in self.by_output.values() for entry in entries]

    @cached_property
    def budgets(self) -> list[int]:
        """The numbers of runs that the methods are given."""
        budgets: list[int] = self._of_budgets(self.methods[0].group)[BUDGET].values.tolist()
        return budgets

    @cached_property
    def repeats(self) -> int:
        """The number of repeats of each method at each budget."""
        return int(self._of_budgets(self.methods[0].group).sizes[REPEAT])

    def entry_arrays(
        self, path: tuple[str, ...], name: str, along: Sequence[str]
    ) -> list[xr.DataArray]:
        """Return a variable of a group, by its entries along the dimension of a statistic."""
        if (*path, name) not in self._arrays:
            array = unpack(read_group(self.view.tree, *path), name)
            assert array is not None, name
            found = array_entries(array.transpose(*along, ...)) if along else [array]
            self._arrays[*path, name] = found
        return self._arrays[*path, name]

    @property
    def reference_runs(self) -> int:
        """The number of runs of the reference."""
        return int(read_group(self.view.tree, STATISTICS_GROUP, self.reference).attrs[RUNS_SPENT])

    @property
    def reference_runs_used(self) -> int:
        """The number of completed runs of the reference, which all outputs share."""
        return int(self.entries[0].reference.attrs["runs_used"])


@dataclass(frozen=True)
class ComparedEntry:
    """One entry of a statistic of an output, of all methods.

    Parameters
    ----------
    comparison : MethodComparison
    output : str
    statistic : Statistic
        Of the catalogue.
    position : int
        Among the entries; 0 for a statistic with a single one.
    """

    comparison: MethodComparison
    output: str
    statistic: Statistic
    position: int

    def of(self, method: ComparedMethod, what: str) -> xr.DataArray:
        """Return the ``"error"`` of a method, its ``"coverage"`` or its ``"slope"``."""
        return self._archived(STATISTICS_GROUP, method.group, self.output, what=f"_{what}")

    def finding(self, what: str) -> xr.DataArray:
        """Return what is said of all methods: ``"verdict"``, say, along variant and budget."""
        return self._archived(COMPARISON_GROUP, self.output, what=f"_{what}")

    @property
    def reference(self) -> xr.DataArray:
        """The reference's estimate, as its analysis made it."""
        return self._archived(STATISTICS_GROUP, self.comparison.reference, self.output)

    def _archived(self, *path: str, what: str = "") -> xr.DataArray:
        name, along = f"{self.statistic.name}{what}", self.statistic.dims
        return self.comparison.entry_arrays(path, name, along)[self.position]

    @property
    def entry_name(self) -> str | float:
        """The coordinate that identifies it within its statistic; empty for a single one."""
        if not self.statistic.dims:
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

    @property
    def single_set_standings(self) -> list[tuple[str, float]]:
        """The methods that are level, and the lower bound of the lead, of single sets by budget."""
        levels, leads = self.finding("level"), self.finding("lead")
        return list(zip(levels.values[0].tolist(), leads.values[0, :, 1].tolist(), strict=True))

    @property
    def reference_text(self) -> str:
        """The reference's estimate in the unit that the study shows."""
        unit = self.display_units
        convert = conversion(self.statistic, scale(unit))
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
