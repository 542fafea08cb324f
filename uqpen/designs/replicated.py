"""Designs made of independent replicates of one set of points that avoid each other."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.labels import REPLICATE
from uqpen.core.limits import MOST_REPLICATES, MOST_RUNS
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Extension, Rounds, keep_problems
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.stopping.stopping_rule import (
    FIRST_LOOK,
    RequestedOutput,
    StoppingRule,
    doubling_rounds,
)
from uqpen.distributions.joint_distribution import JointDistribution

if TYPE_CHECKING:
    import xarray as xr

# Where sets ended at a target of a quantile, its intervals of nominal 95 % covered in 91 % at the
# worst target; those of other statistics covered in 93 % or more (docs/coverage.md).
_WITHOUT_QUANTILES = (
    'mean, standard_deviation, exceeds or below; or kind = "monte-carlo": over replicates, the '
    "interval of a quantile covers too seldom where the runs decide their number"
)


class ReplicatedDesign(Design):
    """Design of independent replicates, each drawn from a generator of its own.

    A subclass is a dataclass with at least the fields `runs` and `replicates`. One that has `until`
    and `at_most` as well can decide the number of its runs.

    Attributes
    ----------
    runs : int or None
        Number of points in all; with `until`, those of the first look, 512 or some more by default.
    replicates : int or None
        Number of replicates, by default `default_replicates`; with `until`, that of the first look,
        by default `least_stopped`.
    until : StoppingRule or None
        The rule that decides whether the points are enough, whenever their number has doubled.
    at_most : int or None
        With `until`, the largest number of points.
    """

    sampling = Sampling.STRATIFIED
    needs_powers_of_two: ClassVar[bool] = False
    """True if each replicate must have a power of two of points."""
    is_sequence: ClassVar[bool] = False
    """True if the points of a replicate are the first ones of a larger replicate."""
    default_replicates: ClassVar[int] = 16
    """Number of replicates if none is given."""
    least_stopped: ClassVar[int] = 32
    """Least number of replicates with which it may decide the number of its runs."""

    runs: int | None
    replicates: int | None
    until: StoppingRule | None = None
    at_most: int | None = None

    @abstractmethod
    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        """Draw one replicate: points of the unit cube."""

    def check_settings(self) -> Iterator[Problem]:
        is_uneven = False
        if self.runs is not None:
            for problem in uneven_replicates(
                self.runs, self.replicate_count, powers_of_two=self.needs_powers_of_two
            ):
                is_uneven = True
                yield problem
        if self.until is not None:
            yield from () if is_uneven else self._stopping_problems()
        elif self.at_most is not None:
            expected = "runs in its place, or until beside it"
            yield Problem(("at_most",), str(self.at_most), expected)
        elif self.runs is None:
            expected = (
                f"a whole number, at least 2 and at most {MOST_RUNS:_}; or until with at_most"
            )
            yield Problem(("runs",), "nothing", expected)
        yield from keep_problems(self.keep, "until" if self.until is not None else "")

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        if self.until is None:
            return
        for problem in self.until.check_outputs(requested):
            yield problem.within("until")
        for output, statistic, label in self.until.statistics():
            if statistic == "quantile":
                yield Problem(("until", output), f"the {label} quantile", _WITHOUT_QUANTILES)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        def points(start: int, end: int) -> DrawnPoints:
            return self.drawn_points(joint, stream, start, end)

        most = self.run_count(joint)
        if self.until is None:
            yield points(0, most)
            return
        intervals = f"over {self.replicate_count} replicates"
        intervals += "" if self.is_sequence else " or more"
        yield from doubling_rounds(
            self.until, most, points, first=self.first_runs, intervals=intervals
        )

    def drawn_points(
        self, joint: JointDistribution, stream: Stream, start: int, end: int
    ) -> DrawnPoints:
        """Return the points that the design has with a number of runs, and not with a smaller one.

        Parameters
        ----------
        joint : JointDistribution
            The inputs.
        stream : Stream
            Source of the random numbers.
        start, end : int
            The numbers of runs. Replicates of a sequence grow, others become more.
        """
        count, dimension = self.replicate_count, len(joint.random)
        each, skipped, first = self._points_of_each, 0, 0
        if self.is_sequence:
            each, skipped = (end - start) // count, start // count
        else:
            first = start // each

        @lru_cache(maxsize=1)  # a block may end within a replicate, which the next one goes on with
        def replicate(number: int) -> Callable[[int, int], FloatArray]:
            rng = stream.generator("points", first + number)
            return self.points_between(rng, skipped + each, dimension)

        def points_of(number: int, start: int, stop: int) -> FloatArray:
            begin, end = max(start, number * each), min(stop, (number + 1) * each)
            offset = skipped - number * each
            return replicate(number)(offset + begin, offset + end)

        def draw(start: int, stop: int) -> xr.Dataset:
            numbers_of_sets = range(start // each, -(-stop // each))
            unit = [points_of(number, start, stop) for number in numbers_of_sets]
            numbers: npt.NDArray[Any] = first + np.arange(start, stop) // each
            return joint.points(np.concatenate(unit), {REPLICATE: numbers})

        return DrawnPoints(end - start, draw)

    def points_between(
        self, rng: np.random.Generator, points: int, dimension: int
    ) -> Callable[[int, int], FloatArray]:
        """Return what draws the points of a replicate from one number to another.

        Here all are drawn at once.
        """
        whole = self.draw(rng, points, dimension)
        return lambda start, stop: whole[start:stop]

    @property
    def replicate_count(self) -> int:
        if self.replicates is not None:
            return self.replicates
        return self.default_replicates if self.until is None else self.least_stopped

    @property
    def ends_early(self) -> bool:
        return self.until is not None

    def run_count(self, joint: JointDistribution) -> int:
        return self._most

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if not isinstance(earlier, type(self)):
            return super().extension(earlier, joint)
        now, before = ((each._most, each.replicate_count) for each in (self, earlier))
        if self.is_sequence:
            found = nested_replicates(now, before, powers_of_two=self.needs_powers_of_two)
        else:
            found = self._more_replicates(earlier)
        # Which settings of looks that double would keep all is not looked for.
        return found if self.until is None else replace(found, nearest={})

    def _more_replicates(self, earlier: ReplicatedDesign) -> Extension:
        """Return what replicates of a fixed number of points keep of earlier ones."""
        each = earlier._points_of_each
        is_same = self._points_of_each == each
        replicates = max(earlier._most // each, round(self._most / each))
        nearest = {"runs": each * replicates, "replicates": replicates}
        kept = min(self._most, earlier._most) if is_same else 0
        return Extension(kept, nearest, f"replicates of {each} points")

    def _stopping_problems(self) -> Iterator[Problem]:
        """Yield the problems of settings beside `until`."""
        if self.replicate_count < self.least_stopped:
            expected = f"at least {self.least_stopped} beside until: of fewer, standard errors "
            expected += "scatter more, and looks that end at the smallest cover less often"
            yield Problem(("replicates",), str(self.replicate_count), expected)
        elif self.first_runs < FIRST_LOOK:
            expected = f"at least {FIRST_LOOK} at the first look of until, or nothing"
            yield Problem(("runs",), str(self.first_runs), expected)
        elif self.at_most is None:
            yield Problem(("at_most",), "nothing", "the largest number of runs, beside until")
        elif self.at_most < 2 * self.first_runs:
            expected = f"a whole number, at least {2 * self.first_runs}, beside until"
            yield Problem(("at_most",), str(self.at_most), expected)

    @property
    def _points_of_each(self) -> int:
        """Number of points of a replicate; of a sequence that decides it, at the first look."""
        if self.runs is not None:
            return self.runs // self.replicate_count
        each = -(-FIRST_LOOK // self.replicate_count)
        return max(2, 1 << (each - 1).bit_length() if self.needs_powers_of_two else each)

    @property
    def first_runs(self) -> int:
        """Number of runs at the first look, or of all."""
        return self._points_of_each * self.replicate_count

    @property
    def _most(self) -> int:
        """Number of runs, or the largest possible number: a doubled first look."""
        if self.at_most is None:
            return self.first_runs
        return self.first_runs << ((self.at_most // self.first_runs).bit_length() - 1)


def uneven_replicates(
    runs: int, replicates: int, *, powers_of_two: bool = False, setting: str = "runs"
) -> Iterator[Problem]:
    """Yield a problem if runs cannot be split into replicates, with the nearest number that can.

    Parameters
    ----------
    runs, replicates : int
        Values of the settings.
    powers_of_two : bool
        Whether each replicate must have a power of two of points.
    setting : str
        Name of the number of points in the design's settings.
    """
    each, left = divmod(runs, replicates)
    is_power = each & (each - 1) == 0
    if each >= 2 and not left and (is_power or not powers_of_two):
        return
    lower = max(each, 1)
    if powers_of_two:
        lower = 1 << (lower.bit_length() - 1)
    upper = 2 * lower if powers_of_two else lower + 1
    nearest = [str(size * replicates) for size in (lower, upper) if size >= 2]
    shape = " times a power of two" if powers_of_two else ""
    expected = f"a multiple of replicates ({replicates}){shape}, at least two points in each"
    expected += f", such as {' or '.join(nearest)}, or other replicates"
    yield Problem((setting,), str(runs), expected)


def nested_replicates(
    now: tuple[int, int],
    before: tuple[int, int],
    *,
    powers_of_two: bool = False,
    setting: str = "runs",
) -> Extension:
    """Return what replicates of a sequence keep of earlier ones, which may be fewer or smaller.

    Parameters
    ----------
    now, before : tuple of int
        Number of points in all, and number of replicates.
    powers_of_two : bool
        Whether each replicate must have a power of two of points.
    setting : str
        Name of the number of points in the design's settings.
    """
    fewest, most = sorted((now[1], before[1]))
    each = before[0] // before[1]
    kept = fewest * min(now[0] // now[1], each)
    size = max(each, -(-now[0] // most))
    if powers_of_two:
        size = 1 << (size - 1).bit_length()
    nearest = {setting: size * most, "replicates": most}
    return Extension(kept, nearest, f"no fewer replicates than {before[1]}, of {each} points each")


def split_replicates(runs: int, replicates: int, *, replicated: bool) -> tuple[int, int] | None:
    """Split runs into about a given number of replicates of at least two points each.

    The nearest number of replicates that divides the runs is taken, from half to twice as many as
    given. If there is none, some of the runs are left out. Without replicates, all are one set.

    Returns
    -------
    runs, replicates : int
        None where there are too few runs, or the design has no replicates.
    """
    if not replicated:
        return (runs, 1) if runs >= 2 else None
    if replicates < 2:
        return None
    most = min(2 * replicates, runs // 2, MOST_REPLICATES)
    fewest = max(2, -(-replicates // 2))
    dividing = [number for number in range(fewest, most + 1) if runs % number == 0]
    if dividing:
        return runs, min(dividing, key=lambda number: abs(number - replicates))
    each = runs // replicates
    return (each * replicates, replicates) if each >= 2 else None
