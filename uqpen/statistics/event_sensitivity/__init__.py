"""Sensitivities of the probability of an event to the distributions of the inputs."""
