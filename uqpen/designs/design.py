"""What a design is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator

import xarray as xr

from uqpen.errors import Problem
from uqpen.inputs.law import InputLaw
from uqpen.labels import Sampling
from uqpen.settings import validate
from uqpen.streams import Stream

__all__ = ["Design", "Rounds"]

Rounds = Generator[xr.Dataset, xr.Dataset, None]


class Design(ABC):
    """Frozen settings that say which runs to make."""

    @property
    @abstractmethod
    def sampling(self) -> Sampling:
        """How its points relate to each other, which decides the error bars of estimates."""

    def __post_init__(self) -> None:
        validate(self, self.disorder())

    def disorder(self) -> Iterator[Problem]:
        """What is wrong between settings that are right by themselves."""
        yield from ()

    @abstractmethod
    def rounds(self, law: InputLaw, stream: Stream) -> Rounds:
        """Points to run, round by round.

        A plain design yields once. One that adapts is sent each round's runs and yields the next.

        Parameters
        ----------
        law : InputLaw
            The inputs of the study.
        stream : Stream
            Where the design's random numbers come from.

        Yields
        ------
        Dataset
            A variable for each input (SI values; along ``run``, or a scalar), and as coordinates
            whatever an analysis needs to know of a run.
        """

    @abstractmethod
    def size(self, law: InputLaw) -> int:
        """How many runs it makes, or will at most."""
