"""Estimates from the rounds of a design so far."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import xarray as xr

from uqpen.core.errors import UnknownNameError
from uqpen.core.labels import SAMPLING
from uqpen.core.lookup import choices
from uqpen.core.sampling import Sampling
from uqpen.execution import join_rounds
from uqpen.statistics import ANALYSES, ANALYSES_OF_DESIGNS
from uqpen.statistics.analyze import OutputStatistics, analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

__all__ = ["RunningEstimates"]


@dataclass(frozen=True)
class RunningEstimates:
    """Estimates of a design's outputs, as if it had ended with its last round.

    It is a `uqpen.designs.feedback.Estimates`.

    Parameters
    ----------
    rounds : tuple of mapping of str to Dataset
        The runs of each round, by model.
    sampling : Sampling
        Of the design.
    quantities : mapping of str to sequence of QuantityOfInterest
        By model.
    user_defined : sequence of UserDefinedAnalysis
        User-defined analyses.
    """

    rounds: tuple[Mapping[str, xr.Dataset], ...]
    sampling: Sampling
    quantities: Mapping[str, Sequence[QuantityOfInterest]]
    user_defined: Sequence[UserDefinedAnalysis] = ()

    def __call__(
        self, model: str, output: str, *, only: Collection[str] | None = None
    ) -> OutputStatistics:
        """Return the estimate arrays of an output by statistic."""
        if model not in self.quantities:
            raise UnknownNameError(f"no model {model!r}; {choices(model, self.quantities)}")
        asked = {quantity.output.name: quantity for quantity in self.quantities[model]}
        if output not in asked:
            raise UnknownNameError(f"no output {output!r}; {choices(output, asked)}")
        known = {*ANALYSES, *ANALYSES_OF_DESIGNS.get(self.sampling, {})}
        for name in only or ():
            if name not in known:
                raise UnknownNameError(f"no analysis {name!r}; {choices(name, sorted(known))}")
        user_defined = self.user_defined if only is None else ()
        return analyze(self._joined(model), [asked[output]], only=only, user_defined=user_defined)[
            output
        ]

    def _joined(self, model: str) -> xr.Dataset:
        """Return the runs of a model in all rounds."""
        if model not in self._joined_by_model:
            runs = join_rounds([each[model] for each in self.rounds if model in each])
            self._joined_by_model[model] = runs.assign_attrs({SAMPLING: str(self.sampling)})
        return self._joined_by_model[model]

    @cached_property
    def _joined_by_model(self) -> dict[str, xr.Dataset]:
        """Runs that were joined before, as a design may ask for several outputs."""
        return {}
