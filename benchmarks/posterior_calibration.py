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
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from scipy import stats
from seed_table import (
    LOWEST,
    Case,
    Row,
    SeedTable,
    counted,
    grouped,
    share,
    share_of,
    table,
    totals,
)

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.streams import Stream
from uqpen.designs.posterior import PosteriorPoints, half_normal, sample_posterior
from uqpen.statistics.posterior import PosteriorSample

LogLikelihood = Callable[[FloatArray], FloatArray]


class Problem(NamedTuple):
    """A posterior in standard normal coordinates, and the unknowns that these stand for."""

    names: tuple[str, ...]
    values: Callable[[FloatArray], FloatArray]  # (run, coordinate) to (run, unknown)
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
    made, values, found = [next(sampler)], list[FloatArray](), list[FloatArray]()
    while True:
        values.append(problem.values(made[-1].points))
        found.append(problem.log_likelihood(values[-1]))
        try:
            made.append(sampler.send(found[-1]))
        except StopIteration:
            break
    sampled = PosteriorPoints(*(np.concatenate(column) for column in zip(*made, strict=True)))
    return PosteriorSample.of(problem.names, np.concatenate(values), sampled, np.concatenate(found))


def _log_normal(off: FloatArray, std: FloatArray | float) -> FloatArray:
    """Return the logarithm of the density of independent errors, summed over the last axis."""
    each = -0.5 * (off / std) ** 2 - np.log(std) - 0.5 * math.log(2 * math.pi)
    found: FloatArray = np.sum(np.broadcast_to(each, off.shape), axis=-1)
    return found


# Simulation-based calibration with a curve.

TIMES = np.linspace(0.0, 4.0, 10)
STD, SIZE_PRIOR, FAILING = 0.3, 0.5, 0.05
CURVES = ("errors stated", "size of errors unknown", "5 % of runs fail")
PARTICLES = 512


def curve(values: FloatArray) -> FloatArray:
    """Return a decay to a level at the times, shape (run, time)."""
    height, rate, level = (values[:, place, np.newaxis] for place in range(3))
    return np.asarray(height * np.exp(-rate * TIMES) + level)


def fails(values: FloatArray) -> BoolArray:
    """Return which runs fail: one in 20, as if at random, yet always the same."""
    return np.asarray(np.modf(np.abs(values[:, 1]) * 1e6)[0] < FAILING)


def curve_problem(name: str, data: FloatArray) -> Problem:
    """Return the posterior of a data set."""
    has_size = name == CURVES[1]

    def values(points: FloatArray) -> FloatArray:
        columns = [5 + points[:, 0], np.exp(0.4 * points[:, 1] - 0.7), 1 + 0.5 * points[:, 2]]
        columns += [half_normal(points[:, 3], SIZE_PRIOR)] if has_size else []
        return np.column_stack(columns)

    def log_likelihood(values: FloatArray) -> FloatArray:
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


def _line(values: FloatArray) -> FloatArray:
    return np.asarray(_Y - values[:, :1] - values[:, 1:] * _X)


def _with_shared_error(values: FloatArray) -> FloatArray:
    return np.asarray(
        stats.multivariate_normal(np.zeros(4), 0.2**2 * np.eye(4) + 0.3**2).logpdf(_line(values))
    )


def _bounded(values: FloatArray) -> FloatArray:
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


def _school_values(points: FloatArray) -> FloatArray:
    mean, scale = 5 * points[:, 0], stats.halfcauchy.ppf(stats.norm.cdf(points[:, 1]), scale=5)
    effects = mean[:, np.newaxis] + scale[:, np.newaxis] * points[:, 2:]
    return np.column_stack([mean, scale, effects])


def _animals(values: FloatArray) -> FloatArray:
    """Return the likelihood of Lotka and Volterra's equations with log-normal errors."""
    birth, hunted, death, fed = values[:, :4].T
    at = np.log(values[:, 4:6].T)
    found = np.zeros(len(values))

    def slope(at: FloatArray) -> FloatArray:
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


def _animal_values(points: FloatArray) -> FloatArray:
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
    "eight schools": (
        Problem(_SCHOOLS, _school_values, lambda x: _log_normal(_EFFECTS - x[:, 2:], _EFFECT_STDS)),
        (4.4105, 3.6021),
    ),
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

    def log_density(points: FloatArray) -> FloatArray:
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


def _rows(kind: str, name: str, replicates: int, seeds: Sequence[int]) -> Iterator[Row]:
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


