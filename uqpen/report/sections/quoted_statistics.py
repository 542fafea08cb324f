"""Quantities that sentences are made of: which they are, and who estimates them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import (
    EXCEEDANCE,
    INTERVAL_LEVEL,
    MOMENTS,
    QUANTILES,
    RUNS,
    SHARES,
    TOLERANCE_LIMITS,
    Sampling,
)
from uqpen.figures.archive_view import ArchiveView
from uqpen.figures.texts import capitalized, plain_text, unit_suffix
from uqpen.report.counting import percent_texts
from uqpen.results.digits import estimate_texts, percent_text
from uqpen.results.table import estimate_remark, exceedance_label, output_names, quantile_label

__all__ = [
    "QuotedStatistic",
    "default_statistic",
    "no_break",
    "other_design_estimates",
    "output_name",
    "requested_statistics",
]

FloatArray = npt.NDArray[np.float64]

# What the entries of a group lie along: how the coordinate's name goes on after the output's.
_COORDINATES = {
    TOLERANCE_LIMITS: "hold",
    EXCEEDANCE: "threshold",
    QUANTILES: "probability",
    SHARES: "category",
}


@dataclass(frozen=True)
class QuotedStatistic:
    """A quantity of an output.

    Parameters
    ----------
    view : ArchiveView
    output : str
    kind : str
        The group that its estimates stand in.
    entry : str or float or None
        What tells it from others of the group: a probability, a threshold as written, a kind.
    """

    view: ArchiveView
    output: str
    kind: str
    entry: Any = None

    def estimate(self, design: str) -> xr.DataArray | None:
        """What a design tells of it, along ``bound``; None where it tells nothing."""
        dataset = read_group(self.view.tree, self.kind, design)
        name = f"{self.output}_mean" if self.kind == MOMENTS else self.output
        if name not in dataset:
            return None
        array = dataset[name]
        if self.kind in _COORDINATES:
            entries = dataset[f"{self.output}_{_COORDINATES[self.kind]}"].values.tolist()
            if self.entry not in entries:
                return None
            array = array[entries.index(self.entry)]
        return array if np.isfinite(array.values[0]) else None

    def bounds(self, array: xr.DataArray) -> FloatArray:
        """Estimate, lower, upper in the unit that is shown; a probability as it is."""
        if self._is_probability:
            return np.asarray(array.values, dtype=np.float64)
        return np.asarray(self.view.scale(self.output).from_si(array.values), dtype=np.float64)

    def texts(self, array: xr.DataArray, *others: float) -> tuple[str, ...]:
        """Estimate, lower, upper, and other values like those of `bounds`, each with its unit."""
        values = (*self.bounds(array), *others)
        if self._is_probability:
            return tuple(no_break(text) for text in percent_texts(*values))
        return tuple(no_break(f"{text}{self._unit}") for text in estimate_texts(*values))

    def interval(self, array: xr.DataArray) -> str:
        """What stands behind an estimate, in brackets: its interval, or why it has none."""
        _, lower, upper = self.texts(array)
        has_lower, has_upper = np.isfinite(self.bounds(array)[1:]).tolist()
        level = f"{no_break(percent_text(array.attrs.get(INTERVAL_LEVEL, np.nan)))} interval"
        if has_lower and has_upper:
            return f"({lower} to {upper}, {level})"
        if has_lower or has_upper:
            end = f"at least {lower}" if has_lower else f"at most {upper}"
            return f"({end} by its {level}, which has one end: {estimate_remark(array)})"
        return f"(without an interval: {estimate_remark(array)})"

    @property
    def heading(self) -> str:
        """Which quantity it is, to stand before a colon."""
        return f"{capitalized(output_name(self.view, self.output))}, {self._label}"

    @property
    def _label(self) -> str:
        if self.kind == TOLERANCE_LIMITS:
            return f"value not exceeded in {no_break(percent_text(self.entry))} of cases"
        if self.kind == QUANTILES:
            return quantile_label(self.entry)
        return exceedance_label(plain_text(self.entry)) if self.kind == EXCEEDANCE else "mean"

    @property
    def _is_probability(self) -> bool:
        return self.kind in (EXCEEDANCE, SHARES)

    @property
    def _unit(self) -> str:
        return unit_suffix(self.view.unit(self.output))


def output_name(view: ArchiveView, output: str) -> str:
    """What an output is called in a sentence."""
    runs = read_group(view.tree, RUNS, view.designs[0])
    titles = [str(runs[name].attrs.get("long_name", name)) for name in output_names(runs)]
    title = str(runs[output].attrs.get("long_name", output))
    return plain_text(title if titles.count(title) == 1 else f"{title} ({output})")


def no_break(text: str) -> str:
    """A number and what belongs to it, not to be parted at the end of a line."""
    return text.replace(" ", "\u00a0")


def requested_statistics(view: ArchiveView, output: str, design: str) -> list[QuotedStatistic]:
    """What the study asked of an output by itself, the first value held before thresholds."""
    limits, thresholds = (
        [each for each in _entries(view, output, design, kind) if each.estimate(design) is not None]
        for kind in (TOLERANCE_LIMITS, EXCEEDANCE)
    )
    return [*limits[:1], *thresholds, *limits[1:]]


def default_statistic(view: ArchiveView, output: str, design: str) -> QuotedStatistic | None:
    """The median of an output, or else its mean."""
    for each in (
        QuotedStatistic(view, output, QUANTILES, 0.5),
        QuotedStatistic(view, output, MOMENTS),
    ):
        if each.estimate(design) is not None:
            return each
    return None


def other_design_estimates(quantity: QuotedStatistic, leading: str) -> dict[str, xr.DataArray]:
    """What other designs, which drew points of their own, tell of the same quantity."""
    view = quantity.view
    found = {}
    for design in view.sample_designs:
        given = view.sampling(design) is Sampling.USER_SUPPLIED
        estimate = None if given or design == leading else quantity.estimate(design)
        if estimate is not None:
            found[design] = estimate
    return found


def _entries(view: ArchiveView, output: str, design: str, kind: str) -> Iterator[QuotedStatistic]:
    dataset = read_group(view.tree, kind, design)
    coordinate = f"{output}_{_COORDINATES[kind]}"
    if coordinate in dataset:
        yield from (
            QuotedStatistic(view, output, kind, each)
            for each in dataset[coordinate].values.tolist()
        )
