"""Fits of a surrogate to its outputs, and their diagnostics.

A surrogate is its group of an archive, a DataTree.
"""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.core.labels import NOT_FITTED, RUNS_SPENT
from uqpen.surrogates.diagnostics import DIAGNOSTICS
from uqpen.surrogates.storage import FIELD, unfitted_outputs

__all__ = ["FITTED", "diagnostic_titles", "fit_diagnostics", "fit_settings", "fitted_outputs"]

# The attribute of a surrogate's group with the names of the outputs that it was fitted to.
FITTED = "outputs"


def fitted_outputs(surrogate: xr.DataTree) -> list[str]:
    """Return the outputs that a surrogate was fitted to."""
    return str(surrogate.attrs[FITTED]).split()


def fit_settings(surrogate: xr.DataTree) -> dict[str, Any]:
    """Return the kind, design and runs of a surrogate, and ``<output>_not_fitted`` with reasons."""
    reasons = {f"{key}_{NOT_FITTED}": reason for key, reason in unfitted_outputs(surrogate).items()}
    last = {key: surrogate.attrs[key] for key in (RUNS_SPENT, "check")}
    first = {str(key): value for key, value in surrogate.attrs.items() if key not in last}
    return {**first, **reasons, **last}


def fit_diagnostics(surrogate: xr.DataTree, output: str) -> dict[str, Any]:
    """Return the diagnostics of the fit to an output by name, such as ``check_q2_of_output``.

    They are attributes, or variables of a group of their own (`diagnostic_titles`).
    """
    fit = surrogate.children[output]
    found = {str(key): value for key, value in fit.attrs.items() if not _is_model(str(key))}
    return {**found, **{name: array.values for name, array in _variables(fit).items()}}


def diagnostic_titles(surrogate: xr.DataTree, output: str) -> dict[str, dict[str, str]]:
    """Return unit and title of each diagnostic that is a variable."""
    return {
        name: {key: str(array.attrs.get(key, "")) for key in ("units", "long_name")}
        for name, array in _variables(surrogate.children[output]).items()
    }


def _is_model(attribute: str) -> bool:
    """Return True for an attribute that describes the output, or is a part of the fitted model."""
    return attribute.startswith(("of_", FIELD))


def _variables(fit: xr.DataTree) -> dict[str, xr.DataArray]:
    group = fit.children.get(DIAGNOSTICS)
    return {} if group is None else {str(name): each for name, each in group.data_vars.items()}
