"""Fitted tails of an output: generalised Pareto distributions beyond a threshold."""
