"""Moments of an output: from samples and from quadrature rules."""
