"""Designs made of independent replicates of one set of points that avoid each other."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.labels import REPLICATE
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.extension import Extension
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["ReplicatedDesign", "nested_replicates", "split_replicates", "uneven_replicates"]


class ReplicatedDesign(Design):
    """Design of independent replicates, each drawn from a generator of its own.

    A subclass is a dataclass with at least these fields.

    Attributes
    ----------
    runs, replicates : int
        Number of points in all, and number of replicates.
    """

    sampling = Sampling.STRATIFIED
    needs_powers_of_two: ClassVar[bool] = False
    """True if each replicate must have a power of two of points."""
    is_sequence: ClassVar[bool] = False
    """True if the points of a replicate are the first ones of a larger replicate."""

    runs: int
    replicates: int

    @abstractmethod
    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        """Draw one replicate: points of the unit cube."""

    def check_settings(self) -> Iterator[Problem]:
        return uneven_replicates(self.runs, self.replicates, powers_of_two=self.needs_powers_of_two)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        each, dimension = self.runs // self.replicates, len(joint.random)

        @lru_cache(maxsize=1)  # a block may end within a replicate, which the next one goes on with
        def replicate(number: int) -> FloatArray:
            return self.draw(stream.generator("points", number), each, dimension)

        def draw(start: int, stop: int) -> xr.Dataset:
            unit = [
                replicate(number)[max(start - number * each, 0) : stop - number * each]
                for number in range(start // each, -(-stop // each))
            ]
            numbers: npt.NDArray[Any] = np.arange(start, stop) // each
            return joint.points(np.concatenate(unit), {REPLICATE: numbers})

        yield DrawnPoints(each * self.replicates, draw)

    @property
    def replicate_count(self) -> int:
        return self.replicates

    def run_count(self, joint: JointDistribution) -> int:
        return self.runs

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if not isinstance(earlier, type(self)):
            return super().extension(earlier, joint)
        now, before = ((each.runs, each.replicates) for each in (self, earlier))
        if self.is_sequence:
            return nested_replicates(now, before, powers_of_two=self.needs_powers_of_two)
        each = earlier.runs // earlier.replicates
        is_same = self.runs // self.replicates == each
        replicates = max(earlier.replicates, round(self.runs / each))
        nearest = {"runs": each * replicates, "replicates": replicates}
        kept = min(self.runs, earlier.runs) if is_same else 0
        return Extension(kept, nearest, f"replicates of {each} points")


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
    most = min(2 * replicates, runs // 2)
    fewest = max(2, -(-replicates // 2))
    dividing = [number for number in range(fewest, most + 1) if runs % number == 0]
    if dividing:
        return runs, min(dividing, key=lambda number: abs(number - replicates))
    each = runs // replicates
    return (each * replicates, replicates) if each >= 2 else None
