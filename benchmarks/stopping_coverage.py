"""How often intervals cover where a design stops at a wanted precision, by its first look.

Run it as ``python benchmarks/stopping_coverage.py``, with uqpen installed. Looks double. Targets
lie around the half-width that is usual at each look, as quantities and as shares of the estimate:
there chance decides most often when a design stops. Four thousand trials tell a coverage of 95 % to
0.3 points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson, student_quantile

FloatArray = npt.NDArray[np.float64]

TRIALS, AT_ONCE, MOST = 4000, 250, 32_768
FIRST_LOOKS = (8, 64, 512)
# Of the usual half-width at a look.
TARGETS = (0.85, 0.95, 1.0, 1.05, 1.2)


class Trials(NamedTuple):
    """Estimates of all trials at all looks, shape (trial, look), and the true value."""

    estimate: FloatArray
    half_width: FloatArray
    covers: npt.NDArray[np.bool_]
    truth: float


def main() -> None:
    looks = _looks(FIRST_LOOKS[0])
    print("problem, first look: coverage in % after a fixed number, at the worst and middle target")
    for name, (draw, truth, is_probability) in _problems(np.random.default_rng(17)).items():
        trials = _trials(draw, truth, looks, is_probability=is_probability)
        for first in FIRST_LOOKS:
            later = Trials(*(part[:, looks >= first] for part in trials[:3]), truth)
            reached = sorted(_coverages(later))
            fixed = 100 * later.covers[:, 0].mean()
            print(f"{name:14}{first:5}{fixed:7.1f}{reached[0]:7.1f}{np.median(reached):7.1f}")


def _looks(first: int) -> npt.NDArray[np.int64]:
    return first * 2 ** np.arange(int(np.log2(MOST // first)) + 1)


def _problems(
    rng: np.random.Generator,
) -> dict[str, tuple[Callable[[tuple[int, int]], FloatArray], float, bool]]:
    """Draws of an output, its mean, and whether that is a probability."""

    def ishigami(shape: tuple[int, int]) -> FloatArray:
        x1, x2, x3 = rng.uniform(-np.pi, np.pi, (3, *shape))
        y: FloatArray = np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)
        return y

    return {
        "Ishigami": (ishigami, 3.5, False),
        "exponential": (lambda shape: rng.exponential(size=shape), 1.0, False),
        "lognormal": (lambda shape: rng.lognormal(size=shape), float(np.exp(0.5)), False),
        "probability": (lambda shape: (rng.random(shape) < 0.137) * 1.0, 0.137, True),
    }


def _trials(
    draw: Callable[[tuple[int, int]], FloatArray],
    truth: float,
    looks: npt.NDArray[np.int64],
    *,
    is_probability: bool,
) -> Trials:
    parts = []
    for _ in range(TRIALS // AT_ONCE):
        values = draw((AT_ONCE, MOST))
        sums = values.cumsum(axis=1)[:, looks - 1]
        mean = sums / looks
        if is_probability:
            pairs = zip(sums.T, looks.tolist(), strict=True)
            bounds = [clopper_pearson(events, look, LEVEL) for events, look in pairs]
            lower, upper = np.moveaxis(np.array(bounds), 0, -1)
        else:
            squares = (values * values).cumsum(axis=1)[:, looks - 1] - looks * mean**2
            error = np.sqrt(squares / (looks - 1) / looks)
            half = error * [student_quantile(int(look) - 1, LEVEL) for look in looks]
            lower, upper = mean - half, mean + half
        parts.append((mean, (upper - lower) / 2, (lower <= truth) & (truth <= upper)))
    estimate, half_width, covers = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Trials(estimate, half_width, covers, truth)


def _coverages(trials: Trials) -> Iterator[float]:
    """Yield the coverage in per cent where trials stop at a target, for many targets."""
    usual = np.median(trials.half_width, axis=0)
    last = len(usual) - 1
    for half_width in np.outer(TARGETS, usual[:last]).ravel():
        for scale in (1.0, np.abs(trials.estimate / trials.truth)):
            is_precise = trials.half_width <= half_width * scale
            stop = np.where(is_precise.any(axis=1), is_precise.argmax(axis=1), last)
            yield float(100 * trials.covers[np.arange(len(stop)), stop].mean())


if __name__ == "__main__":
    main()
