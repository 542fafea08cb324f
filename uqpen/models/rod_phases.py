"""How the erosion of a rod ended, for its integration and the compiled part of that."""

__all__ = ["AT_REST", "CAUGHT_UP", "GAVE_UP"]

# v = u, u = 0, or neither within the steps allowed.
CAUGHT_UP, AT_REST, GAVE_UP = 0.0, 1.0, -1.0
