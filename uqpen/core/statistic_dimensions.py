"""Names of the dimensions that entries of statistics lie along."""

from __future__ import annotations

__all__ = [
    "BAND_CONTENT",
    "CATEGORY",
    "CONTENT_LEVEL",
    "CURVE",
    "DESIGN_POINT",
    "EVENT",
    "INTERVAL_CONTENT",
    "LOWER_CONTENT",
    "LOWER_THRESHOLD",
    "PERCENT",
    "PROBABILITY",
    "RETURN_PERIOD",
    "RUNS_SO_FAR",
    "SENSITIVITY_EVENT",
    "SHORTFALL_LEVEL",
    "THRESHOLD",
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
