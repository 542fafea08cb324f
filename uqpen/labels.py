"""The words that label data: dimensions, groups, attributes and the statuses of a run.

Every name that stands in an archive stands here once, so that what writes it and what reads it
cannot drift apart.
"""

from __future__ import annotations

import re
from enum import IntEnum, StrEnum
from types import MappingProxyType

__all__ = [
    "BOUND",
    "BOUNDS",
    "CDFS",
    "CONDITIONAL",
    "EXCEEDANCE",
    "HOLDS",
    "INTERVAL",
    "INTERVAL_LABEL",
    "INTERVAL_LEVEL",
    "LOST",
    "MISSING",
    "MOMENTS",
    "NAME",
    "NOTE",
    "QUANTILES",
    "RANK",
    "REASON",
    "REPLICATE",
    "RESERVED",
    "ROLE",
    "ROUND",
    "RUN",
    "RUNS",
    "SAMPLING",
    "SHARES",
    "STATISTICS",
    "STATUS",
    "STATUSES",
    "STATUS_TEXT",
    "SUFFIXES",
    "TRAJECTORY",
    "Sampling",
    "Status",
]

# What a user may call a design, an input or an output: it becomes a NetCDF group or variable,
# a key of JSON and, for an input, a keyword argument.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")

RUN = "run"
BOUND = "bound"
BOUNDS = ("estimate", "lower", "upper")
REPLICATE = "replicate"
ROUND = "round"
STATUS = "status"
LOST = "lost_run"
REASON = "lost_reason"
RANK = "rank"

# The moments of an output, as the names of its variables end.
STATISTICS = ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs")

# What an estimate says of its own interval: attributes of a single one, coordinates along several.
INTERVAL = "interval"
INTERVAL_LABEL = "interval_label"
INTERVAL_LEVEL = "interval_level"
NOTE = "note"

# What the names of an output's statistics and of their coordinates end in.
SUFFIXES = frozenset(
    {
        *STATISTICS,
        "band",
        *(
            f"{dimension}{coordinate}"
            for dimension in ("probability", "threshold", "hold", "category")
            for coordinate in (
                "",
                f"_{INTERVAL}",
                f"_{INTERVAL_LABEL}",
                f"_{NOTE}",
                "_value",
                "_runs_needed",
                "_label",
            )
        ),
    }
)

# Attributes that an analysis or a reader goes by.
ROLE = "role"
SAMPLING = "sampling"
CONDITIONAL = "conditional_on"
MISSING = "missing"

RUNS = "runs"
MOMENTS = "moments"
QUANTILES = "quantiles"
HOLDS = "holds"
EXCEEDANCE = "exceedance"
CDFS = "cdfs"
SHARES = "shares"
STATUSES = "statuses"
TRAJECTORY = "trajectory"

# Names that the datasets of an archive use themselves.
RESERVED = frozenset({RUN, BOUND, REPLICATE, ROUND, STATUS, LOST, REASON, RANK})


class Status(IntEnum):
    """What became of a run; everything but `OK` is a lost run, kept as data."""

    OK = 0
    INADMISSIBLE = 1
    FAILED = 2
    NOT_FINITE = 3
    TIMED_OUT = 4
    CRASHED = 5

    @property
    def meaning(self) -> str:
        """The status in one word, as in ``flag_meanings`` and in JSON."""
        return self.name.lower()


STATUS_TEXT = MappingProxyType(
    {
        Status.OK: "ok",
        Status.INADMISSIBLE: "inadmissible",
        Status.FAILED: "failed",
        Status.NOT_FINITE: "not finite",
        Status.TIMED_OUT: "timed out",
        Status.CRASHED: "crashed",
    }
)


class Sampling(StrEnum):
    """How the points of a design relate to each other, which decides its error bars."""

    INDEPENDENT = "independent"
    """Each point is drawn by itself."""
    STRATIFIED = "stratified"
    """The points of a replicate are spread over strata, so they avoid each other."""
    GIVEN = "given"
    """Points of the user's own, about which nothing more is known."""
