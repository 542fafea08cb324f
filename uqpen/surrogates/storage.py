"""Texts in the groups of a fitted surrogate: descriptions, and reasons why there is no fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from uqpen.core.labels import NOT_FITTED, REFUTED
from uqpen.core.variables import Variable

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FIELD", "describe", "description", "refuted_outputs", "unfitted_outputs"]

# What distinguishes an attribute that is a part of a fit from others of its group.
FIELD = "field_"


def describe(variable: Variable, prefix: str = "") -> dict[str, str]:
    """Return unit, display unit and title of a variable as attributes."""
    return {f"{prefix}{key}": text for key, text in variable.attributes.items()}


def description(attributes: Mapping[Any, Any], prefix: str = "") -> tuple[str, str, str]:
    """Return unit, title and display unit of a variable from its attributes."""
    unit, title, shown = (
        str(attributes[f"{prefix}{key}"]) for key in ("units", "long_name", "display_units")
    )
    return unit, title, shown


def unfitted_outputs(surrogate: xr.DataTree) -> dict[str, str]:
    """Return the outputs that a surrogate could not be fitted to, each with the reason."""
    return _reasons(surrogate, NOT_FITTED)


def refuted_outputs(surrogate: xr.DataTree) -> dict[str, str]:
    """Return the outputs of a surrogate that runs refute, each with the reason."""
    return _reasons(surrogate, REFUTED)


def _reasons(surrogate: xr.DataTree, attribute: str) -> dict[str, str]:
    return {
        str(output): str(group.attrs[attribute])
        for output, group in surrogate.children.items()
        if attribute in group.attrs
    }
