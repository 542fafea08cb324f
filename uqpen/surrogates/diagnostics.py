"""Diagnostics of a fit: numbers that say how good it is, each with its title and its unit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import NAME, NOT_FITTED, REFUTED
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.core.variables import Variable

if TYPE_CHECKING:
    import xarray as xr

# The group with the diagnostics of the fit to an output, in the group of that output.
DIAGNOSTICS = "diagnostics"

# Groups without that group state them as attributes; these are shown.
_TITLES_OF_ATTRIBUTES = {
    "order": "order",
    "terms": "terms",
    "q2": "Q², runs left out",
    "check_q2_of_output": "Q², check runs",
}

# Diagnostics that are 1 for a fit without any error, and the largest that is written out.
_QUALITIES = ("q2", "check_q2_of_output")
_NEXT_TO_1 = 0.99999


@dataclass(frozen=True)
class Diagnostic:
    """Number that says something about a fit.

    Parameters
    ----------
    name : str
        A name of letters, digits and ``_``.
    value : float
        NaN where it is unknown.
    title : str
        What a reader sees.
    units : str
        Its SI unit.
    """

    name: str
    value: float
    title: str
    units: str = DIMENSIONLESS

    def __post_init__(self) -> None:
        if not NAME.match(self.name) or not self.title:
            raise ValueError(f"a diagnostic has a name and a title, not {self.name!r}")
        if math.isinf(self.value):
            raise ValueError(f"the diagnostic {self.name} is infinite")
        scale(self.units)

    @property
    def text(self) -> str:
        """Text of the value with its unit; empty if it is unknown."""
        if self.name in _QUALITIES:
            return quality_text(self.value)
        unit = "" if self.units == DIMENSIONLESS else f" {self.units}"
        return "" if math.isnan(self.value) else f"{self.value:.5g}{unit}"


def quality_text(q2: float) -> str:
    """Return a Q² in five decimals; one that is not 1 is not rounded to it; empty for NaN.

    >>> quality_text(0.9997), quality_text(0.999998)
    ('0.99970', '> 0.99999')
    """
    if math.isnan(q2):
        return ""
    return "> 0.99999" if q2 > _NEXT_TO_1 else f"{q2:.5f}"


def diagnostics_dataset(diagnostics: Iterable[Diagnostic]) -> xr.Dataset:
    """Return diagnostics as the group of an archive: variables without dimensions."""
    import xarray as xr

    return xr.Dataset(
        {
            each.name: ((), float(each.value), {"units": each.units, "long_name": each.title})
            for each in diagnostics
        }
    )


def shown_diagnostics(fit: xr.DataTree) -> tuple[Diagnostic, ...]:
    """Return the diagnostics of the fit to an output, from its group of an archive."""
    if DIAGNOSTICS not in fit.children:
        return tuple(
            Diagnostic(name, float(fit.attrs[name]), title)
            for name, title in _TITLES_OF_ATTRIBUTES.items()
        )
    return tuple(
        Diagnostic(
            str(name),
            float(variable.values),
            str(variable.attrs["long_name"]),
            str(variable.attrs["units"]),
        )
        for name, variable in fit.children[DIAGNOSTICS].data_vars.items()
    )


def shown_titles(fits: Iterable[xr.DataTree]) -> list[str]:
    """Return the titles of the diagnostics of several fits, each once.

    Without any fit they are those that fits state as attributes.
    """
    titles = [each.title for fit in fits for each in shown_diagnostics(fit)]
    return list(dict.fromkeys(titles)) or list(_TITLES_OF_ATTRIBUTES.values())


# Errors of predictions at runs that a surrogate was not fitted to.


def predictive_q2(found: FloatArray, truth: FloatArray, weights: FloatArray | None = None) -> float:
    """Return one minus the mean square error over the variance; NaN if a value is not finite.

    Weights of runs are on average 1; without them, all are 1.
    """
    if len(truth) < 2:
        return math.nan
    with np.errstate(all="ignore"):
        if weights is None:
            error, variance = np.mean((found - truth) ** 2), np.var(truth, ddof=1)
        else:
            mean = np.average(truth, weights=weights)
            error, variance = (
                np.average((each - truth) ** 2, weights=weights) for each in (found, mean)
            )
        q2 = 1 - float(error / variance)
    return q2 if math.isfinite(q2) else math.nan


# Texts in the groups of a fitted surrogate: descriptions, and reasons why there is no fit.

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
