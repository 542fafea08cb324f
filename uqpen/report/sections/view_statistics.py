"""The statistics of a page's model, in the form that its sections take."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import INPUT, PAIR, STATUS
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView

__all__ = ["STATISTIC_FAMILIES", "failure_probabilities", "sample_account", "status_probability"]

# The families of estimates, by their names in a table, in their order there.
STATISTIC_FAMILIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "moments": ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs"),
        "quantiles": ("quantile",),
        "tolerance limits": ("tolerance_limit", "lower_tolerance_limit", "tolerance_interval"),
        "exceedance probabilities": ("exceedance",),
        "probabilities of lying below": ("below",),
        "distribution functions": ("cdf", "cdf_band"),
        "category probabilities": ("share",),
        "measures of sensitivity": tuple(
            name for name, each in CATALOGUE.items() if not {INPUT, PAIR}.isdisjoint(each.dims)
        ),
    }
)


def failure_probabilities(view: ArchiveView, design: str) -> xr.DataArray | None:
    """Return the probability of each status of a run, along ``status`` and ``bound``."""
    return view.statistics.failures(design).get("probability")


def sample_account(view: ArchiveView, design: str) -> Mapping[Any, Any]:
    """Return attributes on the runs of a design: their number, condition and missing runs."""
    probability = failure_probabilities(view, design)
    return {} if probability is None else probability.attrs


def status_probability(view: ArchiveView, design: str, status: Status) -> xr.DataArray | None:
    """Return the probability of a status, along ``bound``; None without an estimate."""
    array = failure_probabilities(view, design)
    if array is None:
        return None
    known = array[STATUS].values.tolist()
    return array[{STATUS: known.index(status.meaning)}] if status.meaning in known else None
