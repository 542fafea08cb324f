"""The distribution function of an output: quantiles, probabilities, tolerance limits."""
