"""The statistics of the model that a page is of, as its sections take them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import INPUT, PAIR, RUNS, STATUS
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import output_names

__all__ = [
    "STATISTIC_FAMILIES",
    "all_outputs",
    "failure_probabilities",
    "status_probability",
    "view_statistics",
]

_FAMILIES = {
    "moments": ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs"),
    "quantiles": ("quantile",),
    "values that hold": ("tolerance_limit",),
    "probabilities of exceeding": ("exceedance",),
    "distribution functions": ("cdf", "cdf_band"),
    "shares of kinds": ("share",),
}

# The families of estimates, by the words of a table, in the order that they are told in.
STATISTIC_FAMILIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        **_FAMILIES,
        "measures of sensitivity": tuple(
            name for name, each in CATALOGUE.items() if not {INPUT, PAIR}.isdisjoint(each.dims)
        ),
    }
)


def view_statistics(view: ArchiveView) -> SourceStatistics:
    """Return the statistics of the model that a view is of."""
    return SourceStatistics(view.tree)


def all_outputs(model: xr.DataTree) -> list[str]:
    """Return the names of a model's outputs, in the order of its runs."""
    designs = model.children[RUNS].children if RUNS in model.children else {}
    return output_names(read_group(model, RUNS, next(iter(designs), "")))


def failure_probabilities(view: ArchiveView, design: str) -> xr.DataArray | None:
    """Return how likely each end of a run is, along ``status`` and ``bound``.

    Its attributes say what the statistics of the design are conditional on, and what is missing.
    """
    return view_statistics(view).failures(design).get("probability")


def status_probability(view: ArchiveView, design: str, status: Status) -> xr.DataArray | None:
    """Return how likely a run ends with a status, along ``bound``; None without an estimate."""
    array = failure_probabilities(view, design)
    if array is None:
        return None
    known = array[STATUS].values.tolist()
    return array[{STATUS: known.index(status.meaning)}] if status.meaning in known else None
