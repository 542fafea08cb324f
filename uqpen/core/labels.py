"""The words that label data: dimensions, groups, attributes and the statuses of a run.

Every name that stands in an archive stands here once, so that what writes it and what reads it
cannot drift apart.
"""

from __future__ import annotations

import re
from enum import IntEnum, StrEnum
from types import MappingProxyType

__all__ = [
    "BENCHMARK",
    "BLOCK_NUMBER",
    "BOUND",
    "BOUNDS",
    "BUDGET",
    "CDFS",
    "CHECKED",
    "COMPARISON",
    "CONDITIONAL",
    "CONTENT",
    "DEPENDENCE",
    "DIFFERENCES",
    "ENTRIES",
    "ERRORS",
    "ESTIMATES",
    "ESTIMATOR",
    "EXCEEDANCE",
    "FAILED_RUN",
    "FAILURE_REASON",
    "INPUT",
    "INTERVAL",
    "INTERVAL_LABEL",
    "INTERVAL_LEVEL",
    "KIND",
    "LARGEST_CONTRIBUTION",
    "MATRIX",
    "METHODS",
    "METHOD_DIMENSION",
    "MISSING",
    "MODELS",
    "MOMENTS",
    "MOVED_BY",
    "MOVED_INPUT",
    "MOVED_UNCERTAINTY",
    "NAME",
    "NOTE",
    "OPTIMIZED_BY",
    "PAIR",
    "POSITION",
    "QUADRATURE_WEIGHT",
    "QUANTILES",
    "RANK",
    "REFERENCE",
    "REFUSED",
    "RELATIVE_TO_SPREAD",
    "REPEAT",
    "REPLICATE",
    "REPLICATED",
    "RESERVED",
    "ROLE",
    "ROUND",
    "RUN",
    "RUNS",
    "RUNS_SPENT",
    "SAMPLING",
    "SENSITIVITY",
    "SHARES",
    "SINGLE",
    "SLOPES",
    "SOURCE",
    "STATISTICS",
    "STATUS",
    "STATUSES",
    "STATUS_TEXT",
    "SUFFIXES",
    "SURROGATES",
    "TOLERANCE_LIMITS",
    "TRAJECTORY",
    "UNCHECKED",
    "VARIANT",
    "VERDICTS",
    "Sampling",
    "Status",
]

# What a user may call a design, an input or an output: it becomes a NetCDF group or variable,
# a key of JSON, the name of a folder and, for an input, a keyword argument.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}\Z")

RUN = "run"
BOUND = "bound"
BOUNDS = ("estimate", "lower", "upper")
REPLICATE = "replicate"
ROUND = "round"
BLOCK_NUMBER = "block"
MATRIX = "matrix"
POSITION = "position"
MOVED_INPUT = "moved_input"
MOVED_BY = "moved_by"
MOVED_UNCERTAINTY = "moved_uncertainty"
QUADRATURE_WEIGHT = "quadrature_weight"
INPUT = "input"
SOURCE = "source"
PAIR = "pair"
STATUS = "status"
FAILED_RUN = "lost_run"
FAILURE_REASON = "lost_reason"
RANK = "rank"

# The moments of an output, as the names of its variables end.
STATISTICS = ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs")

# Sobol' indices and Shapley effects of an output, likewise.
_SHARES_OF_VARIANCE = ("first_order", "total_order", "shapley")
_INDICES = (
    *_SHARES_OF_VARIANCE,
    "second_order",
    *(f"{of}_{share}" for of in ("log", "exceedance", "category") for share in _SHARES_OF_VARIANCE),
)

# How an output goes along with each input over a sample, likewise.
_ASSOCIATIONS = ("pearson", "spearman", "partial", "partial_rank", "delta")

# What is told of each input's elementary effects, and of its steps from the nominal point.
_EFFECTS = ("mu", "mu_star", "sigma")
_RESPONSES = ("response", "contribution")

