"""Notes on validated estimates; see `uqpen.statistics.texts`."""

from __future__ import annotations

# Of the runs that decide.
INSIDE = "inside the interval of {design}"
OUTSIDE = "outside the interval of {design}"
INSIDE_JOINTLY = "inside the intervals of {designs} at one joint level"
OUTSIDE_JOINTLY = "outside the interval of {designs} at the joint level of {count} designs"
INSIDE_BAND = "inside the simultaneous band of {design}"
OUTSIDE_BAND = (
    "outside the simultaneous band of {design} between probabilities {lowest:.3g} and {highest:.3g}"
)
INSIDE_BANDS = "inside the simultaneous bands of {designs} at one joint level"

# Why none decide.
NO_VALIDATION_RUNS = "no independent runs to compare with"
NO_VALIDATION_INTERVAL = "no independent runs give an interval for it"
NOT_REACHED = "no independent runs reach so far"
FAILED_RUNS_MISSING = "failed runs are missing from {designs}, but not from the surrogate"

# Of the estimate itself.
EXTRAPOLATED = "outside the training range of the surrogate"
VARIANCE_BEYOND = "{share:.0f} % of the variance is outside the training range of the surrogate"
SAMPLING_ERROR = "sampling of the surrogate alone: {lower:.2g} to {upper:.2g}"
