"""Sensitivity of an output to the inputs: Sobol' indices, correlations, effects, responses."""
