"""Results of the verification of an archive, part by part, and the differences that they state."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import xarray as xr

from uqpen.workflow.repetition import (
    TOLERANCE,
    Difference,
    difference_text,
    relative_difference,
    unequal,
)

# Differences of one kind that are listed; a damaged archive may have thousands.
_MOST_LISTED = 8


class CheckOutcome(StrEnum):
    """Outcome of the check of a part of an archive."""

    EQUAL = "equal"
    """To the bit."""
    CLOSE = "close"
    """Within a tolerance, on another platform or with other versions."""
    LIKELY = "likely"
    """With noise of the model: as one would expect of the same distribution."""
    UNCHECKED = "unchecked"
    """On purpose, or because there is nothing to check."""
    IMPOSSIBLE = "impossible"
    """Cannot be checked as things are here, which the user can mend."""
    DIFFERENT = "different"
    UNLIKELY = "unlikely"
    """With noise of the model: one honest archive in a thousand is."""


@dataclass(frozen=True)
class CheckResult:
    """Result of the check of one part, in words; the details are its differences, one by one."""

    name: str
    verdict: CheckOutcome
    text: str
    details: tuple[str, ...] = ()

    @classmethod
    def of_differences(
        cls, name: str, what: str, found: Iterable[Difference], tolerance: float
    ) -> CheckResult:
        """Return the result of a repetition, the largest differences first.

        Parameters
        ----------
        name, what : str
            The part, and what of it was repeated.
        found : iterable of Difference
            The differences from the archive.
        tolerance : float
            Largest relative difference; 0 where every bit must be the same.
        """
        found = sorted(found, key=lambda each: -each.relative)
        if not found:
            return cls(name, CheckOutcome.EQUAL, f"{what}: bit-equal")
        details = first_lines([each.what for each in found])
        if found[0].relative <= tolerance:
            close = f"{what}: equal within {TOLERANCE:g} of the largest value"
            return cls(name, CheckOutcome.CLOSE, close, details)
        return cls(name, CheckOutcome.DIFFERENT, f"{what}: different", details)


def first_lines(
    lines: Sequence[str], most: int = _MOST_LISTED, more: str = "more"
) -> tuple[str, ...]:
    """Return the first lines, and how many more there are; whoever wants all has the archives."""
    left = len(lines) - most
    return (*lines[:most], *((f"and {left} {more}",) if left > 0 else ()))


# Relative rounding error of a sum whose terms cancel; no statistic distinguishes it from 0.
NEGLIGIBLE = 2.0**-60

# Errors of a surrogate's fit are what is left of its output. Those that are shares of a variance
# have the scale 1, others that of the coefficients.
_SHARES_OF_VARIANCE = ("leave_one_out_error", "cross_validation_error")
_IN_THE_OUTPUTS_UNIT = ("fit_noise_mean", "fit_noise_std")


def find_differences(
    archived: xr.Dataset, found: xr.Dataset, *, besides: Container[str] | None = ()
) -> Iterator[Difference]:
    """Yield the differences between an archive's group and its repetition.

    Of the group's attributes, those in `besides` are not compared; None for values alone, each
    variable by its own scale.
    """
    yield from missing_keys(archived.variables, found.variables)
    scales = {} if besides is None else _scales(archived)
    for name, one in archived.variables.items():
        if (other := found.variables.get(name)) is None:
            continue
        if (one.dims, one.shape, _kind(one)) != (other.dims, other.shape, _kind(other)):
            yield Difference(f"{name} is of another shape or type", math.inf)
            continue
        scale = scales.get(str(one.attrs.get("units")), 0.0)
        if difference := relative_difference(one.values, other.values, scale):
            entries = int(unequal(one.values, other.values).sum())
            counted = f"{entries} of {one.size} entries" if one.size > 1 else "the value"
            differ = "differ" if entries > 1 else "differs"
            yield Difference(f"{name}: {counted} {differ}{difference_text(difference)}", difference)
        if besides is not None:
            yield from find_attribute_differences(one.attrs, other.attrs, of=f" of {name}")
    if besides is not None:
        largest = _largest(archived.variables.get("coefficient", xr.Variable((), 0)))
        yield from find_attribute_differences(
            archived.attrs, found.attrs, besides=besides, largest=largest
        )


def find_attribute_differences(
    archived: Mapping[Any, Any],
    found: Mapping[Any, Any],
    *,
    of: str = "",
    besides: Container[str] = (),
    largest: float = 0.0,
) -> Iterator[Difference]:
    """Yield the attributes that differ between two groups or variables.

    Parameters
    ----------
    besides : container of str
        Attributes that are not compared.
    largest : float
        The largest coefficient of a surrogate's fit.
    """
    one, other = (
        {key: np.ravel(np.asarray(value)) for key, value in each.items() if key not in besides}
        for each in (archived, found)
    )
    for lacking in missing_keys(one, other, "attribute "):
        yield lacking._replace(what=f"{lacking.what}{of}")
    for name in sorted(one.keys() & other.keys()):
        alike = one[name].shape == other[name].shape and _kind(one[name]) == _kind(other[name])
        scale = 1.0 if name in _SHARES_OF_VARIANCE else 0.0
        scale = largest if name in _IN_THE_OUTPUTS_UNIT else scale
        difference = relative_difference(one[name], other[name], scale) if alike else math.inf
        if difference:
            text = f"attribute {name}{of} differs{difference_text(difference)}"
            yield Difference(text, difference)


def missing_keys(
    archived: Iterable[Any], found: Iterable[Any], what: str = ""
) -> Iterator[Difference]:
    """Yield the names that only one of two collections has."""
    one, other = (set(map(str, each)) for each in (archived, found))
    for name in sorted(one - other):
        yield Difference(f"{what}{name} is missing in the repetition", math.inf)
    for name in sorted(other - one):
        yield Difference(f"{what}{name} is missing", math.inf, is_new=True)


def _scales(group: xr.Dataset) -> dict[str, float]:
    """Return the scale of each unit: the largest value that has it in a group.

    A mean may be 0 but for rounding. What it is rounded from has the scale of the other statistics
    of its unit. The scale of a plain number, such as a skewness, is at least 1.
    """
    scales = {"1": 1.0}
    for variable in group.variables.values():
        unit = variable.attrs.get("units")
        if isinstance(unit, str) and unit != "1":
            scales[unit] = max(scales.get(unit, 0.0), _largest(variable))
    return scales


def _largest(variable: xr.Variable) -> float:
    """Return the largest finite absolute value of a variable; 0 where it has none."""
    values = np.asarray(variable.values)
    if values.dtype.kind != "f":
        return 0.0
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _kind(array: Any) -> str:
    """Return the data type of an array; ``"text"`` for all types of texts."""
    return "text" if array.dtype.kind in "OUS" else str(array.dtype.name)
