"""Learning of a limit state by Gaussian processes, and its correction by weighted runs."""
