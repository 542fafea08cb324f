"""Quantities in sentences, with their estimates by design."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, REQUESTED
from uqpen.core.labels import INTERVAL_LEVEL, RUNS, SURROGATES
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import (
    estimate_texts,
    percent_text,
    percent_texts,
    tolerance_interval_texts,
)
from uqpen.results.source_statistics import described_statistics
from uqpen.results.surrogate_tables import equivalent_runs_text, is_corrected
from uqpen.results.table import (
    entry_label,
    estimate_remark,
    output_names,
)
from uqpen.results.texts import capitalized, plain_text, unit_suffix

__all__ = [
    "QuotedStatistic",
    "default_statistic",
    "moments",
    "no_break",
    "other_design_estimates",
    "output_name",
    "requested_statistics",
    "usual_statistics",
]


# A tolerance limit, by the ends that it states.
_LIMITS = {
    "at most": "limit for",
    "at least": "lower limit for",
    "between": "tolerance interval of",
}


@dataclass(frozen=True)
class QuotedStatistic:
    """A quantity of an output."""

    view: ArchiveView
    output: str
    statistic: Statistic
    entry: Any = None  # one of several: a probability, a threshold as written, a kind

    def estimate(self, design: str) -> xr.DataArray | None:
        """Return a design's estimate of it, along ``bound``; None where there is none."""
        array = self._entry(design)
        # A tolerance interval has ends alone.
        return array if array is not None and np.isfinite(array.values).any() else None

    def reason_without_estimate(self, design: str) -> str:
        """Return why a design has no estimate of it; empty if that is not known."""
        array = self._entry(design)
        return "" if array is None else estimate_remark(array)

    def _entry(self, design: str) -> xr.DataArray | None:
        """Return what a design has of it, which may be missing with a reason."""
        statistics = self.view.statistics
        if not self.statistic.dims:
            return statistics.get(design, self.output, self.statistic.name)
        return statistics.entries(design, self.output, self.statistic.name).get(self.entry)

    def leading_estimate(self, design: str) -> xr.DataArray | None:
        """Return the estimate that the page states: corrected by real runs, or else the design's.

        A study that fits a surrogate asks for its estimates. So that comes first which has an
        interval, whether or not it is narrower than the design's.
        """
        surrogate = self.leading_surrogate
        return self.estimate(design if surrogate is None else surrogate)

    @property
    def leading_surrogate(self) -> str | None:
        """The first surrogate with a corrected estimate of it; None where there is none."""
        surrogates = group_names(self.view.tree, SURROGATES)
        return next((each for each in surrogates if is_corrected(self.estimate(each))), None)

    def bounds(self, array: xr.DataArray) -> FloatArray:
        """Estimate, lower, upper in the unit that is shown; a probability as it is."""
        convert = self.view.conversion(self.output, self.statistic)
        return np.asarray(convert(array.values), dtype=np.float64)

    def texts(self, array: xr.DataArray, *others: float) -> tuple[str, ...]:
        """Estimate, lower, upper, and other values like those of `bounds`, each with its unit."""
        values = (*self.bounds(array), *others)
        if self.is_probability:
            return tuple(no_break(text) for text in percent_texts(*values))
        is_value = self.statistic.unit is UnitRule.VALUE
        is_logarithmic = is_value and self.view.is_logarithmic(self.output)
        texts = estimate_texts(*values, is_logarithmic=is_logarithmic)
        return tuple(no_break(f"{text}{self.unit_text}") for text in texts)

    def end_texts(self, array: xr.DataArray) -> tuple[str, ...]:
        """Ends of a tolerance interval, rounded outward, each with its unit."""
        _, lower, upper = self.bounds(array)
        texts = tolerance_interval_texts(float(lower), float(upper))
        return tuple(no_break(f"{text}{self.unit_text}") for text in texts)

    def interval(self, array: xr.DataArray) -> str:
        """Return the text in brackets after an estimate: its interval, or why it has none."""
        _, lower, upper = self.texts(array)
        has_lower, has_upper = np.isfinite(self.bounds(array)[1:]).tolist()
        level = f"{no_break(percent_text(array.attrs.get(INTERVAL_LEVEL, np.nan)))} interval"
        if equivalent := equivalent_runs_text(array):
            level += f", as from {no_break(equivalent)} plain runs"
        if has_lower and has_upper:
            return f"({lower} to {upper}, {level})"
        if has_lower or has_upper:
            end = f"at least {lower}" if has_lower else f"at most {upper}"
            return f"({end} by its one-sided {level}: {estimate_remark(array)})"
        return f"(without an interval: {estimate_remark(array)})"

    @property
    def heading(self) -> str:
        """Name of the quantity, to stand before a colon."""
        return f"{capitalized(output_name(self.view, self.output))}, {self.label}"

    @property
    def label(self) -> str:
        """Name of the statistic, behind that of its output."""
        if ends := self.statistic.shown.ends:
            return f"{_LIMITS[ends]} {no_break(percent_text(self.entry))} of cases"
        if not self.statistic.dims:
            return self.statistic.title
        entry = plain_text(self.entry) if isinstance(self.entry, str) else self.entry
        return entry_label(self.statistic, entry)

    @property
    def is_probability(self) -> bool:
        """True if it is shown in per cent; of user-defined statistics none is."""
        return self.statistic.unit is UnitRule.NONE and self.statistic.name in CATALOGUE

    @property
    def unit_text(self) -> str:
        """The text behind a number: a space and the unit; empty behind a plain number."""
        is_plain = self.statistic.unit is UnitRule.NONE
        return "" if is_plain else unit_suffix(self.view.unit(self.output))


