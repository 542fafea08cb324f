"""How good posteriors of dear models are: by a surrogate and 180 real runs, against the exact ones.

Tables of docs/coverage/dear_posteriors.md as `seed_table.py` makes them. Values of the unknowns are
drawn from their priors, then data with errors. The exact posterior is sampled on the model itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.special import ndtr
from seed_table import Row, SeedTable, grouped, share, table

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.streams import Stream
from uqpen.core.variables import Output
from uqpen.designs.posterior import PriorCoordinates, sample_posterior
from uqpen.measurements.errors import MeasuredOutput, MeasurementErrors
from uqpen.measurements.experiments import Experiments, MeasuredOutputs
from uqpen.models.walker_anderson import WalkerAnderson
from uqpen.statistics.weighted_posterior import WeightedPosterior
from uqpen.surrogates.surrogate_posterior import RESULT, SurrogatePosterior, search_posterior


class Problem(NamedTuple):
    """A model, at the rows of its measurements, and the errors of these."""

    unknowns: int
    # (run, coordinate) to (run, row); NaN of a failed run
    results: Callable[[FloatArray], FloatArray]
    std: float | FloatArray  # of an error; (row,)
    # (row,): numbers of experiments in which an input has values of its own, the coordinates behind
    # the unknowns
    experiment: IntArray | None = None


def uniform(points: FloatArray, lower: float, upper: float) -> FloatArray:
    """Return uniform numbers, shape (run, 1), that stand for standard normal ones."""
    return np.asarray(lower + (upper - lower) * ndtr(points[:, np.newaxis]))


TIMES = np.linspace(0.5, 6.0, 12)


def oscillation(points: FloatArray) -> FloatArray:
    """Return the displacement of a damped oscillator at 12 times."""
    amplitude = uniform(points[:, 0], 0.5, 1.5)
    damping = uniform(points[:, 1], 0.05, 0.5)
    frequency = uniform(points[:, 2], 1.0, 3.0)
    return np.asarray(amplitude * np.exp(-damping * TIMES) * np.cos(frequency * TIMES))


def fast_oscillation(points: FloatArray) -> FloatArray:
    """Return the displacement of one of up to six periods, which 12 times hardly show."""
    amplitude = uniform(points[:, 0], 0.5, 1.5)
    damping = uniform(points[:, 1], 0.05, 0.5)
    frequency = uniform(points[:, 2], 2.0, 6.0)
    return np.asarray(amplitude * np.exp(-damping * TIMES) * np.cos(frequency * TIMES))


def failing_oscillation(points: FloatArray) -> FloatArray:
    """Return the same, where a run fails in the tenth of the prior with the highest energy."""
    energy = points[:, 0] + points[:, 2]
    fails = energy > 1.2815515655446004 * math.sqrt(2)
    return np.where(fails[:, np.newaxis], np.nan, oscillation(points))


def reaction(points: FloatArray) -> FloatArray:
    """Return the middle two substances of A → B ⇌ C at six times, with three rate constants.

    dB/dt = k1 A - k2 B + k3 C, and C = 1 - A - B.
    """
    times = np.linspace(0.5, 5.0, 6)
    k1, k2, k3 = (np.exp(0.5 * points[:, [place]] + at) for place, at in enumerate((0, -0.5, -1)))
    a = np.exp(-k1 * times)
    # B' = k3 + (k1 - k3) A - (k2 + k3) B.
    total = k2 + k3
    near = np.abs(total - k1) < 1e-9
    divisor = np.where(near, 1e-9, total - k1)
    b = k3 / total * (1 - np.exp(-total * times))
    b = b + (k1 - k3) * (a - np.exp(-total * times)) / divisor
    return np.concatenate([b, 1 - a - b], axis=1)


VELOCITIES = np.linspace(1000.0, 1800.0, 6)
ROD = WalkerAnderson()
ROD_ERRORS = np.repeat([0.005, 0.001], len(VELOCITIES))


def rod(points: FloatArray) -> FloatArray:
    """Return depths and residues of eroding rods at six impact velocities.

    Unknown are the strength of the target and the radii of plastic flow and of the crater. Further
    coordinates are of the strength of each target, which varies by 10 % about that.
    """
    medians = {"target_yield_limit": (400e6, 0.25), "plasticity_radius": (0.1, 0.25)}
    medians["crater_radius"] = (0.017, 0.18)
    size = len(VELOCITIES)
    of_draws = {
        name: np.repeat(median * np.exp(spread * points[:, place]), size)
        for place, (name, (median, spread)) in enumerate(medians.items())
    }
    if points.shape[1] > len(medians):
        of_draws["target_yield_limit"] *= np.exp(0.1 * points[:, len(medians) :].ravel())
    known = {
        "projectile_density": 17_500.0,
        "projectile_yield_limit": 1.65e9,
        "projectile_length": 0.16,
        "projectile_sound_speed": 3071.0,
        "target_density": 2500.0,
        "smoothing": 0.0,
    }
    of_all = {name: np.full(len(points) * size, value) for name, value in known.items()}
    velocity = {"impact_velocity": np.tile(VELOCITIES, len(points))}
    made = ROD.evaluate(of_all | velocity | of_draws).outputs
    outputs = ("penetration_depth", "projectile_residue")
    return np.concatenate([made[name].reshape(-1, size) for name in outputs], axis=1)


PROBLEMS = {
    "damped oscillation": Problem(3, oscillation, 0.02),
    "damped oscillation of up to six periods": Problem(3, fast_oscillation, 0.02),
    "reaction with three rate constants": Problem(3, reaction, 0.01),
    "damped oscillation, 10 % of the prior fails": Problem(3, failing_oscillation, 0.02),
    "depths and residues of rods": Problem(3, rod, ROD_ERRORS),
    "depths and residues of rods, targets vary": Problem(
        3, rod, ROD_ERRORS, np.tile(np.arange(6), 2)
    ),
}


def measurements(problem: Problem, data: FloatArray) -> Experiments:
    """Return the measurements of a data set: each row is an experiment."""
    rows = np.arange(len(data))
    experiments = rows if problem.experiment is None else problem.experiment
    errors = MeasurementErrors(np.zeros(len(data)) + problem.std, np.zeros(len(data)))
    output = MeasuredOutput(Output("y", "1"), experiments, {}, data, 0 * rows, rows + 1, errors)
    names = tuple(f"x{number + 1}" for number in range(problem.unknowns))
    varies = () if problem.experiment is None else ("v",)
    count = len(np.unique(experiments))
    return Experiments((MeasuredOutputs("data", names, varies, (), {}, {}, (output,), count),))


def coordinates(measured: Experiments) -> PriorCoordinates:
    """Return the coordinates of a draw; they stand for the inputs themselves."""
    return PriorCoordinates(cast(Any, None), measured)


def exact_posterior(problem: Problem, measured: Experiments, stream: Stream) -> FloatArray:
    """Return draws of the posterior, by a long run of the sampler on the model itself."""
    particles, replicates = 2000, 4
    sampler = sample_posterior(
        coordinates(measured).dimension, particles, replicates, 10**9, stream
    )
    asked, ended, first = next(sampler), dict[int, FloatArray](), 0
    points = list[FloatArray]()
    while True:
        found = measured.likelihood.log_density(problem.results(asked.points))
        points.append(asked.points)
        numbers = first + np.arange(len(found))
        states = np.where(found >= asked.least, numbers, asked.parent)
        first += len(found)
        ended |= {each: states[asked.replicate == each] for each in np.unique(asked.replicate)}
        try:
            asked = sampler.send(found)
        except StopIteration:
            return np.asarray(np.concatenate(points)[np.concatenate([*ended.values()])])


def surrogate_posterior(
    problem: Problem, measured: Experiments, stream: Stream
) -> tuple[WeightedPosterior, int]:
    """Return the posterior by weighted runs, and the number of all runs."""
    settings = SurrogatePosterior(measured=("data",))
    search = search_posterior(coordinates(measured), settings, stream)
    asked, runs = next(search), 0
    while True:
        results = problem.results(asked.points)
        runs += len(results)
        try:
            asked = search.send(results)
        except StopIteration:
            break
    assert (asked.search_round == RESULT).all()
    found = measured.likelihood.log_density(results)
    names = measured.unknown
    return WeightedPosterior(names, asked.points[:, : len(names)], found, asked.predicted), runs


# Ends of the intervals that are compared.
ENDS = (0.05, 0.95)


def _row(name: str, seed: int) -> Row:
    problem, stream = PROBLEMS[name], Stream(seed, "dear", name)
    rng, unknowns = stream.generator("data"), problem.unknowns
    varying = 0 if problem.experiment is None else len(np.unique(problem.experiment))
    while True:  # a run that fails gives no data
        truth = rng.standard_normal(unknowns + varying)
        exact_data = problem.results(truth[np.newaxis])[0]
        if np.isfinite(exact_data).all():
            break
    data = exact_data + problem.std * rng.standard_normal(len(exact_data))
    measured = measurements(problem, data)
    exact = exact_posterior(problem, measured, stream.child("exact"))[:, :unknowns]
    truth = truth[:unknowns]
    found, runs = surrogate_posterior(problem, measured, stream.child("search"))
    mean, std = exact.mean(axis=0), exact.std(axis=0)
    low, high = (found.quantile(end) for end in ENDS)
    exact_low, exact_high = (np.quantile(exact, end, axis=0) for end in ENDS)
    alone = found.of_surrogate()
    errors = {
        "error": (found.mean.value - mean) / std,
        "surrogate_error": (alone.mean.value - mean) / std,
        "std_ratio": found.std.value / std,
    }
    return {
        **{f"{key}_{at}": float(x) for key, each in errors.items() for at, x in enumerate(each)},
        "holds": int(((low <= truth) & (truth <= high)).sum()),
        "exact_holds": int(((exact_low <= truth) & (truth <= exact_high)).sum()),
        # The probability of the intervals by the exact posterior, which scatters less.
        "content": float(((low <= exact) & (exact <= high)).mean()),
        "narrower": float((1 / std).max()),
        "effective": found.effective_draws,
        "confirmed": int(found.is_confirmed),
        "failed": int(np.isnan(found.log_likelihood).sum()),
        "runs": runs,
    }


class Cell:
    """All data sets of a model."""

    def __init__(self, name: str, rows: Sequence[Row]) -> None:
        self.name, self.rows, self.count = name, rows, len(rows)

    def values(self, key: str) -> FloatArray:
        """Return a number of each data set, or of each unknown, too."""
        keys = [each for each in self.rows[0] if each == key or each.startswith(f"{key}_")]
        return np.array([[row[each] for each in keys] for row in self.rows])

    def median(self, key: str, form: str) -> str:
        """Return the median of a number as text."""
        return format(np.median(self.values(key)), form)

    def share(self, key: str) -> str:
        """Return the share of what is counted among data sets, or among all unknowns."""
        return share(self.values(key).sum(), self.count * (1 if key == "confirmed" else 3))


def _off(key: str) -> Callable[[Cell], str]:
    return lambda c: f"{np.median(off := np.abs(c.values(key))):.2f}, {off.max():.2f}"


def _content(cell: Cell) -> str:
    content = cell.values("content")
    error = content.std() / math.sqrt(cell.count)
    return f"{content.mean():.1%} ± {error:.1%}".replace("%", " %")


COLUMNS = {
    "model": "name",
    "data sets": "count",
    "runs": lambda c: c.median("runs", ".0f"),
    "error of mean [sd]: median, worst": _off("error"),
    "by the surrogate alone": _off("surrogate_error"),
    "ratio of sd": lambda c: c.median("std_ratio", ".2f"),
    "holds truth": lambda c: c.share("holds"),
    "exact holds truth": lambda c: c.share("exact_holds"),
    "probability of intervals": _content,
    "effective of 60": lambda c: c.median("effective", ".0f"),
    "confirmed": lambda c: c.share("confirmed"),
}
# Largest error of a confirmed mean, in standard deviations of the posterior, and largest difference
# of the probability of intervals from 90 %, which those of the exact posterior have.
MOST_OFF, MOST_APART = 1.0, 0.05


def _cells(rows: Sequence[Row]) -> list[Cell]:
    found = grouped(rows, "model")
    return [Cell(name, found[name,]) for name in PROBLEMS if (name,) in found]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for cell in _cells(rows):
        is_confirmed = cell.values("confirmed")[:, 0] == 1
        worst = float(np.abs(cell.values("error")[is_confirmed]).max(initial=0))
        if worst > MOST_OFF:
            yield f"{cell.name}: a mean is off by {worst:.2f} standard deviations"
        content = float(cell.values("content").mean())
        if abs(content - (ENDS[1] - ENDS[0])) > MOST_APART:
            yield f"{cell.name}: intervals have the probability {content:.1%} by the exact one"


TABLE = SeedTable(
    {"model": PROBLEMS},
    lambda name, seeds: (_row(name, seed) for seed in seeds),
    {"dear posteriors": lambda rows: table(_cells(rows), COLUMNS)},
    _failing,
    seeds=30,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
