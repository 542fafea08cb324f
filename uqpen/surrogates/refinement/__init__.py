"""Refinement: further runs of a surrogate's design, placed where they help the surrogate."""
