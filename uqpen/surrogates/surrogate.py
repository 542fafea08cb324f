"""Interface of a surrogate: the settings of a fit, and the fitted model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import ClassVar, Self

import xarray as xr

from uqpen.core.errors import Problem
from uqpen.core.model import Model
from uqpen.core.settings import validate
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.expansion import Expansion

__all__ = ["FittedSurrogate", "Surrogate"]


class FittedSurrogate(Model):
    """Model that approximates another one near the runs that it was fitted to.

    Its inputs and conditions are those of the original model. Its outputs are those that could be
    fitted; `reasons` explains the others.

    Attributes
    ----------
    expansions : mapping of str to Expansion
        One for each of its outputs.
    reasons : mapping of str to str
        The reason why each missing output could not be fitted.
    fixed : mapping of str to float
        The values that the inputs without a distribution had in all training runs.
    """

    expansions: Mapping[str, Expansion]
    reasons: Mapping[str, str]
    fixed: Mapping[str, float]

    @property
    @abstractmethod
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""

    @abstractmethod
    def with_check(self, runs: xr.Dataset) -> FittedSurrogate:
        """Return a copy with its prediction errors at runs that it was not fitted to."""

    @abstractmethod
    def closed_form_problem(self, output: str) -> str:
        """Return why moments and indices cannot follow from the coefficients; empty if they can."""

    def has_closed_form(self, output: str) -> bool:
        """Check that moments and indices of an output follow from the coefficients."""
        return not self.closed_form_problem(output)

    @abstractmethod
    def to_tree(self) -> xr.DataTree:
        """Return the group of an archive: enough to evaluate it, and the errors of the fit.

        Its attribute ``kind`` is the key of `SURROGATES`. It has no variables, but a group for each
        output, with the diagnostics of the fit as attributes, or the reason why there is none.
        Other groups in it have reserved names.
        """

    @classmethod
    @abstractmethod
    def from_tree(cls, tree: xr.DataTree, name: str, original: Model | None) -> Self:
        """Restore it from `to_tree`; see `restore_surrogate`."""


class Surrogate(ABC):
    """Frozen settings of the fit of a surrogate.

    Attributes
    ----------
    design : str
        The name of the design whose runs it is fitted to.
    check : str or None
        The name of another design, whose runs show how good it is.
    transform : mapping of str to str
        By output, the function of it that is fitted in its place.
    fitted_class : type
        The class of the fitted surrogate.
    """

    fitted_class: ClassVar[type[FittedSurrogate]]
    design: str
    check: str | None
    transform: Mapping[str, str]

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between settings that are valid by themselves."""
        yield from ()

    @property
    @abstractmethod
    def needs_quadrature(self) -> bool:
        """True if its design must be an integration rule."""

    @abstractmethod
    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> FittedSurrogate:
        """Fit it to the runs of its design; an output that cannot be fitted has a reason instead.

        Parameters
        ----------
        name : str
            Its name in the study.
        runs : Dataset
            The result of `uqpen.execution.evaluate` for the design.
        model, joint
            The model that made the runs, and the distribution of its inputs.
        stream : Stream
            Source of the random numbers of refits.
        """
