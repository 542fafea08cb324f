"""Relation between the points of a design."""

from __future__ import annotations

from enum import StrEnum


class Sampling(StrEnum):
    """Relation between the points of a design; it determines the error bars."""

    INDEPENDENT = "independent"
    """Each point is drawn by itself."""
    STRATIFIED = "stratified"
    """The points of a replicate are spread over strata, so they avoid each other."""
    GIVEN = "given"
    """Points that a study gives, about which nothing more is known."""
    PICK_FREEZE = "pick-freeze"
    """Blocks of points that share coordinates; the first two matrices are stratified samples."""
    QUADRATURE = "integration rule"
    """Nodes with weights; no sample."""
    TRAJECTORIES = "trajectories"
    """Inputs moved one after the other from random starts; no sample."""
    ONE_AT_A_TIME = "steps"
    """Inputs moved one at a time from the nominal point; no sample."""

    TOWARDS_EVENT = "towards an event"
    """Replicates of points that move towards a rare event, for its probability; no sample."""
    TOWARDS_BOUNDS = "towards bounds"
    """Points over random inputs and intervals, then at the bounds that a search found; no sample.
    """
    AT_EXPERIMENTS = "at experiments"
    """Each draw with the conditions of every measured experiment; no sample of the inputs."""
    TOWARDS_MEASUREMENTS = "towards measurements"
    """Points that move towards the values with which a model fits measurements; no sample."""
    POSTERIOR = "towards a posterior"
    """Draws of the prior, and particles that move from there to the posterior; no sample."""
    WEIGHTED_POSTERIOR = "towards a weighted posterior"
    """Draws of the prior, then of posteriors by surrogates, weighted at last; no sample."""
    SEARCH_CURVES = "search curves"
    """Curves through the inputs' space, along which each input has a frequency; no sample."""
    FINITE_DIFFERENCES = "finite differences"
    """Points, each with a small step of every input; no sample."""
    TWO_LEVELS = "two levels"
    """Two levels of each input; no sample."""

    OVER_BOX = "over a box of parameters"
    """Independent points of a mixture of all distributions of a box; no sample of one of them."""

    @property
    def is_sample(self) -> bool:
        """True if the points, or some of them, are a sample of the joint distribution."""
        return self in (
            Sampling.INDEPENDENT,
            Sampling.STRATIFIED,
            Sampling.GIVEN,
            Sampling.PICK_FREEZE,
        )
