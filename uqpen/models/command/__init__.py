"""A program from outside as a model: one process a run, in a folder of its own."""
