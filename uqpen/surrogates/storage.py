"""Descriptions of inputs and outputs as attributes in the groups of a fitted surrogate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from uqpen.core.variables import Variable

__all__ = ["describe", "description"]


def describe(variable: Variable, prefix: str = "") -> dict[str, str]:
    """Return unit, display unit and title of a variable as attributes."""
    return {
        f"{prefix}units": variable.unit,
        f"{prefix}display_units": variable.preferred_unit,
        f"{prefix}long_name": variable.title,
    }


def description(attributes: Mapping[Any, Any], prefix: str = "") -> tuple[str, str, str]:
    """Return unit, title and display unit of a variable from its attributes."""
    unit, title, shown = (
        str(attributes[f"{prefix}{key}"]) for key in ("units", "long_name", "display_units")
    )
    return unit, title, shown
