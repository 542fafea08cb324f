"""Numbers that the integration of eroding rods and its compiled part share."""

__all__ = ["AT_REST", "BUFFER", "CAUGHT_UP", "GAVE_UP", "LANES"]

# How erosion ended: v = u, u = 0, or not within the steps allowed.
CAUGHT_UP, AT_REST, GAVE_UP = 0.0, 1.0, -1.0

# Runs that are integrated together.
LANES = 16

# Numbers in the memory of the lanes.
BUFFER = 20 * LANES
