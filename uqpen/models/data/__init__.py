"""Runs of a model that is not here: the inputs and outputs of a file, in place of calls."""
