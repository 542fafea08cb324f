"""What a design is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator
from typing import ClassVar

import xarray as xr

from uqpen.core.errors import Problem
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import Sampling
from uqpen.core.settings import validate
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["Design", "Rounds"]

Rounds = Generator[xr.Dataset, xr.Dataset, None]


class Design(ABC):
    """Frozen settings that say which runs to make."""

    assumes_independence: ClassVar[bool] = False
    """Whether what it is made for has a meaning only where the inputs are independent."""

    independence_reason: ClassVar[str] = (
        "its indices split the variance among inputs that vary independently"
    )
    """Why, for whoever asks for it where they are not."""

    @property
    @abstractmethod
    def sampling(self) -> Sampling:
        """How its points relate to each other, which decides the error bars of estimates."""

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """What is wrong between settings that are right by themselves."""
        yield from ()

    @abstractmethod
    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        """Points to run, round by round.

        A plain design yields once. One that adapts is sent each round's runs and yields the next.

        Parameters
        ----------
        joint : JointDistribution
            The inputs of the study.
        stream : Stream
            Where the design's random numbers come from.

        Yields
        ------
        Dataset
            A variable for each input (SI values; along ``run``, or a scalar), and as coordinates
            whatever an analysis needs to know of a run.
        """

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        """What is wrong between its settings and the inputs of a study."""
        yield from ()

    def samples_inputs(self, joint: JointDistribution) -> bool:
        """Whether its points, or some of them, are a sample of the very law of a study."""
        return self.sampling.is_sample

    @abstractmethod
    def run_count(self, joint: JointDistribution) -> int:
        """How many runs it makes, or will at most."""

    def files(self) -> tuple[FileSnapshot, ...]:
        """The files that its points come from, as they stood when they were read."""
        return ()

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> Design | None:
        """The same design with another number of runs, for a comparison at equal budgets.

        Parameters
        ----------
        joint : JointDistribution
            The inputs of the study.
        runs : int
            How many it may make; it makes as many of them as it can.
        replicated : bool
            In about as many replicates as this one has; otherwise as one set of points.

        Returns
        -------
        Design or None
            None where it has no scale, cannot do with so few runs, or has no replicates.
        """
        return None
