"""User-defined analyses: functions in a study's files that yield statistics."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from uqpen.core.errors import Problem, StudyError
from uqpen.core.files import FileSnapshot
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_defined_function import failure_text

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.statistics.quantity_of_interest import QuantityOfInterest
    from uqpen.statistics.sample import Sample

__all__ = ["Analysis", "UserDefinedAnalysis"]

Analysis: TypeAlias = "Callable[[Sample, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]"


@dataclass(frozen=True)
class UserDefinedAnalysis:
    """User-defined function that yields statistics of an output.

    Parameters
    ----------
    reference : str
        ``"file.py:function"`` or ``"package.module:function"``, as the study has it.
    function : callable
        Takes a `Sample` and a `QuantityOfInterest`, and yields names with estimate arrays.
    surroundings : ModelFolder, optional
        The context in which the function must be called.
    """

    reference: str
    function: Analysis = field(compare=False)
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)

    @property
    def takes_weights(self) -> bool:
        """True if the function uses weights, as its attribute of this name states."""
        return bool(getattr(self.function, "takes_weights", False))

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return the files that it has been loaded from, as they were."""
        return self.surroundings.files() if self.surroundings else ()

    def __call__(self, sample: Sample, quantity: QuantityOfInterest) -> list[Any]:
        """Return everything that the function yields, unchecked.

        Raises
        ------
        StudyError
            If it raises anything.
        """
        place = self.surroundings.on_import_path() if self.surroundings else None
        try:
            with place or contextlib.nullcontext():
                return list(self.function(_read_only(sample), quantity))
        except (Exception, SystemExit) as error:  # a user's function can raise anything
            found = failure_text(error, self.function)
            raise self.error(quantity, found, "statistics") from None

    def error(self, quantity: QuantityOfInterest, found: str, expected: str) -> StudyError:
        """Return the error for invalid statistics of an output."""
        what = f"{self.reference} of {quantity.output.name}: {found}"
        problem = Problem(("analyses",), what, expected)
        return StudyError(str(problem), [problem])


def _read_only(sample: Sample) -> Sample:
    """Return a sample whose arrays an analysis cannot change; those of inputs never can be."""
    views = {
        name: getattr(sample, name).view() for name in ("values", "used", "missing", "replicates")
    }
    for view in views.values():
        view.flags.writeable = False
    return replace(sample, **views)
