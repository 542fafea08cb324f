"""How often intervals of sampled posteriors hold true values, and those of replicates exact ones.

Tables of docs/coverage/posteriors.md as `seed_table.py` makes them. The first is a simulation-based
calibration: values of three unknowns are drawn from their priors, then a curve of ten points with
errors, and the posterior of each such data set has to hold the values that it came from. The second
has posteriors that are known, and counts the intervals by the scatter of replicates that hold their
exact means, standard deviations and evidence. The third has posteriors with published means of long
chains, and the fourth gives as many likelihoods to emcee and OpenTURNS, which have to be installed.
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


# Posteriors with published means: posteriordb (Magnusson et al. 2024) has 10 000 draws of each.

_EFFECTS = np.array([28.0, 8, -3, 7, -1, 1, 18, 12])
_EFFECT_STDS = np.array([15.0, 10, 16, 11, 9, 11, 10, 18])
# Pelts of hares and lynxes in thousands, 1900 to 1920 (Hudson's Bay Company).
_HARES = [30.0, 47.2, 70.2, 77.4, 36.3, 20.6, 18.1, 21.4, 22.0, 25.4, 27.1]
_HARES += [40.3, 57.0, 76.6, 52.3, 19.5, 11.2, 7.6, 14.6, 16.2, 24.7]
_LYNXES = [4.0, 6.1, 9.8, 35.2, 59.4, 41.7, 19.0, 13.0, 8.3, 9.1, 7.4]
_LYNXES += [8.0, 12.3, 19.5, 45.7, 51.1, 29.7, 15.8, 9.7, 10.1, 8.6]
_STEPS = 40  # of Runge and Kutta's method in a year


def _schools(values: Array) -> Array:
    return _log_normal(_EFFECTS - values[:, 2:], _EFFECT_STDS)


def _school_values(points: Array) -> Array:
    mean, scale = 5 * points[:, 0], stats.halfcauchy.ppf(stats.norm.cdf(points[:, 1]), scale=5)
    effects = mean[:, np.newaxis] + scale[:, np.newaxis] * points[:, 2:]
    return np.column_stack([mean, scale, effects])


def _animals(values: Array) -> Array:
    """Return the likelihood of Lotka and Volterra's equations with log-normal errors."""
    birth, hunted, death, fed = values[:, :4].T
    at = np.log(values[:, 4:6].T)
    found = np.zeros(len(values))

    def slope(at: Array) -> Array:
        hares, lynxes = np.exp(np.minimum(at, 50.0))
        return np.stack([birth - hunted * lynxes, fed * hares - death])

    with np.errstate(over="ignore", invalid="ignore"):
        for pelts in zip(_HARES, _LYNXES, strict=True):
            logarithms = np.log(pelts)
            found += _log_normal(logarithms - at.T, values[:, 6:]) - logarithms.sum()
            for _ in range(_STEPS):
                one = slope(at)
                two = slope(at + one / 2 / _STEPS)
                three = slope(at + two / 2 / _STEPS)
                four = slope(at + three / _STEPS)
                at = at + (one + 2 * two + 2 * three + four) / 6 / _STEPS
    return np.where(np.isfinite(found), found, np.nan)


def _animal_values(points: Array) -> Array:
    middle, spread = np.tile([1.0, 0.05], 2), np.tile([0.5, 0.05], 2)
    # Normal above 0.
    inside = stats.norm.cdf(middle / spread)
    upper = stats.norm.isf(inside * stats.norm.sf(points[:, :4]))
    start, size = 10 * np.exp(points[:, 4:6]), np.exp(points[:, 6:] - 1)
    return np.column_stack([middle + spread * upper, start, size])


_SCHOOLS = ("μ", "τ", *(f"θ{number}" for number in range(1, 9)))
_ANIMALS = ("birth", "hunted", "death", "fed", "hares", "lynxes", "error of hares", "of lynxes")
# By name: the problem, and the means of its first unknowns.
REFERENCES: dict[str, tuple[Problem, tuple[float, ...]]] = {
    "eight schools": (Problem(_SCHOOLS, _school_values, _schools), (4.4105, 3.6021)),
    "lynx and hare": (
        Problem(_ANIMALS, _animal_values, _animals),
        (0.54686, 0.027747, 0.80010, 0.024086, 34.035, 5.9359, 0.24806, 0.25102),
    ),
}


def _reference(name: str, replicates: int, seed: int) -> Row:
    """Return how far means of a sample are from published ones, in standard deviations."""
    problem, means = REFERENCES[name]
    stream = Stream(seed, "reference", name, replicates)
    sample = posterior_sample(problem, stream, replicates=replicates)
    assert isinstance(sample, PosteriorSample), sample
    off = np.abs(sample.mean.value[: len(means)] - means)
    relative = off / sample.std.value[: len(means)]
    return {
        "likelihoods": len(sample.log_likelihood),
        "off2": float(np.mean(relative**2)),
        "largest": float(relative.max()),
        "in_errors": float(np.max(off / sample.standard_error[: len(means)])),
        "faulty": int(any(sample.faults)),
    }


# As many likelihoods for emcee, with each of its moves, and for the random walk of OpenTURNS, from
# draws of the prior. Its steps are as wide as the prior at first, and it adapts them in the quarter
# that is discarded.

