"""The methods of a benchmark, as figures and the report show them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import xarray as xr

from uqpen.archive.benchmark_structure import find_benchmark_faults
from uqpen.archive.read import read_group
from uqpen.archive.structure import find_level_faults
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import BUDGET, METHODS
from uqpen.results.source_style import source_slots

__all__ = ["ArchivedMethod", "benchmark_budgets", "benchmark_methods", "check_benchmark"]


@dataclass(frozen=True)
class ArchivedMethod:
    """A method of a benchmark.

    Parameters
    ----------
    position : int
        Its position along the dimension of the methods.
    source : str
        The name of its design or surrogate in the study.
    variants : tuple of str
        The comparisons that it is in: of single sets of points, of replicated sets, or both.
    series : int
        Number of its colour and marker; the same for a design as one set and in replicates.
    """

    position: int
    source: str
    variants: tuple[str, ...]
    series: int


def check_benchmark(tree: xr.DataTree) -> None:
    """Check that the archive of a benchmark of methods has what figures and the report need.

    Raises
    ------
    ArchiveError
        If it lacks anything.
    """
    if fault := next(chain(find_benchmark_faults(tree), find_level_faults(tree)), None):
        raise ArchiveError(f"the archive is damaged: {fault}")


def benchmark_methods(tree: xr.DataTree, variant: str) -> list[ArchivedMethod]:
    """Return the methods of one of the comparisons, in the order of the archive."""
    methods = read_group(tree, METHODS)
    sources = [str(source) for source in methods["source"].values]
    slots = source_slots(str(tree.attrs.get("study_text", "")), sources)
    every = [
        ArchivedMethod(position, source, tuple(str(variants).split()), slots[source])
        for position, (source, variants) in enumerate(
            zip(sources, methods["contests"].values, strict=True)
        )
    ]
    return [method for method in every if variant in method.variants]


def benchmark_budgets(tree: xr.DataTree) -> list[int]:
    """Return the numbers of runs that the methods are given."""
    return [int(budget) for budget in read_group(tree, METHODS)[BUDGET].values]
