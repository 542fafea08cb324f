"""How often intervals of least squares hold an unknown input, by what its errors are said to be.

A table of docs/measurements.md as `seed_table.py` makes it. One output, an unknown of a wide prior,
measurements with normal errors; what a study says of the errors is right or wrong.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from seed_table import Case, Row, SeedTable, lines, per_cent, totals

from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Input, Output
from uqpen.core.streams import Stream
from uqpen.designs.least_squares import LeastSquares
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal
from uqpen.execution import join_rounds
from uqpen.measurements import (
    Experiments,
    MeasuredOutput,
    MeasuredOutputs,
    MeasurementErrors,
    UnknownSize,
)
from uqpen.statistics.calibration import fit_statistics

Array = npt.NDArray[np.float64]
LEVEL, TRUTH = 0.9, 1.0


class Situation(NamedTuple):
    """Experiments at conditions x, and the model of what is measured there."""

    x: Array
    model: Callable[..., Array]  # of the unknown, x and what varies
    noise: Callable[[np.random.Generator, Array], Array]  # errors about values of the model
    errors: Callable[[Array, Array], MeasurementErrors]  # as stated, of x and of measured values
    varies: float = 0.0  # standard deviation of an input that varies about 1
    is_stated: bool = True  # whether it is said to vary


def _line(theta: Array, x: Array, strength: Array) -> Array:
    return theta * x / strength


def _stated(std: float, share: float = 0.0, **others: Any) -> Callable[..., MeasurementErrors]:
    return lambda x, y: MeasurementErrors(0 * x + std, 0 * x + share, **others)


def _shared(rng: np.random.Generator, f: Array) -> Array:
    return 0.1 * rng.standard_normal(len(f)) + 0.3 * np.repeat(rng.standard_normal(4), 3)


def _curve(rng: np.random.Generator, f: Array) -> Array:
    distance = np.abs(np.subtract.outer(np.arange(len(f)), np.arange(len(f))))
    lower = np.linalg.cholesky(0.9**distance)
    return 0.1 * lower @ rng.standard_normal(len(f))


_ROWS, _SHOTS = np.linspace(1.0, 3.0, 20), np.linspace(1.0, 2.1, 12)
_GROUPS = np.repeat(np.arange(4), 3)
SITUATIONS = {
    "strength varies, stated": Situation(
        _SHOTS, _line, lambda rng, f: 0.02 * f * rng.standard_normal(len(f)),
        _stated(0.0, 0.02), varies=0.1,
    ),
    "strength varies, said to be fixed": Situation(
        _SHOTS, _line, lambda rng, f: 0.02 * f * rng.standard_normal(len(f)),
        _stated(0.0, 0.02), varies=0.1, is_stated=False,
    ),
    **{
        f"{share:.0%} of the model's value": Situation(
            _ROWS, _line, lambda rng, f, share=share: share * f * rng.standard_normal(len(f)),
            _stated(0.0, share),
        )
        for share in (0.05, 0.1, 0.2)
    },
    **{
        f"{share:.0%}, of the measured value": Situation(
            _ROWS, _line, lambda rng, f, share=share: share * f * rng.standard_normal(len(f)),
            lambda x, y, share=share: MeasurementErrors(share * np.abs(y), 0 * x),
        )
        for share in (0.05, 0.1, 0.2)
    },
    "shared by three rows, stated": Situation(
        _SHOTS, _line, _shared,
        lambda x, y: MeasurementErrors(
            0 * x + 0.1, 0 * x, shared_std=0 * x + 0.3, shared_share=0 * x, group=_GROUPS
        ),
    ),
    "shared by three rows, taken as independent": Situation(
        _SHOTS, _line, _shared, _stated(np.sqrt(0.1))
    ),
    "size unknown": Situation(
        _ROWS, _line, lambda rng, f: 0.1 * rng.standard_normal(len(f)),
        _stated(0.0, size=UnknownSize("std of y", 1.0)),
    ),
    "size unknown beside 5 %": Situation(
        _ROWS, _line,
        lambda rng, f: np.hypot(0.1, 0.05 * f) * rng.standard_normal(len(f)),
        _stated(0.0, 0.05, size=UnknownSize("std of y", 1.0)),
    ),
}  # fmt: skip


def interval(seed: int, situation: Situation) -> tuple[float, float, float, int]:
    """Return the estimate of the unknown, the ends of its interval, and the number of points."""
    rng = Stream(seed, "measurements").generator()
    x = situation.x
    strength = 1 + situation.varies * rng.standard_normal(len(x))
    exact = situation.model(TRUTH, x, strength)
    y = exact + situation.noise(rng, exact)
    output = Output("y", "1")
    rows = np.arange(len(x))
    measured = MeasuredOutput(output, rows, {}, y, 0 * rows, rows + 1, situation.errors(x, y))
    varies = ("strength",) if situation.varies and situation.is_stated else ()
    fixed = () if varies else ("strength",)
    section = MeasuredOutputs("rows", ("theta",), varies, fixed, {"x": x}, {}, (measured,), len(x))
    design = LeastSquares(measured=("rows",), profile=False)
    design = replace(design, experiments=Experiments((section,)))
    variables = tuple(Input(name, "1", "") for name in ("theta", "strength", "x"))
    spreads = (0.5, situation.varies or 0.1, 1.0)
    joint = JointDistribution(
        tuple(
            RandomInput(each, Normal(1.0, std), "1")
            for each, std in zip(variables, spreads, strict=True)
        ),
        variables,
    )
    rounds = design.rounds(joint, Stream(seed, "designs", "fit"))
    made, points = [], next(rounds)
    while True:
        results = situation.model(*(points[each].values for each in ("theta", "x", "strength")))
        status = np.zeros(len(results), np.int8)
        made.append(points.assign({"y": (RUN, results), STATUS: (RUN, status)}))
        try:
            points = rounds.send(SimpleNamespace(runs={"": made[-1]}))
        except StopIteration:
            break
    runs = join_rounds(made, range(len(made)))
    found = dict(fit_statistics(design, joint, runs, LEVEL))["unknown_value"].values[0]
    return (*found.tolist(), runs.sizes[RUN] // len(x))


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    found = np.array([interval(seed, SITUATIONS[str(case[0])]) for seed in seeds])
    value, lower, upper, points = found.T
    yield {
        "covers": int(((lower <= TRUTH) & (upper >= TRUTH)).sum()),
        "off": float((value - TRUTH).sum()),
        "width": float((upper - lower).sum()),
        "points": int(points.sum()),
    }


SUMS = ("count", "covers", "off", "width", "points")


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ["errors", "data sets", "90 % intervals hold", "bias", "mean width", "points"]
    cells = totals(rows, KEYS, SUMS)
    yield from lines(head, (_line_of(*key, cell) for key, cell in cells.items()))


def _line_of(name: str, cell: Any) -> list[str]:
    means = (cell.off / cell.count, cell.width / cell.count, cell.points / cell.count)
    off, width, points = means
    held = f"{per_cent(cell.covers, cell.count)} %"
    return [name, f"{cell.count}", held, f"{off:+.1%}", f"{width:.3f}", f"{points:.0f}"]


KEYS = ("errors",)
TABLE = SeedTable(
    KEYS, lambda: ((name,) for name in SITUATIONS), _rows, {"errors": _page}, seeds=500, at_once=50
)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
