"""Study with a surrogate in place of its model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.labels import STATUS
from uqpen.core.status import Status
from uqpen.rehearsal.sources import is_drawn
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.study import ONLY_MODEL, ValidatedStudy, Variant
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

__all__ = ["RehearsedStudy", "ok_values"]


@dataclass(frozen=True, eq=False)
class RehearsedStudy:
    """A study, and a surrogate in place of its model.

    Parameters
    ----------
    original : ValidatedStudy
        The study as it is.
    model : str
        The name of the model.
    surrogate : FittedSurrogate
        Fitted to runs of that model.
    runs : mapping of str to Dataset
        The study's own runs of that model, by design.
    refuted : mapping of str to str
        The outputs whose predictions its runs refute, each with the reason. They are not
        rehearsed: where it is no model of the output, it says nothing of the study.
    """

    original: ValidatedStudy
    model: str
    surrogate: FittedSurrogate
    runs: Mapping[str, xr.Dataset]
    refuted: Mapping[str, str] = field(default_factory=dict)

    @property
    def fitted(self) -> FittedSurrogate:
        """The part of the surrogate that predicts numbers; fields are not rehearsed."""
        return self.surrogate.without_fields

    @cached_property
    def study(self) -> ValidatedStudy:
        """The study with the surrogate as its only model.

        Raises
        ------
        SettingsError
            If no design draws its points, or the surrogate predicts no number of the study that
            runs do not refute.
        """
        study, variant = self.original, self.original.models[self.model]
        quantities = tuple(self._quantities())
        if not quantities and self.refuted:
            reasons = "; ".join(f"{output}: {reason}" for output, reason in self.refuted.items())
            expected = "one that its runs do not refute"
            raise SettingsError(
                [Problem(("surrogates",), f"{self.fitted.name}, {reasons}", expected)]
            )
        if not quantities:
            found = f"{self.fitted.name}, which predicts no number"
            raise SettingsError([Problem(("surrogates",), found, "one of a scalar output")])
        if not any(map(is_drawn, study.designs.values())):
            found = f"{', '.join(study.designs)}, whose points are the same each time"
            expected = "a design that draws its points, such as monte-carlo"
            raise SettingsError([Problem(("designs",), found, expected)])
        models = {ONLY_MODEL: Variant(self.fitted, variant.given)}
        return replace(study, models=models, quantities_of_interest=quantities)

    def own_values(self, output: str) -> FloatArray:
        """Return the values of an output in the study's own runs at drawn points."""
        drawn = [name for name, each in self.original.designs.items() if is_drawn(each)]
        return np.concatenate([ok_values(self.runs[name], output) for name in drawn])

    def _quantities(self) -> Iterator[QuantityOfInterest]:
        known = {output.name for output in self.fitted.outputs} - self.refuted.keys()
        for quantity in self.original.model_quantities(self.original.models[self.model].model):
            if quantity.output.name in known and quantity.output.is_number:
                yield quantity


def ok_values(runs: xr.Dataset, output: str) -> FloatArray:
    """Return the values of an output in the completed runs that have it."""
    values = runs[output].values[runs[STATUS].values == Status.OK].astype(np.float64)
    return np.asarray(values[~np.isnan(values)])
