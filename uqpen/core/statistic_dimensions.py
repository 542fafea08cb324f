"""Dimensions of statistics: their names, and the labels along them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from uqpen.core.labels import (
    BOUNDS,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    NOTE,
    PAIR,
    RANK,
    RESERVED,
    STATUS,
)

__all__ = [
    "BAND_CONTENT",
    "CATEGORY",
    "CONTENT_LEVEL",
    "CURVE",
    "DESIGN_POINT",
    "DIMENSIONS",
    "EVENT",
    "INTERVAL_CONTENT",
    "LOWER_CONTENT",
    "LOWER_THRESHOLD",
    "NAMES_IN_USE",
    "PERCENT",
    "PROBABILITY",
    "REQUESTED_DIMENSIONS",
    "RETURN_PERIOD",
    "RUNS_SO_FAR",
    "SENSITIVITY_EVENT",
    "SHORTFALL_LEVEL",
    "TABLE_COLUMNS",
    "THRESHOLD",
    "UNLISTED_DIMENSIONS",
    "DimensionLabels",
]

PROBABILITY = "probability"
# The share of the distribution that an upper tolerance limit covers, a lower one, an interval.
CONTENT_LEVEL = "content"
LOWER_CONTENT = "lower_content"
INTERVAL_CONTENT = "interval_content"
# The share of all curves that a tolerance band holds.
BAND_CONTENT = "band_content"
# The probability below the quantile that an expected shortfall lies beyond.
SHORTFALL_LEVEL = "shortfall_level"
# The number of cases in which a return level is exceeded once on average.
RETURN_PERIOD = "return_period"
THRESHOLD = "threshold"
# A threshold to lie below; the thresholds to exceed may be others.
LOWER_THRESHOLD = "lower_threshold"
CATEGORY = "category"
# An event of several outputs.
EVENT = "event"
# An event whose sensitivities to the inputs' distributions a study requests.
SENSITIVITY_EVENT = "sensitivity_event"
# A design point of a rare event, by its number; the nearest to the median comes first.
DESIGN_POINT = "design_point"
PERCENT = "percent"
RUNS_SO_FAR = "runs_so_far"
# A curve or field of a run, by the number of the run.
CURVE = "curve"

# Tables and lists leave out what lies along these, unless it is asked for.
UNLISTED_DIMENSIONS = frozenset({RANK, PERCENT, RUNS_SO_FAR, CURVE})


@dataclass(frozen=True)
class DimensionLabels:
    """Labels along a dimension of statistics: their kind, ``"number"`` or ``"text"``.

    Its companions are further coordinates along it, each of kind ``"number"``, ``"count"`` or
    ``"text"``. The optional ones exist only where a study asks for them.
    """

    kind: str
    companions: Mapping[str, str] = field(default_factory=dict)
    optional: Mapping[str, str] = field(default_factory=dict)


DIMENSIONS: Mapping[str, DimensionLabels] = MappingProxyType(
    {
        PROBABILITY: DimensionLabels("number"),
        CONTENT_LEVEL: DimensionLabels("number", {"content_runs_needed": "count"}),
        LOWER_CONTENT: DimensionLabels("number", {"lower_content_runs_needed": "count"}),
        INTERVAL_CONTENT: DimensionLabels("number", {"interval_content_runs_needed": "count"}),
        BAND_CONTENT: DimensionLabels("number", {"band_content_runs_needed": "count"}),
        SHORTFALL_LEVEL: DimensionLabels("number"),
        RETURN_PERIOD: DimensionLabels("number"),
        **{
            name: DimensionLabels(
                "text",
                {f"{name}_value": "number"},
                {f"{name}_at_most": "number", f"{name}_at_least": "number"},
            )
            for name in (THRESHOLD, LOWER_THRESHOLD)
        },
        CATEGORY: DimensionLabels("text", {"category_label": "text"}),
        EVENT: DimensionLabels(
            "text",
            {"event_condition": "text"},
            {"event_at_most": "number", "event_at_least": "number"},
        ),
        SENSITIVITY_EVENT: DimensionLabels("text"),
        DESIGN_POINT: DimensionLabels("count", {"design_point_run": "count"}),
        RANK: DimensionLabels("number"),
        PERCENT: DimensionLabels("number"),
        RUNS_SO_FAR: DimensionLabels("count"),
        CURVE: DimensionLabels("count"),
        INPUT: DimensionLabels("text"),
        PAIR: DimensionLabels("text", {"pair_first": "text", "pair_second": "text"}),
        STATUS: DimensionLabels("text"),
    }
)

# The study requests the entries along these, the same for all sources of an output: tables show
# them side by side.
REQUESTED_DIMENSIONS = (
    PROBABILITY,
    CONTENT_LEVEL,
    LOWER_CONTENT,
    INTERVAL_CONTENT,
    BAND_CONTENT,
    SHORTFALL_LEVEL,
    RETURN_PERIOD,
    THRESHOLD,
    LOWER_THRESHOLD,
    CATEGORY,
)

# Columns of the long table of estimates; each dimension is a further one.
TABLE_COLUMNS = (
    "model", "source", "kind", "output", "statistic", "coordinates", "unit", *BOUNDS,
)  # fmt: skip

# Names that the datasets of an archive and its long table use themselves.
NAMES_IN_USE = RESERVED.union(
    TABLE_COLUMNS,
    (INTERVAL, INTERVAL_LABEL, NOTE),
    DIMENSIONS,
    *(labels.companions for labels in DIMENSIONS.values()),
    *(labels.optional for labels in DIMENSIONS.values()),
)