def output_name(view: ArchiveView, output: str) -> str:
    """Return the name of an output in a sentence."""
    runs = read_group(view.tree, RUNS, view.designs[0])
    titles = [str(runs[name].attrs.get("long_name", name)) for name in output_names(runs)]
    title = str(runs[output].attrs.get("long_name", output))
    return plain_text(title if titles.count(title) == 1 else f"{title} ({output})")


def no_break(text: str) -> str:
    """Replace the spaces of a text by ones at which no line ends."""
    return text.replace(" ", "\u00a0")


def requested_statistics(view: ArchiveView, output: str, design: str) -> list[QuotedStatistic]:
    """Return the requested statistics of an output, in the order of their ranks.

    What has a verdict comes first. Of the tolerance limits of a kind, all but one come last.
    """
    every = []
    for statistic in (*REQUESTED, *described_statistics(view.statistics, output)):
        entries = _entries(view, output, design, statistic)
        for place, each in enumerate(entries):
            is_further = bool(statistic.shown.ends) and place > 0
            ranks = not _has_acceptance(each, design), is_further, statistic.shown.rank, place
            every.append((ranks, each))
    return [each for _, each in sorted(every, key=lambda ranked: ranked[0])]


def _has_acceptance(quantity: QuotedStatistic, design: str) -> bool:
    """Check if the study has acceptance limits of a probability, so that there is a verdict."""
    array = quantity.estimate(design)
    return array is not None and Acceptance.from_array(array) is not None


def default_statistic(view: ArchiveView, output: str, design: str) -> QuotedStatistic | None:
    """The median of an output, or else its mean."""
    every = usual_statistics(view, output)
    return next((each for each in every if each.estimate(design) is not None), None)


def usual_statistics(view: ArchiveView, output: str) -> tuple[QuotedStatistic, QuotedStatistic]:
    """The median of an output, and its mean."""
    median = QuotedStatistic(view, output, CATALOGUE["quantile"], 0.5)
    return median, moments(view, output)[0]


def moments(view: ArchiveView, output: str) -> tuple[QuotedStatistic, QuotedStatistic]:
    """The mean of an output, and its standard deviation."""
    mean, std = (QuotedStatistic(view, output, CATALOGUE[name]) for name in ("mean", "std"))
    return mean, std


def other_design_estimates(quantity: QuotedStatistic, leading: str) -> dict[str, xr.DataArray]:
    """Return estimates of the same quantity by other designs, which drew their own points."""
    view = quantity.view
    others = (
        design
        for design in view.sample_designs
        if design != leading and view.design(design).sampling is not Sampling.GIVEN
    )
    found = {design: quantity.estimate(design) for design in others}
    return {
        design: estimate
        for design, estimate in found.items()
        if estimate is not None and np.isfinite(estimate.values[0])
    }


def _entries(
    view: ArchiveView, output: str, design: str, statistic: Statistic
) -> Iterator[QuotedStatistic]:
    """Yield the entries of a statistic that the study asks for."""
    if not statistic.dims:
        if view.statistics.get(design, output, statistic.name) is not None:
            yield QuotedStatistic(view, output, statistic)
        return
    for entry in view.statistics.entries(design, output, statistic.name):
        if entry not in statistic.asked.always:
            yield QuotedStatistic(view, output, statistic, entry)
