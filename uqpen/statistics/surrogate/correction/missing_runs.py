"""Predictions of a surrogate at the inputs of failed runs: results that they may have given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.labels import (
    MISSING_BEYOND,
    MISSING_HIGHEST,
    MISSING_LOWEST,
    MISSING_PREDICTED,
    MISSING_SHARES,
    RUN,
    STATUS,
)
from uqpen.core.status import Status
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

__all__ = ["MissingRunPredictions", "missing_run_predictions"]


@dataclass(frozen=True)
class MissingRunPredictions:
    """Predictions of an output at the inputs of missing runs, in its SI unit.

    Parameters
    ----------
    count : int
        Number of missing runs with a prediction.
    lowest, highest : float
        The range of the predictions.
    exceedance, below : mapping of str to float
        Share of the predictions above and below each requested threshold, by its text.
    """

    count: int
    lowest: float
    highest: float
    exceedance: Mapping[str, float]
    below: Mapping[str, float]

    def attributes(self) -> dict[str, int | float]:
        """Return the count and the range, for an archive."""
        return {
            MISSING_PREDICTED: self.count,
            MISSING_LOWEST: self.lowest,
            MISSING_HIGHEST: self.highest,
        }

    def share_attributes(self) -> dict[str, list[str] | list[float]]:
        """Return the shares beyond thresholds, for an archive; the texts start with ``>`` or ``<``.

        Empty without thresholds.
        """
        shares = {f"> {text}": share for text, share in self.exceedance.items()}
        shares |= {f"< {text}": share for text, share in self.below.items()}
        if not shares:
            return {}
        return {MISSING_BEYOND: list(shares), MISSING_SHARES: list(shares.values())}


def missing_run_predictions(
    model: FittedSurrogate, runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]
) -> dict[str, MissingRunPredictions]:
    """Summarise what a surrogate predicts at the inputs of missing runs, by scalar output.

    Parameters
    ----------
    model : FittedSurrogate
    runs : Dataset
        Runs of a design; inadmissible ones are not missing.
    quantities : sequence of QuantityOfInterest
    """
    status = runs[STATUS].values
    is_missing = (status != Status.OK) & (status != Status.INADMISSIBLE)
    missing = runs.isel({RUN: np.flatnonzero(is_missing)})
    count = missing.sizes[RUN]
    if not count or not model.outputs:
        return {}
    names = model.random_inputs
    inputs = {name: np.broadcast_to(missing[name].values, count) for name in names}
    predicted = model.predict(inputs)
    found = {}
    for quantity in quantities:
        name = quantity.output.name
        if name not in predicted or quantity.output.dims:
            continue
        values = predicted[name].mean[np.isfinite(predicted[name].mean)]
        if values.size:
            found[name] = MissingRunPredictions(
                values.size,
                float(values.min()),
                float(values.max()),
                {each.text: float((values > each.value).mean()) for each in quantity.thresholds},
                {
                    each.text: float((values < each.value).mean())
                    for each in quantity.lower_thresholds
                },
            )
    return found
