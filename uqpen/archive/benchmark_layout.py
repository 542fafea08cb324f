"""Layout of the archives of benchmarks of methods.

The root holds three groups::

    /methods                         runs and replicates of each method at each budget
    /reference/<output>              the reference's statistics, packed as those of a study
    /benchmark/<output>              attributes: long_name, units, display_units of the output
    /benchmark/<output>/<statistic>  the variables of `BENCHMARK_VARIABLES`

A statistic has its name from the catalogue. Its own dimension, ``probability`` or ``threshold``,
follows the dimensions of a variable, and ``bound`` is the last. The writer, the check of an archive
and its readers use this description.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUND, BUDGET, METHOD_DIMENSION, REPEAT, VARIANT

__all__ = [
    "BENCHMARK_COORDINATES",
    "BENCHMARK_GROUP",
    "BENCHMARK_VARIABLES",
    "COMPARED_STATISTICS",
    "METHOD_VARIABLES",
    "ArchiveVariable",
]

BENCHMARK_GROUP = "benchmark"

# The entries of the catalogue by which methods are compared.
COMPARED_STATISTICS = ("mean", "std", "quantile", "exceedance")


@dataclass(frozen=True)
class ArchiveVariable:
    """One variable of a group.

    Parameters
    ----------
    name : str
        In the group.
    dims : tuple of str
        Its dimensions before those of a statistic.
    kind : str
        ``"number"``, ``"count"`` or ``"text"``.
    long_name : str
        A description, with ``{}`` for the statistic in words.
    has_bounds : bool
        True if it is an estimate with bounds.
    has_unit : bool
        True if it has the unit of the statistic; other numbers are dimensionless.
    """

    name: str
    dims: tuple[str, ...]
    kind: str
    long_name: str
    has_bounds: bool = False
    has_unit: bool = False

    def dims_of(self, statistic: str) -> tuple[str, ...]:
        """Return all dimensions of the variable of a statistic, an entry of the catalogue."""
        bounds = (BOUND,) if self.has_bounds else ()
        return (*self.dims, *CATALOGUE[statistic].dims, *bounds)


def _by_name(*variables: ArchiveVariable) -> Mapping[str, ArchiveVariable]:
    return MappingProxyType({each.name: each for each in variables})


_TRIALS = (METHOD_DIMENSION, BUDGET)
_CONTESTS = (VARIANT, BUDGET)

BENCHMARK_COORDINATES = _by_name(
    ArchiveVariable(METHOD_DIMENSION, (METHOD_DIMENSION,), "text", "method"),
    ArchiveVariable(VARIANT, (VARIANT,), "text", "how the points are taken"),
    ArchiveVariable(BUDGET, (BUDGET,), "count", "runs that a method may make"),
    ArchiveVariable(REPEAT, (REPEAT,), "count", "number of the repeat"),
)

METHOD_VARIABLES = _by_name(
    ArchiveVariable("runs", _TRIALS, "count", "runs that are made"),
    ArchiveVariable("replicates", _TRIALS, "count", "replicates"),
    ArchiveVariable("source", (METHOD_DIMENSION,), "text", "the study's name of the method"),
    ArchiveVariable("contests", (METHOD_DIMENSION,), "text", "variants that it stands for"),
)

BENCHMARK_VARIABLES = _by_name(
    ArchiveVariable("estimate", (*_TRIALS, REPEAT), "number", "{}", has_unit=True),
    ArchiveVariable(
        "error",
        _TRIALS,
        "number",
        "root mean square of the relative errors of the {}",
        has_bounds=True,
    ),
    ArchiveVariable(
        "coverage", _TRIALS, "number", "share of the intervals of the {} that held the reference"
    ),
    ArchiveVariable("scale", (), "number", "what errors of the {} are relative to", has_unit=True),
    ArchiveVariable(
        "slope",
        (METHOD_DIMENSION,),
        "number",
        "slope of log error of the {} over log runs",
        has_bounds=True,
    ),
    ArchiveVariable("winner", _CONTESTS, "text", "method with least error: {}"),
    ArchiveVariable("runner_up", _CONTESTS, "text", "next method: {}"),
    ArchiveVariable("level", _CONTESTS, "text", "level methods: {}"),
    ArchiveVariable("verdict", _CONTESTS, "text", "verdict: {}"),
    ArchiveVariable("remark", _CONTESTS, "text", "remark: {}"),
    ArchiveVariable(
        "lead",
        _CONTESTS,
        "number",
        "error of the next method over the least: {}",
        has_bounds=True,
    ),
)