# What an estimate says of its own interval: attributes of a single one, coordinates along several.
INTERVAL = "interval"
INTERVAL_LABEL = "interval_label"
INTERVAL_LEVEL = "interval_level"
NOTE = "note"

# Of a surrogate's figure that independent runs bear out, contradict, or cannot check.
CHECKED = "checked"
REFUSED = "refused"
UNCHECKED = "unchecked"

RUNS = "runs"
MOMENTS = "moments"
QUANTILES = "quantiles"
TOLERANCE_LIMITS = "holds"
EXCEEDANCE = "exceedance"
CDFS = "cdfs"
SHARES = "shares"
STATUSES = "statuses"
SENSITIVITY = "sensitivity"
SURROGATES = "surrogates"
COMPARISON = "comparison"
TRAJECTORY = "trajectory"

# What the names of an output's statistics and of their coordinates end in.
SUFFIXES = frozenset(
    {
        *STATISTICS,
        "band",
        # The indices of an output's logarithm must not be taken for those of another output.
        "log",
        EXCEEDANCE,
        *(
            f"{dimension}{coordinate}"
            for dimension in ("probability", "threshold", "hold", "category", *_INDICES)
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
        *(
            f"{figure}{coordinate}"
            for figure in (*_EFFECTS, *_RESPONSES, *_ASSOCIATIONS)
            for coordinate in ("", f"_{INTERVAL}", f"_{INTERVAL_LABEL}", f"_{NOTE}")
        ),
    }
)

# Attributes that an analysis or a reader goes by.
ROLE = "role"
SAMPLING = "sampling"
CONDITIONAL = "conditional_on"
MISSING = "missing"
RUNS_SPENT = "runs_spent"
ESTIMATOR = "estimator"
LARGEST_CONTRIBUTION = "largest_contribution"
DEPENDENCE = "dependence"
# The criterion by which points were moved apart.
OPTIMIZED_BY = "points_optimized_by"
# Moved inputs whose nominal value is 0, so that no step is relative to it.
RELATIVE_TO_SPREAD = "relative_to_half_spread"

# What kind of archive it is, at its root; those of studies do not say.
KIND = "uqpen_kind"
BENCHMARK = "head-to-head"

# The hashes of its groups, at its root.
CONTENT = "content_sha256"

# An archive of methods head to head: its groups, and what its figures lie along.
METHODS = "methods"
ESTIMATES = "estimates"
REFERENCE = "reference"
ERRORS = "errors"
SLOPES = "slopes"
VERDICTS = "verdicts"
# Not "method", which is a keyword of xarray's where entries are chosen by name.
METHOD_DIMENSION = "contestant"
VARIANT = "variant"
BUDGET = "budget"
REPEAT = "repeat"

# How the points of a design are taken: as one set, or as replicates whose scatter tells the error.
SINGLE = "single"
REPLICATED = "replicated"

# What the entries of a statistic lie along there, of which there may be several.
ENTRIES = MappingProxyType({"quantile": "probability", EXCEEDANCE: "threshold"})
MODELS = "models"
DIFFERENCES = "differences"

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
        MOVED_INPUT,
        MOVED_BY,
        MOVED_UNCERTAINTY,
        QUADRATURE_WEIGHT,
        INPUT,
        STATUS,
        FAILED_RUN,
        FAILURE_REASON,
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
    USER_SUPPLIED = "given"
    """Points of the user's own, about which nothing more is known."""
    PICK_FREEZE = "pick-freeze"
    """Blocks of points that share coordinates; the first two matrices are stratified samples."""
    QUADRATURE = "integration rule"
    """Nodes with weights; no sample."""
    TRAJECTORIES = "trajectories"
    """Inputs moved one after the other from random starts; no sample."""
    ONE_AT_A_TIME = "steps"
    """Inputs moved one at a time from the nominal point; no sample."""

    @property
    def is_sample(self) -> bool:
        """Whether its points, or some of them, are a sample of the input law."""
        return self not in (Sampling.QUADRATURE, Sampling.TRAJECTORIES, Sampling.ONE_AT_A_TIME)
