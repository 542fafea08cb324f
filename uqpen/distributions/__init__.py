"""Random inputs: distributions with units, their joint distribution, and constraints on it."""
