"""The statistics of a page's model, in the form that its sections take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqpen.core.labels import STATUS
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView

__all__ = ["failure_probabilities", "sample_account", "status_probability"]


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
