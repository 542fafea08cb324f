"""Stand-in for a user-defined surrogate whose code is not executed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from uqpen.core.errors import ModelError
from uqpen.core.model import Model
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.surrogate import Surrogate

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["UnloadedSurrogate"]


@dataclass(frozen=True)
class UnloadedSurrogate(Surrogate):
    """Surrogate known by its name only: a reference, or an object of a program.

    Parameters
    ----------
    name : str
        The reference or the object that the study names.
    design : str
        The design whose runs it was fitted to; empty if the study does not name it.
    check : str, optional
        A design whose runs show how good it is.
    is_object : bool
        Whether it is an object of a program.
    """

    name: str
    design: str = ""
    check: str | None = None
    is_object: bool = False

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
