"""Feedback of a round to its design: the runs, and estimates on demand."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from uqpen.core.labels import STATUS
from uqpen.execution import worst_status_runs

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import xarray as xr


class Estimates(Protocol):
    """Estimates from all rounds of a design so far, computed when they are asked for."""

    def __call__(
        self, model: str, output: str, *, only: Collection[str] | None = None
    ) -> Mapping[str, xr.DataArray]:
        """Return estimate arrays by statistic.

        Parameters
        ----------
        model, output : str
            The name of a model, as in `Feedback.runs`, and of one of its outputs.
        only : collection of str, optional
            Keys of `uqpen.statistics.ANALYSES`, such as ``"moments"``; by default, all analyses of
            the study.

        Raises
        ------
        UnknownNameError
            If there is no such model, output or analysis.
        """


@dataclass(frozen=True)
class Feedback:
    """Result of a round, which its design is sent.

    Examples
    --------
    A design reads them where it yields its points::

        feedback = yield points
        mean = feedback.estimates("", "depth", only=["moments"])["mean"]
    """

    # The runs of the round by model, at common points: of all models, or of those that its `Round`
    # names. The only model of a study is ``""``.
    runs: Mapping[str, xr.Dataset]
    # Estimates from the runs of all rounds so far. Without a call they cost nothing.
    estimates: Estimates
    # Cost of a run of each model, relative to the first; 1 where the study states none.
    costs: Mapping[str, float] = field(default_factory=dict)

    @property
    def status(self) -> npt.NDArray[np.int8]:
        """Status of each run of the round, shape (run,): failed where the run of any model failed.

        A run that is inadmissible to one model is inadmissible; others have the highest status.
        """
        status: npt.NDArray[np.int8] = worst_status_runs([*self.runs.values()])[STATUS].values
        return status
