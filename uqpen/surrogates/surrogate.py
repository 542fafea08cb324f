"""Interface of a surrogate: the settings of a fit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

from uqpen.core.errors import ModelError, Problem
from uqpen.core.model import Model
from uqpen.core.settings import setting, validate
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

if TYPE_CHECKING:
    import xarray as xr

# The truncation then leaves at most 1 % of the standard deviation.
DEFAULT_COMPONENTS = 0.9999


def components_setting() -> Any:
    """Declare how many components to keep: a share of the variance, or their number."""
    expected = "a share of the variance between 0 and 1, or a whole number of components"

    def accepts(value: Any) -> bool:
        if isinstance(value, float):
            return 0 < value < 1
        return isinstance(value, int) and not isinstance(value, bool) and value >= 1

    return setting("components", expected, accepts, default=DEFAULT_COMPONENTS)


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

    def check_repeats(self, repeats: int) -> Iterator[Problem]:
        """Yield the problems of fitting it to points with a number of runs each."""
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


# Stand-in for a user-defined surrogate whose code is not executed.


@dataclass(frozen=True)
class UnloadedSurrogate(Surrogate):
    """Surrogate known by its name only: a reference, or an object of a program."""

    name: str  # the reference or the object that the study names
    design: str = ""  # the design whose runs it was fitted to; empty if the study does not name it
    check: str | None = None  # A design whose runs show how good it is
    is_object: bool = False  # whether it is an object of a program

    @property
    def absence(self) -> str:
        """Reason why it cannot be fitted here."""
        if self.is_object:
            return f"{self.name} is an object of the Python program that made the archive"
        return f"it follows from code that the archive names ({self.name})"

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> NoReturn:
        """Refuse to fit."""
        raise ModelError(f"{self.name} is not loaded: it fits nothing without --trust")

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> NoReturn:
        """Refuse to restore a surrogate."""
        raise ModelError(f"{name} is not loaded: it predicts nothing without --trust")
