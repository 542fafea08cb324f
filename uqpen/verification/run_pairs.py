"""Runs of a model with noise, made again: whether they are of the same distribution as before."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.special
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import STATUS
from uqpen.core.model import Output
from uqpen.core.status import BY_MACHINE, Status
from uqpen.results.digits import count_text
from uqpen.statistics.input_columns import Ordering
from uqpen.verification.check_result import CheckOutcome, CheckResult

# Honest archives of which one is called unlikely: 1 in 1000.
LEVEL = 0.001
# Runs that are repeated by default: a shift of 0.3 standard deviations is found among them.
DEFAULT_RUNS = 1000

_FLIPS, _AT_ONCE = 4999, 500
# Fewer pairs have no outcome as unlikely as the level.
_FEWEST = 12
# Places of a field whose values are compared.
_MOST_PLACES = 64
# Probability of finding the shift that the line states, as a deviation of a normal distribution.
_POWER, _POWER_TEXT = 1.2816, "nine of ten"


@dataclass
class RunPairs:
    """Runs as they are archived, and as they are made again at the same inputs.

    If the archive is honest, it is a toss of a coin which of the two is the archived one. So the
    signs of all differences may be flipped, run by run, which gives a test of an exact level
    without any assumption on the distribution. The statistic is the largest, over the outputs, of
    two sums of differences over their size: of normal scores, which a shift moves, and of their
    squares, which another spread moves. All outputs of a run are flipped together, so there is one
    level for the archive. Whether a run completes is an output.
    """

    _columns: list[tuple[str, int, FloatArray]] = field(default_factory=list)
    _runs: int = 0
    _deviations: list[tuple[float, int]] = field(default_factory=list)

    def add(
        self, name: str, archived: xr.Dataset, again: xr.Dataset, outputs: Sequence[Output]
    ) -> None:
        """Add runs of a design and a model, under its name."""
        start, size = self._runs, len(archived[STATUS])
        self._runs += size
        statuses = [each[STATUS].values for each in (archived, again)]
        own = ~np.any([np.isin(each, BY_MACHINE) for each in statuses], axis=0)
        failed = [(each != Status.OK).astype(np.float64) for each in statuses]
        self._add(f"{name}: {STATUS}", start, np.where(own, failed[1] - failed[0], 0.0))
        completed = ~np.any(failed, axis=0)
        for output in outputs:
            one, other = (each[output.name].values for each in (archived, again))
            label = f"{name}: {output.name}"
            if output.categories:
                for code in range(len(output.categories)):
                    change = (other == code).astype(np.float64) - (one == code)
                    self._add(label, start, np.where(completed, change, 0.0))
                continue
            for before, now in _places(one, other):
                known = completed & np.isfinite(before) & np.isfinite(now)
                for differences in self._scores(before[known], now[known]):
                    column = np.zeros(size)
                    column[known] = differences
                    self._add(label, start, column)

    def result(self, what: str, rng: np.random.Generator) -> CheckResult:
        """Return the result of the test; `what` says how many runs were repeated."""
        if self._runs < _FEWEST:
            text = f"{what}: {count_text(self._runs, 'run')} of a model with noise show nothing"
            return CheckResult("runs", CheckOutcome.UNCHECKED, text)
        matrix = np.zeros((self._runs, len(self._columns)))
        for position, (_, start, column) in enumerate(self._columns):
            matrix[start : start + len(column), position] = column
        size = np.sqrt((matrix**2).sum(axis=0))
        matrix /= np.where(size > 0, size, 1.0)
        found = np.abs(matrix.sum(axis=0))
        flipped = np.concatenate(list(_largest_flipped(matrix, rng)))
        p = (1 + np.count_nonzero(flipped >= found.max() * (1 - 1e-12))) / (1 + _FLIPS)
        if p > LEVEL:
            text = f"{what}: of the same distribution as far as they show (p = {p:.2g})"
            return CheckResult("runs", CheckOutcome.LIKELY, text, tuple(self._power(flipped)))
        names = [name for name, _, _ in self._columns]
        details = (f"most of all {names[int(found.argmax())]}", *self._power(flipped))
        text = f"{what}: unlikely (p = {p:.2g}) to be of the distribution of the archived ones"
        return CheckResult("runs", CheckOutcome.UNLIKELY, text, details)

    def _add(self, name: str, start: int, column: FloatArray) -> None:
        self._columns.append((name, start, column))

    def _scores(self, before: FloatArray, now: FloatArray) -> Iterator[FloatArray]:
        """Yield the differences of normal scores among both, and of their squares."""
        ranks = Ordering.of(np.concatenate([before, now])).mean_ranks
        one, other = np.split(scipy.special.ndtri(ranks / (len(ranks) + 1)), 2)
        if len(before):
            deviation = math.sqrt(float(((other - one) ** 2).mean()))
            self._deviations.append((deviation, len(before)))
        yield other - one
        yield other**2 - one**2

    def _power(self, flipped: FloatArray) -> Iterator[str]:
        """Yield the shift of any output that these runs would have shown."""
        if not self._deviations:
            return
        critical = float(np.quantile(flipped, 1 - LEVEL)) + _POWER
        shift = max(critical * deviation / math.sqrt(runs) for deviation, runs in self._deviations)
        yield (
            f"a shift of any output by {shift:.2g} of its standard deviations is found in "
            f"{_POWER_TEXT} archives, and {LEVEL:.1%} of honest ones are called unlikely"
        )


def _places(one: FloatArray, other: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the values of a number, or of a field at some of its places, before and now."""
    before, now = (each.reshape(len(each), -1) for each in (one, other))
    places = before.shape[1]
    for place in np.unique(np.linspace(0, places - 1, min(places, _MOST_PLACES)).astype(int)):
        yield before[:, place], now[:, place]


def _largest_flipped(matrix: FloatArray, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Yield the largest statistic with random signs of the runs, some at a time."""
    for start in range(0, _FLIPS, _AT_ONCE):
        number = min(_AT_ONCE, _FLIPS - start)
        signs: BoolArray = rng.integers(2, size=(number, len(matrix)), dtype=np.int8).astype(bool)
        yield np.abs(np.where(signs, 1.0, -1.0) @ matrix).max(axis=1)
