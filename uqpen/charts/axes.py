"""Axes of charts: their ends, their ticks at round numbers, and what lies along them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqpen.charts.chart import Axis, PlottedQuantity
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import SUPERSCRIPTS, grouped_number
from uqpen.results.texts import plain_text

# Longest tail beyond 99 % of all values that an axis includes, relative to their range.
_LONG = 0.35
# Room at either end, and the powers of ten that numbers of double precision have.
_MARGIN = 0.03
_LARGEST_POWER = 307.0
# The note on an axis that leaves a tail out.
CUT = "axes end where all but 1 % lies inside"
_MOST_BINS, _FEWEST_BINS = 70, 8
# Thresholds between the ends of an axis, at the least.
_FEWEST_STEPS = 250
# Thresholds in a tenfold are round numbers of so many digits.
_ROUND = 3
# Ticks at the most, and the steps between powers of ten that are tried.
_MOST_TICKS = 6
_TICK_STEPS = ((1, 2, 5), (1, 3), (1,))
# Room at either end, and how many times the first value the last one is at least, by tenfolds.
_TICK_MARGIN, _SHORTEST = 0.08, 0.7


@dataclass(frozen=True)
class ValueAxis:
    """Axis of the values of an output, in the unit that is shown."""

    lower: float  # lower end; above 0 if it is logarithmic
    upper: float  # upper end
    is_cut: bool = False  # true if it leaves a long tail out
    is_logarithmic: bool = False  # true for the logarithm of the values

    @classmethod
    def of_values(
        cls,
        every: Sequence[FloatArray],
        marked: Sequence[float] = (),
        *,
        is_logarithmic: bool = False,
    ) -> ValueAxis:
        """Return the axis of some values, without their long tails; all marked values are on it.

        NaN are not counted, and 0 and negative values lie beyond the end of a logarithmic axis. A
        linear axis of values of one sign ends at 0.
        """
        ends = np.array([_limits(_places(values, is_logarithmic)) for values in every])
        shown = _places(np.asarray(marked, dtype=np.float64), is_logarithmic)
        lower = float(min([*ends[:, 0], *shown]))
        upper = float(max([*ends[:, 1], *shown]))
        margin = _MARGIN * (upper - lower) or (0.1 if is_logarithmic else 0.05 * abs(upper) or 1.0)
        first, last = lower - margin, upper + margin
        if is_logarithmic:
            first, last = max(first, -_LARGEST_POWER), min(last, _LARGEST_POWER)
        elif lower < upper:
            first = max(first, 0.0) if lower >= 0 else first
            last = min(last, 0.0) if upper <= 0 else last
        is_cut = bool((ends[:, 2] < first).any() or (ends[:, 3] > last).any())
        if is_logarithmic:
            first, last = 10.0**first, 10.0**last
        return cls(first, last, is_cut, is_logarithmic)

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends."""
        return self.lower, self.upper

    @property
    def powers(self) -> tuple[float, float]:
        """The powers of ten of both ends of a logarithmic axis."""
        return math.log10(self.lower), math.log10(self.upper)

    def contains(self, value: float) -> bool:
        """Check whether a value lies between the ends."""
        return self.lower <= value <= self.upper

    def share(self, value: float) -> float:
        """Return how far along the axis a value lies: 0 at its lower end, 1 at the upper one."""
        first, last = self.powers if self.is_logarithmic else self.ends
        place = math.log10(value) if self.is_logarithmic else value
        return (place - first) / (last - first)

    def value(self, share: float) -> float:
        """Return the value that lies so far along the axis."""
        first, last = self.powers if self.is_logarithmic else self.ends
        place = first + share * (last - first)
        return float(10.0**place) if self.is_logarithmic else place

    def bins(self, values: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the number of values in each bin, and the edges, from one end to the other."""
        bins = min(_MOST_BINS, max(_FEWEST_BINS, int(2 * values.size ** (1 / 2.5))))
        edges = np.linspace(self.lower, self.upper, bins + 1)
        if self.is_logarithmic:
            edges = np.geomspace(self.lower, self.upper, bins + 1)
        counts, edges = np.histogram(values, edges)
        return counts.astype(np.int64), edges

    def thresholds(self, values: FloatArray, marked: Sequence[float] = ()) -> FloatArray:
        """Return round thresholds from one end to the other, and the marked ones among them.

        On a linear axis their step is 1, 2 or 5 times a power of ten; on a logarithmic one they
        are as many in each tenfold. Where most of the values lie within few of these steps,
        quantiles of the values are thresholds as well, so that these can be distinguished.

        Parameters
        ----------
        values : ndarray
            Of the output; those beyond the ends are left out.
        marked : sequence of float
            Thresholds of the study that lie on the axis.
        """
        steps = self._round_steps()
        inside = values[(values >= self.lower) & (values <= self.upper)]
        if inside.size and _is_crowded(steps, inside):
            quantiles = np.quantile(inside, np.linspace(0, 1, _FEWEST_STEPS), method="nearest")
            rounded = [float(f"{value:.{_ROUND}g}") for value in quantiles.tolist()]
            steps = np.concatenate([steps, rounded])
        is_marked = np.isclose(steps[:, np.newaxis], np.asarray(marked), rtol=1e-9).any(axis=1)
        steps = np.unique([*steps[~is_marked].tolist(), *marked])
        return steps[(steps >= self.lower) & (steps <= self.upper)]

    def _round_steps(self) -> FloatArray:
        if self.is_logarithmic:
            places = np.geomspace(self.lower, self.upper, 2 * _FEWEST_STEPS)
            return np.unique([float(f"{value:.{_ROUND}g}") for value in places.tolist()])
        widest = (self.upper - self.lower) / _FEWEST_STEPS
        power = 10.0 ** math.floor(math.log10(widest))
        step = next(factor * power for factor in (5, 2, 1) if factor * power <= widest)
        decimals = max(0, -math.floor(math.log10(step) + 1e-9))
        numbers = np.arange(math.ceil(self.lower / step), math.floor(self.upper / step) + 1)
        return np.asarray(np.round(step * numbers, decimals), dtype=np.float64)

    def ticks(self) -> Iterator[tuple[float, str]]:
        """Yield the places that are marked on a logarithmic axis, with their texts."""
        return logarithmic_ticks(*self.powers)


def _places(values: FloatArray, is_logarithmic: bool) -> FloatArray:
    """Return the finite values, or their powers of ten; -inf for a value without one."""
    finite = values[np.isfinite(values)]
    if not is_logarithmic:
        return finite
    return np.where(finite > 0, np.log10(np.where(finite > 0, finite, 1.0)), -np.inf)


def _limits(places: FloatArray) -> tuple[float, float, float, float]:
    """Return the range without a long tail, then the lowest and the highest place."""
    known = places[np.isfinite(places)]
    low, high = np.quantile(known, [0.005, 0.995])
    reach = _LONG * (high - low)
    lower, upper = max(known.min(), low - reach), min(known.max(), high + reach)
    return lower, upper, places.min(), places.max()


def _is_crowded(steps: FloatArray, values: FloatArray) -> bool:
    """Check whether a tenth of the values lies between two neighbouring steps, but for equals."""
    distinct = np.unique(values)
    counts = np.diff(np.searchsorted(distinct, steps), prepend=0)
    return bool(counts.max(initial=0) > max(2, 0.1 * distinct.size))


def logarithmic_ticks(lower: float, upper: float) -> Iterator[tuple[float, str]]:
    """Yield round numbers between two powers of ten, written out where they are short."""
    found = [list(_ticks_between(lower, upper, steps)) for steps in _TICK_STEPS]
    chosen = next((each for each in found if len(each) <= _MOST_TICKS), found[-1])
    for step, power in chosen[:: -(-len(chosen) // _MOST_TICKS) or 1]:
        yield float(f"{step}e{power}"), _tick_text(step, power)


def _ticks_between(lower: float, upper: float, steps: Sequence[int]) -> Iterator[tuple[int, int]]:
    for power in range(math.floor(lower), math.ceil(upper) + 1):
        for step in steps:
            if lower <= math.log10(step) + power <= upper:
                yield step, power


def _tick_text(step: int, power: int) -> str:
    """Write out a short number; others as a power of ten."""
    if 0 <= power < 6:
        return grouped_number(step * 10**power)
    if -5 < power < 0:
        return f"{step * 10.0**power:.{-power}f}"
    written = f"10{str(power).translate(SUPERSCRIPTS)}"
    return written if step == 1 else f"{step}×{written}"


def quantity(view: ArchiveView, name: str) -> PlottedQuantity:
    """Return an input or an output with its unit, as charts have it in common."""
    unit = view.unit(name)
    return PlottedQuantity(name, "" if unit == DIMENSIONLESS else unit)


def quantity_axis(view: ArchiveView, name: str, ends: tuple[float, float] | None = None) -> Axis:
    """Return the axis of an input or an output, under its label."""
    if labels := view.code_labels(name):  # places without an order, and no numbers
        ticks = tuple((float(place), plain_text(label, 30)) for place, label in enumerate(labels))
        ends = -0.5, len(labels) - 0.5
        return Axis(view.axis_label(name), ends, ticks=ticks, quantity=quantity(view, name))
    return Axis(view.axis_label(name), ends, quantity=quantity(view, name))


def output_axis(view: ArchiveView, name: str, span: ValueAxis) -> Axis:
    """Return the axis of an output between two ends, with ticks of its own if logarithmic."""
    axis = quantity_axis(view, name, span.ends)
    if not span.is_logarithmic:
        return axis
    return replace(axis, ends=span.powers, is_logarithmic=True, ticks=tuple(span.ticks()))


def padded_limits(lower: float, upper: float, share: float = 0.03) -> tuple[float, float]:
    """Return the ends of an axis: two values, extended by a share of their distance."""
    margin = share * (upper - lower) or 0.05 * abs(upper) or 1.0
    return lower - margin, upper + margin


def logarithmic_axis(title: str, values: Iterable[float]) -> Axis:
    """Return a logarithmic axis that includes some values, all of them above zero."""
    powers = [math.log10(value) for value in values]
    lower, upper = min(powers), max(powers)
    margin = max(_TICK_MARGIN * (upper - lower), (_SHORTEST - (upper - lower)) / 2, 0.05)
    ends = (round(lower - margin, 6), round(upper + margin, 6))
    return Axis(title, ends, is_logarithmic=True, ticks=tuple(logarithmic_ticks(*ends)))
