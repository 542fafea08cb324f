"""The words that label data: dimensions, groups, attributes and the statuses of a run.

Every name that stands in an archive stands here once, so that what writes it and what reads it
cannot drift apart.
"""

from __future__ import annotations

import re
from enum import IntEnum, StrEnum
from types import MappingProxyType

__all__ = [
    "BLOCK_NUMBER",
    "BOUND",
    "BOUNDS",
    "CDFS",
    "COMPARISON",
    "CONDITIONAL",
    "EXCEEDANCE",
    "HOLDS",
    "INPUT",
    "INTERVAL",
    "INTERVAL_LABEL",
    "INTERVAL_LEVEL",
    "LOST",
    "MATRIX",
    "MISSING",
    "MOMENTS",
    "NAME",
    "NOTE",
    "OTHER_INPUT",
    "POSITION",
    "QUADRATURE_WEIGHT",
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
    "SENSITIVITY",
    "SHARES",
    "STATISTICS",
    "STATUS",
    "STATUSES",
    "STATUS_TEXT",
    "SUFFIXES",
    "SURROGATES",
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
BLOCK_NUMBER = "block"
MATRIX = "matrix"
POSITION = "position"
QUADRATURE_WEIGHT = "quadrature_weight"
INPUT = "input"
OTHER_INPUT = "other_input"
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
SENSITIVITY = "sensitivity"
SURROGATES = "surrogates"
COMPARISON = "comparison"
TRAJECTORY = "trajectory"

# Names that the datasets of an archive use themselves.
RESERVED = frozenset(
    {
        RUN,
        BOUND,
        REPLICATE,
        ROUND,
        BLOCK_NUMBER,
        MATRIX,
        POSITION,
        QUADRATURE_WEIGHT,
        STATUS,
        LOST,
        REASON,
        RANK,
    }
)


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
    PICK_FREEZE = "pick-freeze"
    """Blocks of points that share coordinates; the first two matrices are stratified samples."""
    RULE = "integration rule"
    """Nodes with weights; no sample."""
    TRAJECTORIES = "trajectories"
    """Inputs moved one after the other from random starts; no sample."""
    STEPS = "steps"
    """Inputs moved one at a time from the nominal point; no sample."""

    @property
    def is_sample(self) -> bool:
        """Whether its points, or some of them, are a sample of the input law."""
        return self not in (Sampling.RULE, Sampling.TRAJECTORIES, Sampling.STEPS)
