"""Fits of a surrogate to its outputs, and what it was made of.

A surrogate is its group of an archive, a DataTree.
"""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.core.labels import NOT_FITTED, RUNS_SPENT
from uqpen.surrogates.storage import unfitted_outputs

__all__ = ["fit_diagnostics", "fit_settings", "fitted_outputs"]


def fitted_outputs(surrogate: xr.DataTree) -> list[str]:
    """Return the outputs that a surrogate was fitted to."""
    return str(surrogate.attrs["outputs"]).split()


def fit_settings(surrogate: xr.DataTree) -> dict[str, Any]:
    """Return the kind, design and runs of a surrogate, and ``<output>_not_fitted`` with reasons."""
    reasons = {f"{key}_{NOT_FITTED}": reason for key, reason in unfitted_outputs(surrogate).items()}
    last = {key: surrogate.attrs[key] for key in (RUNS_SPENT, "check")}
    first = {str(key): value for key, value in surrogate.attrs.items() if key not in last}
    return {**first, **reasons, **last}


def fit_diagnostics(surrogate: xr.DataTree, output: str) -> dict[str, Any]:
    """Return the diagnostics of the fit to an output: ``order``, ``terms``, ``q2`` and others."""
    attributes = surrogate.children[output].attrs
    return {str(key): value for key, value in attributes.items() if not str(key).startswith("of_")}
