"""What a surrogate is: settings that say how to fit one, and the model that comes of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping

import xarray as xr

from uqpen.core.errors import Problem
from uqpen.core.model import Model
from uqpen.core.settings import validate
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.expansion import Expansion

__all__ = ["FittedSurrogate", "Surrogate"]


class FittedSurrogate(Model):
    """A model that stands for another, near the runs that it was fitted to.

    Its inputs and conditions are the other's, its outputs those that could be fitted: what they
    are without, `reasons` tells.

    Attributes
    ----------
    expansions : mapping of str to Expansion
        One for each of its outputs.
    reasons : mapping of str to str
        Why each output that is missing could not be fitted.
    """

    expansions: Mapping[str, Expansion]
    reasons: Mapping[str, str]

    @abstractmethod
    def with_check(self, runs: xr.Dataset) -> FittedSurrogate:
        """The same, and how well it meets runs that it was not fitted to."""

    @abstractmethod
    def closed_form_problem(self, output: str) -> str:
        """Why moments and indices from the coefficients are not the output's; empty if they are."""

    def has_closed_form(self, output: str) -> bool:
        """Whether moments and indices of an output follow from the coefficients."""
        return not self.closed_form_problem(output)

    @abstractmethod
    def to_dataset(self) -> xr.Dataset:
        """All that evaluation needs, and what is known of the fit."""


class Surrogate(ABC):
    """Frozen settings that say how to fit a surrogate.

    Attributes
    ----------
    design : str
        The name of the design whose runs it is fitted to.
    check : str or None
        The name of another design, whose runs show how good it is.
    transform : mapping of str to str
        By output, the function of it that is fitted in its place.
    """

    design: str
    check: str | None
    transform: Mapping[str, str]

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """What is wrong between settings that are right by themselves."""
        yield from ()

    @property
    @abstractmethod
    def needs_quadrature(self) -> bool:
        """Whether its design must be an integration rule."""

    @abstractmethod
    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> FittedSurrogate:
        """Fit it to the runs of its design.

        Parameters
        ----------
        name : str
            What it will be called.
        runs : Dataset
            What `uqpen.execution.evaluate` returned for the design.
        model : Model
            That made the runs.
        joint : JointDistribution
            Of its inputs.
        stream : Stream
            Where the random numbers of refits come from.

        Returns
        -------
        FittedSurrogate
            Always: an output that cannot be fitted has a reason in its place.
        """
