"""Independent draws of the inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, toml_text
from uqpen.core.limits import MOST_RUNS
from uqpen.core.sampling import Sampling
from uqpen.core.settings import Context, count, setting
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.design import Design, Extension, Rounds, keep_problems, keep_setting
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.stopping.acceptance_claim import CLAIM, deciding_rounds, is_claim, parse_claim
from uqpen.designs.stopping.stopping_rule import (
    FIRST_LOOK,
    RequestedOutput,
    StoppingRule,
    doubling_rounds,
    stopping_rule,
)
from uqpen.distributions.joint_distribution import JointDistribution

if TYPE_CHECKING:
    import xarray as xr

_RUNS = f"a whole number, at least 1 and at most {MOST_RUNS:_}"


def _read_claim(written: Any, _: Context) -> Any:
    """Read the text of a claim, so that a message says what is wrong with it."""
    if isinstance(written, str):
        parse_claim(written)
    return written


@dataclass(frozen=True)
class MonteCarlo(Design):
    """Plain Monte Carlo: independent draws from the joint distribution of the inputs.

    Parameters
    ----------
    runs : int, optional
        Number of points. A larger number keeps the points of a smaller one.
    until : StoppingRule, optional
        In place of `runs`: the rule that decides after 512 runs, and whenever their number has
        doubled, whether they are enough.
    accept : str, optional
        In place of `runs`: a claim such as ``"P(depth > 60 cm) < 0.2"``. The design ends as soon as
        the runs decide whether it holds.
    at_most : int, optional
        With `until` or `accept`, the largest number of runs.
    keep : str
        ``"statistics"`` leaves the runs out of the archive, which then has their statistics, their
        number by status and their hashes.
    """

    sampling = Sampling.INDEPENDENT
    takes_boxes = True

    runs: int | None = count(default=None, maximum=MOST_RUNS)
    until: StoppingRule | None = stopping_rule("until")
    accept: str | None = setting("claim", CLAIM, is_claim, _read_claim, default=None)
    at_most: int | None = count(default=None)
    keep: str = keep_setting()

    def check_settings(self) -> Iterator[Problem]:
        rule = self._rule
        if self.until is not None and self.accept is not None:
            yield Problem(("accept",), toml_text(self.accept), "until or accept, not both")
        elif rule and self.runs is not None:
            yield Problem(("runs",), str(self.runs), f"at_most, beside {rule}")
        elif rule and self.at_most is None:
            yield Problem(("at_most",), "nothing", f"the largest number of runs, beside {rule}")
        elif self.until and self.at_most is not None and self.at_most < 2 * FIRST_LOOK:
            expected = f"a whole number, at least {2 * FIRST_LOOK}, beside until"
            yield Problem(("at_most",), str(self.at_most), expected)
        elif not rule and self.at_most is not None:
            expected = "runs in its place, or until beside it, or accept"
            yield Problem(("at_most",), str(self.at_most), expected)
        elif not rule and self.runs is None:
            yield Problem(("runs",), "nothing", f"{_RUNS}; or until with at_most, or accept")
        yield from keep_problems(self.keep, rule)

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        rule = self.until if self.accept is None else parse_claim(self.accept)
        if rule is not None:
            for problem in rule.check_outputs(requested):
                yield problem.within(self._rule)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        points = partial(independent_points, joint, stream)
        if self.accept is not None:
            yield from deciding_rounds(parse_claim(self.accept), self._most, points)
        elif self.until is not None:
            yield from doubling_rounds(self.until, self._most, points)
        else:
            yield points(0, self._most)

    @property
    def ends_early(self) -> bool:
        return bool(self._rule)

    def run_count(self, joint: JointDistribution) -> int:
        return self._most

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if not isinstance(earlier, MonteCarlo):
            return super().extension(earlier, joint)
        setting = "runs" if self.until is None else "at_most"
        nearest = {setting: max(self._most, earlier._most)}
        return Extension(min(self._most, earlier._most), nearest, "no fewer runs")

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> MonteCarlo | None:
        return None if replicated else MonteCarlo(runs)

    @property
    def _rule(self) -> str:
        """Key of the setting that decides the number of runs; empty where it is fixed."""
        return "accept" if self.accept is not None else "until" if self.until is not None else ""

    @property
    def _most(self) -> int:
        """Number of runs, or the largest possible number."""
        most = self.at_most if self._rule else self.runs
        assert most is not None  # as the settings are valid
        return most


def independent_points(
    joint: JointDistribution, stream: Stream, first: int, end: int
) -> DrawnPoints:
    """Return the independent draws of a stream from one number to another, the last excluded."""

    def draw(start: int, stop: int) -> xr.Dataset:
        unit = _draw(stream, len(joint.random), first + start, first + stop)
        return joint.points(unit, {})

    return DrawnPoints(end - first, draw)


def _draw(stream: Stream, dimension: int, start: int, end: int) -> FloatArray:
    """Draw points of the unit cube from one number to another, each block by its own generator."""
    blocks = []
    for block in range(start // BLOCK, -(-end // BLOCK)):
        first = block * BLOCK
        unit = stream.generator("points", block).random((min(BLOCK, end - first), dimension))
        blocks.append(unit[max(start - first, 0) :])
    return np.concatenate(blocks)
