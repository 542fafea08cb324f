"""Quantities that sentences are made of: which they are, and who estimates them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, capitalized, plain
from uqpen.labels import (
    EXCEEDANCE,
    HOLDS,
    INTERVAL_LEVEL,
    MOMENTS,
    QUANTILES,
    RUNS,
    SHARES,
    Sampling,
)
from uqpen.report.counting import in_percent
from uqpen.summary.digits import alike, percent
from uqpen.summary.table import exceedance_label, output_names, quantile_label, remark

__all__ = ["Quantity", "asked", "name_of", "others_of", "unbroken", "usual"]

FloatArray = npt.NDArray[np.float64]

# What the entries of a group lie along: how the coordinate's name goes on after the output's.
_ALONG = {HOLDS: "hold", EXCEEDANCE: "threshold", QUANTILES: "probability", SHARES: "category"}


@dataclass(frozen=True)
class Quantity:
    """A quantity of an output.

    Parameters
    ----------
    part : Part
    output : str
    kind : str
        The group that its estimates stand in.
    entry : str or float or None
        What tells it from others of the group: a probability, a threshold as written, a kind.
    """

    part: Part
    output: str
    kind: str
    entry: Any = None

    def estimate(self, design: str) -> xr.DataArray | None:
        """What a design tells of it, along ``bound``; None where it tells nothing."""
        told = group(self.part.tree, self.kind, design)
        name = f"{self.output}_mean" if self.kind == MOMENTS else self.output
        if name not in told:
            return None
        array = told[name]
        if self.kind in _ALONG:
            entries = told[f"{self.output}_{_ALONG[self.kind]}"].values.tolist()
            if self.entry not in entries:
                return None
            array = array[entries.index(self.entry)]
        return array if np.isfinite(array.values[0]) else None

    def bounds(self, array: xr.DataArray) -> FloatArray:
        """Estimate, lower, upper in the unit that is shown; a probability as it is."""
        if self._is_probability:
            return np.asarray(array.values, dtype=np.float64)
        return np.asarray(self.part.measure(self.output).from_si(array.values), dtype=np.float64)

    def texts(self, array: xr.DataArray, *others: float) -> tuple[str, ...]:
        """Estimate, lower, upper, and other values like those of `bounds`, each with its unit."""
        values = (*self.bounds(array), *others)
        if self._is_probability:
            return tuple(unbroken(text) for text in in_percent(*values))
        return tuple(unbroken(f"{text}{self._unit}") for text in alike(*values))

    def interval(self, array: xr.DataArray) -> str:
        """What stands behind an estimate, in brackets: its interval, or why it has none."""
        _, lower, upper = self.texts(array)
        has_lower, has_upper = np.isfinite(self.bounds(array)[1:]).tolist()
        level = f"{unbroken(percent(array.attrs.get(INTERVAL_LEVEL, np.nan)))} interval"
        if has_lower and has_upper:
            return f"({lower} to {upper}, {level})"
        if has_lower or has_upper:
            end = f"at least {lower}" if has_lower else f"at most {upper}"
            return f"({end} by its {level}, which has one end: {remark(array)})"
        return f"(without an interval: {remark(array)})"

    @property
    def heading(self) -> str:
        """Which quantity it is, to stand before a colon."""
        return f"{capitalized(name_of(self.part, self.output))}, {self._label}"

    @property
    def _label(self) -> str:
        if self.kind == HOLDS:
            return f"value not exceeded in {unbroken(percent(self.entry))} of cases"
        if self.kind == QUANTILES:
            return quantile_label(self.entry)
        return exceedance_label(plain(self.entry)) if self.kind == EXCEEDANCE else "mean"

    @property
    def _is_probability(self) -> bool:
        return self.kind in (EXCEEDANCE, SHARES)

    @property
    def _unit(self) -> str:
        return after_number(self.part.unit(self.output))


def name_of(part: Part, output: str) -> str:
    """What an output is called in a sentence."""
    runs = group(part.tree, RUNS, part.designs[0])
    titles = [str(runs[name].attrs.get("long_name", name)) for name in output_names(runs)]
    title = str(runs[output].attrs.get("long_name", output))
    return plain(title if titles.count(title) == 1 else f"{title} ({output})")


def unbroken(text: str) -> str:
    """A number and what belongs to it, not to be parted at the end of a line."""
    return text.replace(" ", "\u00a0")


def asked(part: Part, output: str, design: str) -> list[Quantity]:
    """What the study asked of an output by itself, the first value held before thresholds."""
    holds, thresholds = (
        [each for each in _entries(part, output, design, kind) if each.estimate(design) is not None]
        for kind in (HOLDS, EXCEEDANCE)
    )
    return [*holds[:1], *thresholds, *holds[1:]]


def usual(part: Part, output: str, design: str) -> Quantity | None:
    """The median of an output, or else its mean."""
    for each in (Quantity(part, output, QUANTILES, 0.5), Quantity(part, output, MOMENTS)):
        if each.estimate(design) is not None:
            return each
    return None


def others_of(quantity: Quantity, leading: str) -> dict[str, xr.DataArray]:
    """What other designs, which drew points of their own, tell of the same quantity."""
    part = quantity.part
    found = {}
    for design in part.samples:
        given = part.sampling(design) is Sampling.GIVEN
        estimate = None if given or design == leading else quantity.estimate(design)
        if estimate is not None:
            found[design] = estimate
    return found


def _entries(part: Part, output: str, design: str, kind: str) -> Iterator[Quantity]:
    told = group(part.tree, kind, design)
    coordinate = f"{output}_{_ALONG[kind]}"
    if coordinate in told:
        yield from (Quantity(part, output, kind, each) for each in told[coordinate].values.tolist())