def _held(level: float) -> Callable[[SimpleNamespace], str]:
    return lambda c: share((abs(c.below - 0.5) <= level / 2).mean(), 1)


def _mean(name: str) -> Callable[[SimpleNamespace], str]:
    return lambda c: counted(getattr(c, name) / c.count)


def _root(name: str) -> Callable[[SimpleNamespace], str]:
    return lambda c: f"{math.sqrt(getattr(c, name) / c.count):.3f}"


def _beside_own(name: str) -> Callable[[SimpleNamespace], str]:
    """Return an error, and how many times as many likelihoods it takes to make it ours."""

    def text(c: SimpleNamespace) -> str:
        # Errors fall with the root of the number of likelihoods.
        times = getattr(c, name) / c.off2_own
        return f"{_root(name)(c)} ({times:.{0 if times >= 10 else 1}f} ×)"

    return text


def _ranks(c: SimpleNamespace) -> list[float]:
    return [stats.kstest(column, "uniform").pvalue for column in c.below.T]


_SAMPLED_WELL = {"sampled well": lambda c: share(c.count - c.faulty, c.count)}
COLUMNS = {
    "curve": {
        "errors": "name",
        "data sets": "count",
        "likelihoods": _mean("likelihoods"),
        **{f"{level:.0%} hold": _held(level) for level in (0.5, 0.9, 0.95)},
        "p of ranks": lambda c: ", ".join(f"{each:.2f}" for each in _ranks(c)),
        **_SAMPLED_WELL,
    },
    "known": {
        "posterior": "name",
        "replicates": "replicates",
        "samples": "count",
        "likelihoods": _mean("likelihoods"),
        "holds mean": share_of("holds_mean"),
        "holds sd": share_of("holds_std"),
        "holds log evidence": share_of("holds_evidence"),
        "error of mean [sd]": _root("off2_mean"),
        "mean error of sd": lambda c: f"{100 * c.off_std / c.count:+.1f} %",
        "error of log evidence": _root("off2_evidence"),
        **_SAMPLED_WELL,
    },
    "reference": {
        "posterior": "name",
        "samples": "count",
        "likelihoods": _mean("likelihoods"),
        "error of mean [sd]": _root("off2"),
        "largest [sd]": lambda c: f"{max(row['largest'] for row in c.rows):.2f}",
        "largest [standard errors], median": lambda c: (
            f"{np.median([row['in_errors'] for row in c.rows]):.1f}"
        ),
        **_SAMPLED_WELL,
    },
    "beside": {
        "posterior": "name",
        "samples": "count",
        "likelihoods": _mean("likelihoods"),
        "rounds": _mean("rounds"),
        "steps of emcee": _mean("steps"),
        "error of mean [sd]": _root("off2_own"),
        "emcee, stretch": _beside_own("off2_stretch"),
        "emcee, differences": _beside_own("off2_differences"),
        "OpenTURNS": _beside_own("off2_walk"),
    },
}


def _cells(kind: str, rows: Sequence[Row]) -> list[SimpleNamespace]:
    """Return the sums of each posterior, its rows, and where true values are in it by unknown."""
    own = [row for row in rows if row["kind"] == kind]
    found = totals(own, *KEYS)
    for key, of in grouped(own, *KEYS).items():
        found[key].rows = of
        if kind == "curve":
            places = range(len(curve_problem(found[key].name, TIMES).names))
            found[key].below = np.array([[row[f"below_{at}"] for at in places] for row in of])
    return [*found.values()]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for cell in _cells("curve", rows):
        held = (abs(cell.below - 0.5) <= 0.45).mean()
        if not 0.88 <= held <= 0.92:
            yield f"{cell.name}: {held:.1%} of 90 % intervals"
        if min(_ranks(cell)) < 0.01:
            yield f"{cell.name}: ranks"
    for cell in _cells("known", rows):
        for what in ("mean", "std", "evidence"):
            if (held := getattr(cell, f"holds_{what}")) < LOWEST * cell.count:
                yield f"{cell.name}, {cell.replicates}, {what}: {share(held, cell.count)}"


KEYS = ("kind", "name", "replicates")
TABLE = SeedTable(
    KEYS,
    _rows,
    {
        name: lambda rows, kind=kind: table(_cells(kind, rows), COLUMNS[kind])
        for name, kind in (
            ("curves", "curve"),
            ("known posteriors", "known"),
            ("published posteriors", "reference"),
            ("posteriors by other programs", "beside"),
        )
    },
    _failing,
    cases=_cases,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
