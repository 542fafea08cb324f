"""How often intervals of least squares hold an unknown input, by what its errors are said to be.

A table of docs/measurements.md as `seed_table.py` makes it. One output, an unknown of a wide prior,
measurements with normal errors; what a study says of the errors is right or wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from problems import independent, runs_of, with_output
from seed_table import Row, SeedTable, share_of, summed

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN
from uqpen.core.model import Output
from uqpen.core.streams import Stream
from uqpen.designs.least_squares import LeastSquares
from uqpen.distributions.univariate import Normal
from uqpen.measurements.errors import MeasuredOutput, MeasurementErrors, UnknownSize
from uqpen.measurements.experiments import Experiments, MeasuredOutputs
from uqpen.statistics.calibration import fit_statistics

LEVEL, TRUTH = 0.9, 1.0


class Situation(NamedTuple):
    """Experiments at conditions x, and the model of what is measured there."""

    x: FloatArray
    model: Callable[..., FloatArray]  # of the unknown, x and what varies
    noise: Callable[..., FloatArray]  # errors about values of the model
    errors: Callable[..., MeasurementErrors]  # as stated, of x and of measured values
    varies: float = 0.0  # standard deviation of an input that varies about 1
    is_stated: bool = True  # whether it is said to vary


def _line(theta: FloatArray, x: FloatArray, strength: FloatArray) -> FloatArray:
    return theta * x / strength


def _stated(std: float, share: float = 0.0, **others: Any) -> Callable[..., MeasurementErrors]:
    return lambda x, y: MeasurementErrors(0 * x + std, 0 * x + share, **others)


def _shared(rng: np.random.Generator, f: FloatArray) -> FloatArray:
    return 0.1 * rng.standard_normal(len(f)) + 0.3 * np.repeat(rng.standard_normal(4), 3)


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
        _stated(0.0, size=UnknownSize("std of y", 1.0, "1", "")),
    ),
    "size unknown beside 5 %": Situation(
        _ROWS, _line,
        lambda rng, f: np.hypot(0.1, 0.05 * f) * rng.standard_normal(len(f)),
        _stated(0.0, 0.05, size=UnknownSize("std of y", 1.0, "1", "")),
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
    joint = independent(
        theta=Normal(1.0, 0.5), strength=Normal(1.0, situation.varies or 0.1), x=Normal(1.0, 1.0)
    )

    def make(points: xr.Dataset) -> xr.Dataset:
        columns = (points[each].values for each in ("theta", "x", "strength"))
        return with_output(points, situation.model(*columns))

    runs = runs_of(design, joint, Stream(seed, "designs", "fit"), make)
    found = dict(fit_statistics(design, joint, runs, LEVEL))["unknown_value"].values[0]
    return (*found.tolist(), runs.sizes[RUN] // len(x))


def _rows(errors: str, seeds: Sequence[int]) -> Iterator[Row]:
    found = np.array([interval(seed, SITUATIONS[errors]) for seed in seeds])
    value, lower, upper, points = found.T
    yield {
        "covers": int(((lower <= TRUTH) & (upper >= TRUTH)).sum()),
        "off": float((value - TRUTH).sum()),
        "width": float((upper - lower).sum()),
        "points": int(points.sum()),
    }


COLUMNS = {
    "errors": "errors",
    "data sets": "count",
    "90 % intervals hold": share_of("covers"),
    "bias": lambda c: f"{c.off / c.count:+.1%}",
    "mean width": lambda c: f"{c.width / c.count:.3f}",
    "points": lambda c: f"{c.points / c.count:.0f}",
}
TABLE = SeedTable(
    {"errors": SITUATIONS}, _rows, {"errors": summed(COLUMNS, "errors")}, seeds=500, at_once=50
)

if __name__ == "__main__":
    TABLE.main(__doc__)
