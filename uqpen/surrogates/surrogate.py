"""Interface of a surrogate: the settings of a fit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from uqpen.core.errors import Problem
from uqpen.core.model import Model
from uqpen.core.settings import validate
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.surrogates.principal_components import DEFAULT_COMPONENTS

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Surrogate"]


class Surrogate(ABC):
    """Frozen settings of the fit of a surrogate.

    Attributes
    ----------
    design : str
        The name of the design whose runs it is fitted to.
    check : str or None
        The name of another design, whose runs show how good it is.
    transform : mapping of str to str
        By output, the function of it that is fitted in its place; empty by default.
    components : float or int
        How many principal components of a field are kept: the share of the variance that they
        have at least, or their number.
    """

    design: str
    check: str | None
    transform: Mapping[str, str] = MappingProxyType({})
    components: float = DEFAULT_COMPONENTS

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between settings that are valid by themselves."""
        yield from ()

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        """Yield the problems of fitting it in these inputs."""
        yield from ()

    @property
    def needs_quadrature(self) -> bool:
        """True if its design must be an integration rule."""
        return False

    @property
    def absence(self) -> str:
        """Reason why it cannot be fitted here, such as a missing package; empty if it can."""
        return ""

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

    def for_refits(self, fitted: FittedSurrogate) -> Surrogate:
        """Return the settings for fits to parts of the same runs, as cross-fitting makes them.

        They are these settings. A kind may return others that spare a search which `fitted` has
        done already, such as one among truncations.

        Parameters
        ----------
        fitted : FittedSurrogate
            The fit to all runs; of a model with fields that of the scores.
        """
        return self

    @classmethod
    @abstractmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> FittedSurrogate:
        """Restore a surrogate of this kind from the group of an archive.

        Parameters
        ----------
        tree : DataTree
            The result of `FittedSurrogate.to_tree`, or the group read from an archive.
        name : str
            Its name in the study.
        original : Model or None
            The original model, if it is known.
        """
