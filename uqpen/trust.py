"""The trust gate: which of a surrogate's figures independent runs bear out.

A surrogate may fit well as a whole and yet be wrong in the one figure that is asked: a good Q²
says little of a standard deviation that hangs on the tail. So each figure is judged by itself,
against the interval that independent runs give the same figure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.of_surrogate import Reach
from uqpen.archive.told import own, stem, told, told_along
from uqpen.labels import (
    BOUND,
    CDFS,
    CHECKED,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    MISSING,
    NOTE,
    QUANTILES,
    RANK,
    REFUSED,
    SENSITIVITY,
    UNCHECKED,
)

__all__ = ["Witness", "judged"]

FloatArray = npt.NDArray[np.float64]
Groups = Mapping[str, xr.Dataset]

# A spread that no runs vouch for is extrapolated where more than this share of the variance comes
# from values beyond all outputs that the surrogate was fitted to.
_MOST_VARIANCE_BEYOND = 0.05

_SPREADS = ("std", "skewness", "kurtosis")


class Witness(NamedTuple):
    """Independent runs that a surrogate is held against.

    Attributes
    ----------
    name : str
        The design's.
    groups : mapping of str to Dataset
        What they tell, group by group.
    """

    name: str
    groups: Groups


class _Verdict(NamedTuple):
    label: str
    note: str


def judged(
    groups: Groups, witnesses: Sequence[Witness], reaches: Mapping[str, Reach]
) -> dict[str, xr.Dataset]:
    """A surrogate's figures, each with what independent runs say of it in place of an interval.

    Parameters
    ----------
    groups : mapping of str to Dataset
        The surrogate's figures, group by group as designs have them.
    witnesses : sequence of Witness
        The first that has an interval for a figure decides on it.
    reaches : mapping of str to Reach
        By output.

    Returns
    -------
    dict of str to Dataset
        The same figures without bounds, labelled ``checked`` (inside the runs' interval),
        ``refused`` (outside, or extrapolated) or ``unchecked`` (nothing to hold it against).
    """
    found = {}
    for group, dataset in groups.items():
        gate = _Gate(group, witnesses, reaches)
        kept = {
            str(name): gate.pass_on(str(name), own(dataset, str(name)), dataset)
            for name in dataset.data_vars
        }
        found[group] = xr.Dataset(kept, attrs=dataset.attrs)
    return found


@dataclass(frozen=True)
class _Gate:
    """Judges the figures of one group."""

    group: str
    witnesses: Sequence[Witness]
    reaches: Mapping[str, Reach]

    def pass_on(self, name: str, array: xr.DataArray, dataset: xr.Dataset) -> xr.DataArray:
        """An array without its bounds and with the verdicts on its figures."""
        if BOUND not in array.dims:
            return array
        if self.group == CDFS:
            return _marked(name, array, {(): self._verdict_on_curve(name, dataset)})
        places = list(np.ndindex(array.shape[:-1]))
        return _marked(name, array, {at: self._verdict(name, array[at]) for at in places})

    def _verdict(self, name: str, figure: xr.DataArray) -> _Verdict:
        value, said = float(figure.values[0]), told(figure, NOTE)
        if math.isnan(value):
            return _Verdict("none", said)
        verdict = self._verdict_on(name, figure, value)
        if self.group != SENSITIVITY or not said:
            return verdict  # what is said of moments and quantiles is of their intervals
        return verdict._replace(note=f"{verdict.note}; {said}")

    def _verdict_on(self, name: str, figure: xr.DataArray, value: float) -> _Verdict:
        if self._is_beyond(name, figure, value):
            return _Verdict(REFUSED, "beyond all outputs that the surrogate was fitted to")
        for witness in self.witnesses:
            same = _same_figure(witness.groups.get(self.group, xr.Dataset()), name, figure)
            if same is None or np.isnan(same[1:]).any():
                continue
            interval = f"the interval that {witness.name} gives it"
            if MISSING in witness.groups[self.group].attrs:
                interval += " of the runs that came back"
            # What sampling the surrogate leaves open is no fault of the surrogate's.
            low, high = np.nan_to_num(figure.values[1:], nan=value)
            is_inside = low <= same[2] and high >= same[1]
            if is_inside:
                return _Verdict(CHECKED, f"inside {interval}")
            return _Verdict(REFUSED, f"outside {interval}")
        return self._unvouched(name)

    @property
    def _nobody(self) -> str:
        if not self.witnesses:
            return "no independent runs to hold it against"
        return "no independent runs have an interval for it"

    def _is_beyond(self, name: str, figure: xr.DataArray, value: float) -> bool:
        """Whether a figure is of a place that the training runs did not reach."""
        output, reach = self._reach(name)
        threshold = figure.coords.get(f"{output}_threshold_value")
        if reach is None or (threshold is None and self.group != QUANTILES):
            return False
        return not reach.holds(value if threshold is None else float(threshold))

    def _unvouched(self, name: str) -> _Verdict:
        """On a figure that no runs have an interval for."""
        output, reach = self._reach(name)
        is_spread = name.removeprefix(f"{output}_") in _SPREADS
        if reach is None or not is_spread or reach.variance_beyond <= _MOST_VARIANCE_BEYOND:
            return _Verdict(UNCHECKED, self._nobody)
        share = f"{100 * reach.variance_beyond:.0f} % of the variance"
        return _Verdict(
            REFUSED,
            f"{share} lies beyond all outputs that the surrogate was fitted to, and {self._nobody}",
        )

    def _reach(self, name: str) -> tuple[str, Reach | None]:
        """The output that a variable is of: the longest that its name begins with."""
        known = [each for each in self.reaches if name == each or name.startswith(f"{each}_")]
        output = max(known, key=len, default="")
        return output, self.reaches.get(output)

    def _verdict_on_curve(self, name: str, dataset: xr.Dataset) -> _Verdict:
        """On a distribution function as a whole: it must stay in the runs' simultaneous band."""
        output = name.removesuffix("_probability").removesuffix("_band")
        values, ranks = dataset[output].values, dataset[RANK].values
        for witness in self.witnesses:
            curves = witness.groups.get(CDFS, xr.Dataset())
            if f"{output}_band" not in curves:
                continue
            _, lower, upper = curves[f"{output}_band"].values.T
            if np.isnan(lower).any():
                continue
            at = curves[output].values
            # The band is a step: between two of its values the lower end is that of the left one.
            left = np.searchsorted(at, values, side="right") - 1
            low = np.where(left >= 0, lower[np.maximum(left, 0)], 0.0)
            right = np.searchsorted(at, values, side="left")
            high = np.where(right < len(at), upper[np.minimum(right, len(at) - 1)], 1.0)
            outside = (ranks < low) | (ranks > high)
            if not outside.any():
                return _Verdict(CHECKED, f"inside the simultaneous band of {witness.name}")
            ends = ranks[outside]
            where = f"from {ends.min():.3g} to {ends.max():.3g}"
            return _Verdict(REFUSED, f"outside the simultaneous band of {witness.name} {where}")
        return _Verdict(UNCHECKED, self._nobody)


def _same_figure(dataset: xr.Dataset, name: str, figure: xr.DataArray) -> FloatArray | None:
    """The bounds that another source gives the same figure."""
    if name not in dataset:
        return None
    array = dataset[name]
    for dimension in array.dims[:-1]:
        called = array[dimension].values.tolist()
        wanted = figure.coords[dimension].item()
        if wanted not in called:
            return None
        array = array[{dimension: called.index(wanted)}]
    bounds: FloatArray = array.values
    return bounds


def _marked(
    name: str, array: xr.DataArray, verdicts: Mapping[tuple[int, ...], _Verdict]
) -> xr.DataArray:
    """An array without bounds and with a verdict on each of its figures, or one on all."""
    marked = array.copy()
    marked[{BOUND: slice(1, None)}] = np.nan
    shape = {str(key): size for key, size in array.sizes.items() if key != BOUND}
    called = stem(name, list(shape), array.coords)
    if () in verdicts or not called:
        (verdict,) = verdicts.values()
        marked.attrs.pop(INTERVAL_LEVEL, None)
        marked.attrs |= {INTERVAL: "none", INTERVAL_LABEL: verdict.label, NOTE: verdict.note}
        return marked
    texts = {
        INTERVAL: ["none"] * len(verdicts),
        INTERVAL_LABEL: [verdict.label for verdict in verdicts.values()],
        NOTE: [verdict.note for verdict in verdicts.values()],
    }
    return marked.assign_coords(told_along(called, shape, texts))
