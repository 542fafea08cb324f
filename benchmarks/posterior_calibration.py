"""How often intervals of sampled posteriors hold true values, and those of replicates exact ones.

Tables of docs/coverage/posteriors.md as `seed_table.py` makes them. The first is a simulation-based
calibration: values of three unknowns are drawn from their priors, then a curve of ten points with
errors, and the posterior of each such data set has to hold the values that it came from. The second
has posteriors that are known, and counts the intervals by the scatter of replicates that hold their
exact means, standard deviations and evidence.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats
from seed_table import LOWEST, Case, Row, SeedTable, lines, per_cent, totals

from uqpen.core.streams import Stream
from uqpen.designs.posterior import PosteriorPoints, half_normal, sample_posterior
from uqpen.statistics.posterior import PosteriorSample

Array = npt.NDArray[np.float64]
LogLikelihood = Callable[[Array], Array]


class Problem(NamedTuple):
    """A posterior in standard normal coordinates, and the unknowns that these stand for."""

    names: tuple[str, ...]
    values: Callable[[Array], Array]  # (run, coordinate) to (run, unknown)
    log_likelihood: LogLikelihood  # of the values; NaN for a failed run


def posterior_sample(
    problem: Problem,
    stream: Stream,
    *,
    particles: int = 500,
    replicates: int = 4,
    at_most: int = 10_000_000,
) -> PosteriorSample | str:
    """Return the sample of a posterior, or the reason why there is none."""
    sampler = sample_posterior(len(problem.names), particles, replicates, at_most, stream)
    made, values, found = [next(sampler)], list[Array](), list[Array]()
    while True:
        values.append(problem.values(made[-1].points))
        found.append(problem.log_likelihood(values[-1]))
        try:
            made.append(sampler.send(found[-1]))
        except StopIteration:
            break
    sampled = PosteriorPoints(*(np.concatenate(column) for column in zip(*made, strict=True)))
    return PosteriorSample.of(problem.names, np.concatenate(values), sampled, np.concatenate(found))


def _log_normal(off: Array, std: Array | float) -> Array:
    """Return the logarithm of the density of independent errors, summed over the last axis."""
    each = -0.5 * (off / std) ** 2 - np.log(std) - 0.5 * math.log(2 * math.pi)
    found: Array = np.sum(np.broadcast_to(each, off.shape), axis=-1)
    return found


# Simulation-based calibration with a curve.

TIMES = np.linspace(0.0, 4.0, 10)
STD, SIZE_PRIOR, FAILING = 0.3, 0.5, 0.05
CURVES = ("errors stated", "size of errors unknown", "5 % of runs fail")
PARTICLES = 512


def curve(values: Array) -> Array:
    """Return a decay to a level at the times, shape (run, time)."""
    height, rate, level = (values[:, place, np.newaxis] for place in range(3))
    return np.asarray(height * np.exp(-rate * TIMES) + level)


def fails(values: Array) -> npt.NDArray[np.bool_]:
    """Return which runs fail: one in 20, as if at random, yet always the same."""
    return np.asarray(np.modf(np.abs(values[:, 1]) * 1e6)[0] < FAILING)


def curve_problem(name: str, data: Array) -> Problem:
    """Return the posterior of a data set."""
    has_size = name == CURVES[1]

    def values(points: Array) -> Array:
        columns = [5 + points[:, 0], np.exp(0.4 * points[:, 1] - 0.7), 1 + 0.5 * points[:, 2]]
        columns += [half_normal(points[:, 3], SIZE_PRIOR)] if has_size else []
        return np.column_stack(columns)

    def log_likelihood(values: Array) -> Array:
        found = _log_normal(data - curve(values), values[:, 3:] if has_size else STD)
        return np.where(fails(values), np.nan, found) if name == CURVES[2] else found

    names = ("height", "rate", "level", *["size of errors"] * has_size)
    return Problem(names, values, log_likelihood)


def _calibrated(name: str, seed: int) -> Row:
    """Return where the true values of a data set are in its posterior, as shares of the draws."""
    stream = Stream(seed, "curve", name)
    rng = stream.generator("data")
    problem = curve_problem(name, TIMES)
    while True:  # a run that fails gives no data
        truth = problem.values(rng.standard_normal((1, len(problem.names))))
        if name != CURVES[2] or not fails(truth)[0]:
            break
    std = truth[0, 3] if name == CURVES[1] else STD
    data = curve(truth)[0] + std * rng.standard_normal(len(TIMES))
    sample = posterior_sample(curve_problem(name, data), stream, particles=PARTICLES)
    assert isinstance(sample, PosteriorSample), sample
    draws = sample.draws.reshape(-1, len(problem.names))
    below = (draws < truth).mean(axis=0)
    places = {f"below_{place}": "" for place in range(4)}
    places |= {f"below_{place}": float(share) for place, share in enumerate(below)}
    return {"likelihoods": len(sample.log_likelihood), "faulty": int(any(sample.faults)), **places}


# Posteriors that are known.


class Known(NamedTuple):
    """A posterior with its exact means, standard deviations and logarithm of the evidence."""

    problem: Problem
    mean: tuple[float, ...]
    std: tuple[float, ...]
    log_evidence: float


_X, _Y = np.arange(4.0), np.array([1.1, 2.9, 5.2, 6.8])
_REPEATS = np.array([4.1, 5.0, 3.7, 4.6, 5.3])


def _line(values: Array) -> Array:
    return np.asarray(_Y - values[:, :1] - values[:, 1:] * _X)


def _with_shared_error(values: Array) -> Array:
    return np.asarray(
        stats.multivariate_normal(np.zeros(4), 0.2**2 * np.eye(4) + 0.3**2).logpdf(_line(values))
    )


def _bounded(values: Array) -> Array:
    beyond = stats.norm.logsf(1.0, values[:, 0], 0.5)
    return np.asarray(_log_normal(0.8 - values, 0.5) + beyond)


KNOWN = {
    "line": Known(
        Problem(("a", "b"), lambda z: 10 * z, lambda x: _log_normal(_line(x), 0.2)),
        (1.0899276173, 1.9399755933),
        (0.1673042830, 0.0894310946),
        -7.6098524711,
    ),
    "line, shared error": Known(
        Problem(("a", "b"), lambda z: 10 * z, _with_shared_error),
        (1.0889478386, 1.9399754757),
        (0.3433066961, 0.0894311019),
        -7.6102968019,
    ),
    "θ², two modes": Known(
        Problem(("θ",), lambda z: 0.3 + z, lambda x: _log_normal(1.44 - x**2, 0.3)),
        (0.39248341,),
        (1.09992772,),
        -1.75970725,
    ),
    "a value and a bound": Known(
        Problem(("θ",), lambda z: z, _bounded), (0.98823061,), (0.36667743,), -2.50474257
    ),
    "size of errors unknown": Known(
        Problem(
            ("θ", "σ"),
            lambda z: np.column_stack([10 * z[:, 0], half_normal(z[:, 1], 1.0)]),
            lambda x: _log_normal(_REPEATS - x[:, :1], x[:, 1:]),
        ),
        (4.53334277, 0.80163810),
        (0.38297361, 0.30406205),
        -9.06203033,
    ),
}


def _known(name: str, replicates: int, seed: int) -> Row:
    """Return how many intervals by the scatter of replicates hold exact values, and the errors."""
    known, stream = KNOWN[name], Stream(seed, "known", name, replicates)
    sample = posterior_sample(known.problem, stream, replicates=replicates)
    assert isinstance(sample, PosteriorSample), sample
    row: dict[str, float | int] = {"likelihoods": len(sample.log_likelihood)}
    for what, found, exact in (
        ("mean", sample.mean, np.array(known.mean)),
        ("std", sample.std, np.array(known.std)),
        ("evidence", sample.log_evidence, np.array([known.log_evidence])),
    ):
        off = np.atleast_1d(found.value - exact)
        row |= {
            f"holds_{what}": float(np.mean((found.lower <= exact) & (exact <= found.upper))),
            f"off_{what}": float(np.mean(off / (1.0 if what == "evidence" else known.std))),
            f"off2_{what}": float(np.mean((off / (1 if what == "evidence" else known.std)) ** 2)),
        }
    return row | {"faulty": int(any(sample.faults))}


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    kind, name, replicates = str(case[0]), str(case[1]), int(case[2])
    for seed in seeds:
        yield _calibrated(name, seed) if kind == "curve" else _known(name, replicates, seed)


def _cases() -> Iterator[Case]:
    yield from (("curve", name, 4) for name in CURVES)
    yield from (("known", name, replicates) for name in KNOWN for replicates in (4, 8))


LEVELS = (0.5, 0.9, 0.95)


def _places(rows: Sequence[Row]) -> dict[str, Array]:
    """Return where the true values are in the posteriors of a curve, shape (data set, unknown)."""
    found = {}
    for name in CURVES:
        own = [row for row in rows if row["kind"] == "curve" and row["name"] == name]
        places = range(len(curve_problem(name, TIMES).names))
        if own:
            found[name] = np.array([[row[f"below_{place}"] for place in places] for row in own])
    return found


def _curves(rows: Sequence[Row]) -> Iterator[str]:
    head = ["errors", "data sets", "likelihoods", *(f"{level:.0%} hold" for level in LEVELS)]
    head += ["p of ranks", "sampled well"]
    sums = totals([row for row in rows if row["kind"] == "curve"], ("name",), SUMS[:3])
    cells = []
    for name, below in _places(rows).items():
        cell = sums[(name,)]
        held = [f"{per_cent((abs(below - 0.5) <= level / 2).mean(), 1)} %" for level in LEVELS]
        p_values = (stats.kstest(column, "uniform").pvalue for column in below.T)
        ranks = ", ".join(f"{each:.2f}" for each in p_values)
        cells.append([name, cell.count, _number(cell.likelihoods / cell.count), *held, ranks])
        cells[-1].append(f"{per_cent(cell.count - cell.faulty, cell.count)} %")
    if cells:
        yield from lines(head, cells)


def _number(value: float) -> str:
    return f"{value:_.0f}".replace("_", " ")


KEYS = ("kind", "name", "replicates")
SUMS = ("count", "likelihoods", "faulty", "holds_mean", "holds_std", "holds_evidence")
SUMS += ("off_std", "off2_mean", "off2_evidence")


def _of_known(rows: Sequence[Row]) -> Iterator[str]:
    own = [row for row in rows if row["kind"] == "known"]
    head = ["posterior", "replicates", "samples", "likelihoods", "holds mean", "holds sd"]
    head += [
        "holds log evidence",
        "error of mean [sd]",
        "mean error of sd",
        "error of log evidence",
    ]
    head += ["sampled well"]
    cells = []
    for (_, name, replicates), cell in totals(own, KEYS, SUMS).items():
        number = cell.count
        shares = (cell.holds_mean, cell.holds_std, cell.holds_evidence)
        cells.append(
            [
                name,
                replicates,
                number,
                _number(cell.likelihoods / number),
                *(f"{per_cent(each, number)} %" for each in shares),
                f"{math.sqrt(cell.off2_mean / number):.3f}",
                f"{100 * cell.off_std / number:+.1f} %",
                f"{math.sqrt(cell.off2_evidence / number):.3f}",
                f"{per_cent(number - cell.faulty, number)} %",
            ]
        )
    if cells:
        yield from lines(head, cells)


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for name, below in _places(rows).items():
        held = (abs(below - 0.5) <= 0.45).mean()
        if not 0.88 <= held <= 0.92:
            yield f"{name}: {held:.1%} of 90 % intervals"
        if min(stats.kstest(column, "uniform").pvalue for column in below.T) < 0.01:
            yield f"{name}: ranks"
    own = [row for row in rows if row["kind"] == "known"]
    for key, cell in totals(own, KEYS, SUMS).items():
        for what in ("mean", "std", "evidence"):
            if (held := getattr(cell, f"holds_{what}")) < LOWEST * cell.count:
                yield f"{key}, {what}: {per_cent(held, cell.count)} %"


TABLE = SeedTable(KEYS, _cases, _rows, {"curves": _curves, "known posteriors": _of_known}, _failing)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
