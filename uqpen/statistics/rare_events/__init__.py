"""Estimates of the probability of a rare event, from replicates of a method made for it."""
