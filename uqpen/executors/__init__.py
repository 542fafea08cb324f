"""Where batches of runs are made: each executor is a context that yields a map."""
