"""External program as a model: one process for each run, in a folder of its own."""
