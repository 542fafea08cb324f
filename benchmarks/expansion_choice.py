"""Polynomial chaos that chooses its truncation, order and terms, beside 18 fixed settings.

A table as `seed_table.py` makes it, of docs/surrogates.md: the mean square error at fresh runs as a
share of the variance, medians over designs; of the 18 settings the best and the worst by hindsight,
which ``--only chosen`` leaves out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from gaussian_process import borehole, ishigami
from problems import independent
from seed_table import Row, SeedTable, grouped, lines, medians

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.univariate import Lognormal, Normal, Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos

FRESH = 5_000
# Six truncations, each with the order that cross-validation chooses and with two others.
CHOSEN = "chosen"
SETTINGS: dict[str, dict[str, Any]] = {CHOSEN: {}} | {
    f"q {truncation}, order {order}": {"truncation": truncation, "order": order}
    for truncation, order in product((0.4, 0.5, 0.6, 0.75, 0.9, 1.0), (None, 3, 5))
}


@dataclass(frozen=True)
class Problem(Model):
    """A function of random inputs."""

    function: Callable[..., FloatArray]
    distributions: dict[str, Distribution]

    name = "problem"
    outputs = (Output("y", "1"),)

    @property
    def inputs(self) -> tuple[Input, ...]:  # type: ignore[override]
        """Its inputs."""
        return tuple(Input(name, "1") for name in self.distributions)

    @property
    def joint(self) -> JointDistribution:
        """Their joint distribution."""
        return independent(**self.distributions)

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the values of the function."""
        return Results.all_ok({"y": self.function(**inputs)})


def of_columns(function: Callable[[FloatArray], FloatArray]) -> Callable[..., FloatArray]:
    """Return a function of columns by name, from one of an array (run, input)."""
    return lambda **columns: function(np.column_stack(list(columns.values())))


def oscillator(
    m: FloatArray, c1: FloatArray, c2: FloatArray, r: FloatArray, t: FloatArray, f: FloatArray
) -> FloatArray:
    """Rackwitz' undamped oscillator under a rectangular pulse."""
    square = (c1 + c2) / m
    return 3 * r - np.abs(2 * f / (m * square) * np.sin(np.sqrt(square) * t / 2))


def hundred(**inputs: FloatArray) -> FloatArray:
    """The 100 inputs of UQLab's high-dimensional example, with four interactions."""
    x = np.array(list(inputs.values()))
    k = np.arange(1, 101)[:, None]
    sums = -5 * (k * x).sum(axis=0) + (k * x**3).sum(axis=0)
    sums += (k * np.log(x**2 + x**4)).sum(axis=0) / 3
    pairs = x[0] * x[1] ** 2 + x[1] * x[3] - x[2] * x[4] + x[49] * x[53] ** 2
    return 3 + sums / 100 + pairs + x[50]


def rough(a: FloatArray, b: FloatArray) -> FloatArray:
    """No polynomial of a few hundred runs is any good for it."""
    return np.sign(np.sin(40 * a) * np.sin(37 * b))