_WALKERS = 40


def _beside(name: str, seed: int) -> Row:
    """Return the errors of means by the programs, in standard deviations."""
    import emcee
    import openturns

    known, stream = KNOWN[name], Stream(seed, "beside", name)
    sample = posterior_sample(known.problem, stream)
    assert isinstance(sample, PosteriorSample), sample
    spent, dimension = len(sample.log_likelihood), len(known.mean)
    steps = spent // _WALKERS

    def log_density(points: Array) -> Array:
        found = known.problem.log_likelihood(known.problem.values(points))
        return np.asarray(found - (points**2).sum(axis=1) / 2)

    means = {"own": sample.mean.value}
    moves = {"stretch": emcee.moves.StretchMove(), "differences": emcee.moves.DEMove()}
    for move, made in moves.items():
        rng = np.random.RandomState(stream.generator(move).integers(2**32))
        start = emcee.State(rng.standard_normal((_WALKERS, dimension)))
        start.random_state = rng.get_state()
        sampler = emcee.EnsembleSampler(
            _WALKERS, dimension, log_density, moves=made, vectorize=True
        )
        sampler.run_mcmc(start, steps)
        chain = sampler.get_chain(discard=steps // 4, flat=True)
        means[move] = known.problem.values(chain).mean(axis=0)
    rng = stream.generator("random walk")
    openturns.RandomGenerator.SetSeed(int(rng.integers(2**31)))
    walk = openturns.RandomWalkMetropolisHastings(
        openturns.PythonFunction(dimension, 1, lambda point: log_density(np.array([point]))),
        openturns.Interval([-np.inf] * dimension, [np.inf] * dimension),
        rng.standard_normal(dimension),
        openturns.Normal(dimension),
    )
    walk.setBurnIn(spent // 4)
    chain = np.asarray(walk.getSample(spent))[spent // 4 :]
    means["walk"] = known.problem.values(chain).mean(axis=0)
    off2 = {
        f"off2_{key}": float(np.mean(((mean - known.mean) / known.std) ** 2))
        for key, mean in means.items()
    }
    rounds = int(np.bincount(sample.sampled.replicate).max()) // sample.runs.shape[1]
    return {"likelihoods": spent, "rounds": rounds, "steps": steps} | off2


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    kind, name, replicates = str(case[0]), str(case[1]), int(case[2])
    for seed in seeds:
        if kind == "curve":
            yield _calibrated(name, seed)
        elif kind == "beside":
            yield _beside(name, seed)
        else:
            yield (_known if kind == "known" else _reference)(name, replicates, seed)


def _cases() -> Iterator[Case]:
    yield from (("curve", name, 4) for name in CURVES)
    yield from (("known", name, replicates) for name in KNOWN for replicates in (4, 8))
    yield from (("reference", name, 4) for name in REFERENCES)
    yield from (("beside", name, 4) for name in KNOWN)


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


def _of_references(rows: Sequence[Row]) -> Iterator[str]:
    own = [row for row in rows if row["kind"] == "reference"]
    head = ["posterior", "samples", "likelihoods", "error of mean [sd]", "largest [sd]"]
    head += ["largest [standard errors], median", "sampled well"]
    cells = []
    sums = ("count", "likelihoods", "off2", "faulty")
    for (name,), cell in totals(own, ("name",), sums).items():
        of_name = [row for row in own if row["name"] == name]
        cells.append(
            [
                name,
                cell.count,
                _number(cell.likelihoods / cell.count),
                f"{math.sqrt(cell.off2 / cell.count):.3f}",
                f"{max(row['largest'] for row in of_name):.2f}",
                f"{np.median([row['in_errors'] for row in of_name]):.1f}",
                f"{per_cent(cell.count - cell.faulty, cell.count)} %",
            ]
        )
    if cells:
        yield from lines(head, cells)


def _of_others(rows: Sequence[Row]) -> Iterator[str]:
    own = [row for row in rows if row["kind"] == "beside"]
    head = ["posterior", "samples", "likelihoods", "rounds", "steps of emcee", "error of mean [sd]"]
    head += ["emcee, stretch", "emcee, differences", "OpenTURNS"]
    others = [f"off2_{each}" for each in ("stretch", "differences", "walk")]
    sums = ("count", "likelihoods", "rounds", "steps", "off2_own", *others)
    cells = []
    for (name,), cell in totals(own, ("name",), sums).items():
        numbers = (_number(getattr(cell, key) / cell.count) for key in sums[1:4])
        cells.append([name, cell.count, *numbers, f"{math.sqrt(cell.off2_own / cell.count):.3f}"])
        for off2 in (getattr(cell, key) for key in others):
            # Errors fall with the root of the number of likelihoods.
            times = off2 / cell.off2_own
            cells[-1].append(
                f"{math.sqrt(off2 / cell.count):.3f} ({times:.{0 if times >= 10 else 1}f} ×)"
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


TABLES = {
    "curves": _curves,
    "known posteriors": _of_known,
    "published posteriors": _of_references,
    "posteriors by other programs": _of_others,
}
TABLE = SeedTable(KEYS, _cases, _rows, TABLES, _failing)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