# Lognormal of the logarithm's mean 7.71 and standard deviation 1.0056.
RADIUS = math.exp(7.71 + 1.0056**2 / 2)
BOREHOLE: dict[str, Distribution] = {
    "rw": Normal(0.1, 0.0161812),
    "r": Lognormal(RADIUS, RADIUS * math.sqrt(math.expm1(1.0056**2))),
    "tu": Uniform(63_070, 115_600),
    "hu": Uniform(990, 1_110),
    "tl": Uniform(63.1, 116),
    "hl": Uniform(700, 820),
    "length": Uniform(1_120, 1_680),
    "kw": Uniform(9_855, 12_045),
}
OSCILLATOR: dict[str, Distribution] = {
    "m": Normal(1, 0.05),
    "c1": Normal(1, 0.1),
    "c2": Normal(0.1, 0.01),
    "r": Normal(0.5, 0.05),
    "t": Normal(1, 0.2),
    "f": Normal(1, 0.2),
}
HUNDRED: dict[str, Distribution] = {
    f"x{k}": Uniform(1.0, 3.0 if k == 20 else 2.0) for k in range(1, 101)
}
ISHIGAMI: dict[str, Distribution] = dict.fromkeys("abc", Uniform(-math.pi, math.pi))
PROBLEMS: dict[str, tuple[Problem, tuple[int, ...]]] = {
    "ishigami": (Problem(of_columns(ishigami), ISHIGAMI), (50, 150)),
    "borehole": (Problem(of_columns(borehole), BOREHOLE), (100, 250)),
    "oscillator": (Problem(oscillator, OSCILLATOR), (60, 120)),
    "hundred": (Problem(hundred, HUNDRED), (500,)),
    "rough": (Problem(rough, dict.fromkeys("ab", Uniform(0.0, 1.0))), (100,)),
}
# The standard deviation of the noise as a share of the output's.
NOISES = (0.0, 0.5)


def _rows(
    problem: str, noise: float, runs: int, setting: str, seeds: Sequence[int]
) -> Iterator[Row]:
    """Yield the error and the time of a fit, and what it chose; not where it has too many terms."""
    of = PROBLEMS[problem][0]
    fresh = points_in_memory(next(MonteCarlo(FRESH).rounds(of.joint, Stream(0, "fresh"))))
    inputs = {name: fresh[name].values for name in of.distributions}
    truth = of.function(**inputs)
    for seed in seeds:
        points = next(LatinHypercube(runs, 1).rounds(of.joint, Stream(seed, "designs", "d")))
        training = evaluate(Evaluator(of), points, {})
        scatter = np.random.default_rng(seed).normal(0, noise * truth.std(), runs)
        start = time.process_time()
        surrogate = PolynomialChaos(design="d", **SETTINGS[setting])
        training = training.assign(y=training.y + scatter)
        found = surrogate.fit("pce", training, of, of.joint, Stream(seed, "surrogates"))
        seconds = time.process_time() - start
        if found.reasons:
            continue
        expansion = found.expansions["y"]
        yield {
            "error": float(np.mean((found.predict(inputs)["y"].mean - truth) ** 2) / truth.var()),
            "truncation": expansion.truncation,
            "order": expansion.order,
            "terms": len(expansion.indices),
            "seconds": seconds,
        }


def _page(rows: Sequence[Row]) -> Iterator[str]:
    heads = ["problem, noise, runs", "chosen", "largest", "best of 18", "worst of 18"]
    heads += ["q", "order", "terms", "s"]
    keys = ("problem", "noise", "runs")
    of = []
    for case, group in grouped(rows, *keys).items():
        fits = grouped(group, "setting")
        chosen = fits[CHOSEN,]
        # By hindsight, of the settings that fit to each design.
        errors = [
            float(np.median([row["error"] for row in each]))
            for (setting,), each in fits.items()
            if setting != CHOSEN and len(each) == len(chosen)
        ] or [math.nan]
        middle = medians(chosen, *keys)[case]
        largest = max(row["error"] for row in chosen)
        numbers = [f"{each:.1e}" for each in (middle.error, largest, min(errors), max(errors))]
        numbers += [
            f"{getattr(middle, n):.3g}" for n in ("truncation", "order", "terms", "seconds")
        ]
        of.append(["{}, {:g}, {}".format(*case), *numbers])
    yield from lines(heads, of)


TABLE = SeedTable(
    ("problem", "noise", "runs", "setting"),
    _rows,
    {"expansions": _page},
    seeds=10,
    cases=lambda: (
        (name, noise, runs, setting)
        for name, (_, sizes) in PROBLEMS.items()
        for noise, runs, setting in product(NOISES, sizes, SETTINGS)
    ),
)

if __name__ == "__main__":
    TABLE.main(__doc__)
