"""How often estimates over unknowns of distributions contain the true ones.

Three tables of docs/coverage/unknowns.md as `seed_table.py` makes them. The first is of parameters
fitted to eight specimens, the probability of each draw exact; the second has it from runs by
weights; the third is of parameters that are intervals.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy
import xarray as xr
from seed_table import Case, Row, SeedTable, lines, per_cent, totals

from uqpen.core.labels import EXCEEDANCE, SAMPLING, STATUS
from uqpen.core.model import Input, Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Gamma, Gumbel, Lognormal, Normal, Weibull
from uqpen.distributions.unknowns import ParameterBox, Unknown, fitted_parameters
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.statistics_over_unknowns import statistics_over_unknowns

Array = npt.NDArray[np.float64]
LEVEL, SPECIMENS = 0.95, 8
PROBABILITIES = (0.05, 0.001)
TAILS = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]

STRENGTHS: Mapping[str, Distribution] = {
    "normal": Normal(10.0, 1.0),
    "lognormal": Lognormal(10.0, 2.0),
    "gumbel": Gumbel(10.0, 1.0),
    "weibull": Weibull(10.0, 10.0),
    "gamma": Gamma(10.0, 2.0),
}


def _of_specimens(family: str, seed: int) -> Row:
    """Return what the draws of a family say of two probabilities, exact for each of them."""
    truth, stream = STRENGTHS[family], Stream(seed, "specimens", family)
    values = truth.ppf(stream.generator("values").random(SPECIMENS))
    unknown = fitted_parameters(family, values, stream.generator("parameters"))
    at = truth.ppf(np.array(PROBABILITIES))
    low, high = np.quantile([each.cdf(at) for each in unknown.draws], TAILS, axis=0)
    covers = (low <= PROBABILITIES) & (high >= PROBABILITIES)
    below = [truth.cdf(each.ppf(np.array(0.05))) for each in (unknown.fitted, unknown.predictive)]
    return {
        "covers": int(covers[0]),
        "covers_rare": int(covers[1]),
        "next_fitted": float(below[0]),
        "next": float(below[1]),
    }


def _estimates(
    unknowns: Mapping[str, Unknown | Distribution],
    output: Callable[[Mapping[str, Array]], Array],
    thresholds: Sequence[float],
    runs: int,
    stream: Stream,
) -> Mapping[str, xr.DataArray]:
    """Return the estimates on probabilities from runs of a function."""
    variables = tuple(Input(name, "1", "") for name in unknowns)
    entries = tuple(
        RandomInput(variable, each.drawn(), "1", unknown=each)
        if isinstance(each, Unknown)
        else RandomInput(variable, each, "1")
        for variable, each in zip(variables, unknowns.values(), strict=True)
    )
    joint = JointDistribution(entries, variables)
    points = joint.points(stream.generator("points").random((runs, len(entries))), {})
    values = output({name: points[name].values for name in unknowns})
    sampling = Sampling.OVER_BOX if joint.boxes else Sampling.INDEPENDENT
    made = points.assign({"y": ("run", values), STATUS: ("run", np.zeros(runs, np.int8))})
    asked = tuple(Threshold(f"{each:g}", each) for each in thresholds)
    quantity = QuantityOfInterest(Output("y", "1"), "1", thresholds=asked)
    made = made.assign_attrs({SAMPLING: str(sampling)})
    return statistics_over_unknowns(made, [quantity], joint, only={EXCEEDANCE})["y"]


def _from_runs(inputs: str, runs: int, seed: int) -> Row:
    """Return the same of a load above a strength, from runs; one of them fitted, or both."""
    stream = Stream(seed, "runs", inputs, runs)
    unknowns: dict[str, Unknown | Distribution] = {"load": Normal(6.0, 1.0)}
    for name, mean in (("strength", 10.0), ("load", 6.0)):
        if name == "strength" or inputs == "both fitted":
            values = Normal(mean, 1.0).ppf(stream.generator(name).random(SPECIMENS))
            own = stream.generator(name, "parameters")
            unknowns[name] = fitted_parameters("normal", values, own)
    thresholds = Normal(-4.0, np.sqrt(2.0)).isf(np.array(PROBABILITIES))
    found = _estimates(unknowns, lambda x: x["load"] - x["strength"], thresholds, runs, stream)
    low, high = found["fitted_exceedance"].values[:, 1:].T
    covers = (low <= PROBABILITIES) & (high >= PROBABILITIES)
    low, high = found["plug_in_exceedance"].values[:, 1:].T
    plug_in = (low <= PROBABILITIES) & (high >= PROBABILITIES)
    return {
        "covers": int(covers[0]),
        "covers_rare": int(covers[1]),
        "plug_in": int(plug_in[0]),
        "plug_in_rare": int(plug_in[1]),
    }


class Box(NamedTuple):
    """A function of inputs with parameters that are intervals, and what it exceeds."""

    inputs: Mapping[str, ParameterBox]
    output: Callable[[Mapping[str, Array]], Array]
    threshold: float
    bounds: tuple[float, float]  # true ones of the probability


def _normal(mean: tuple[float, float], std: tuple[float, float]) -> ParameterBox:
    return ParameterBox(Normal, {}, {"mean": mean, "std": std})


def _difference_bounds() -> tuple[float, float]:
    """Return the bounds of a normal load above a lognormal strength, by integration."""
    u, weight = np.polynomial.legendre.leggauss(400)
    quantiles = (u + 1) / 2
    found = [
        float(weight @ Normal(mean, 1.0).sf(Lognormal(strength, std).ppf(quantiles)) / 2)
        for mean in (9.0, 11.0)
        for strength in np.linspace(14.0, 15.0, 9)
        for std in np.linspace(1.0, 1.5, 9)
    ]
    return min(found), max(found)


_SF = scipy.special.ndtr
BOXES = {
    "mean 0 to 1, std 1 to 1.5": Box(
        {"x": _normal((0.0, 1.0), (1.0, 1.5))}, lambda x: x["x"], 3.0, (_SF(-3.0), _SF(-2 / 1.5))
    ),
    "x², least inside the box": Box(
        {"x": _normal((-1.0, 1.0), (0.7, 1.0))},
        lambda x: x["x"] ** 2,
        2.25,
        (2 * _SF(-1.5 / 0.7), _SF(-0.5) + _SF(-2.5)),
    ),
    "narrow": Box(
        {"x": _normal((0.8, 1.0), (1.3, 1.5))},
        lambda x: x["x"],
        3.0,
        (_SF(-2.2 / 1.3), _SF(-2 / 1.5)),
    ),
    "load and strength, three intervals": Box(
        {
            "load": ParameterBox(Normal, {"std": 1.0}, {"mean": (9.0, 11.0)}),
            "strength": ParameterBox(Lognormal, {}, {"mean": (14.0, 15.0), "std": (1.0, 1.5)}),
        },
        lambda x: x["load"] - x["strength"],
        0.0,
        _difference_bounds(),
    ),
    "Weibull, shape and scale": Box(
        {"x": ParameterBox(Weibull, {}, {"shape": (1.5, 2.5), "scale": (0.9, 1.1)})},
        lambda x: x["x"],
        1.8,
        (float(np.exp(-(2.0**2.5))), float(np.exp(-((1.8 / 1.1) ** 1.5)))),
    ),
}


def _of_box(name: str, runs: int, seed: int) -> Row:
    box, stream = BOXES[name], Stream(seed, "box", name, runs)
    found = _estimates(box.inputs, box.output, (box.threshold,), runs, stream)
    lower, upper = (found[f"{end}_exceedance"].values[0] for end in ("lower", "upper"))
    is_known = np.isfinite([lower[1], upper[2]]).all()
    least, largest = box.bounds
    return {
        "intervals": int(is_known),
        "covers": int(is_known and lower[1] <= least and largest <= upper[2]),
        "estimates": int(lower[0] <= least and largest <= upper[0]),
        "least": float(np.nan_to_num(lower[1])),
        "largest": float(np.nan_to_num(upper[2])),
    }


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    kind, name, runs = str(case[0]), str(case[1]), int(case[2])
    for seed in seeds:
        if kind == "specimens":
            yield _of_specimens(name, seed)
        else:
            yield (_from_runs if kind == "runs" else _of_box)(name, runs, seed)


def _cases() -> Iterator[Case]:
    yield from (("specimens", family, 0) for family in STRENGTHS)
    yield from (("runs", name, 1000) for name in ("strength fitted", "both fitted"))
    yield from (("box", name, runs) for name in BOXES for runs in (300, 1000, 4000))


KEYS = ("kind", "name", "runs")


def _share(count: float, of: float) -> str:
    return f"{per_cent(count, of)} %" if of else "–"


def _specimens(rows: Sequence[Row]) -> Iterator[str]:
    sums = ("count", "covers", "covers_rare", "next_fitted", "next")
    own = [row for row in rows if row["kind"] == "specimens"]
    head = ["family", "seeds", "holds P = 0.05", "holds P = 0.001"]
    head += ["next one below the 5 % value, as fitted", "predictive"]
    yield from lines(
        head,
        (
            [
                name,
                f"{cell.count}",
                _share(cell.covers, cell.count),
                _share(cell.covers_rare, cell.count),
                f"{100 * cell.next_fitted / cell.count:.2f} %",
                f"{100 * cell.next / cell.count:.2f} %",
            ]
            for (_, name, _), cell in totals(own, KEYS, sums).items()
        ),
    )


def _of_runs(rows: Sequence[Row]) -> Iterator[str]:
    sums = ("count", "covers", "covers_rare", "plug_in", "plug_in_rare")
    own = [row for row in rows if row["kind"] == "runs"]
    head = ["inputs", "runs", "seeds", "holds P = 0.05", "holds P = 0.001"]
    head += ["as fitted, P = 0.05", "as fitted, P = 0.001"]
    yield from lines(
        head,
        (
            [
                name,
                f"{runs}",
                f"{cell.count}",
                *(_share(getattr(cell, s), cell.count) for s in sums[1:]),
            ]
            for (_, name, runs), cell in totals(own, KEYS, sums).items()
        ),
    )


def _boxes(rows: Sequence[Row]) -> Iterator[str]:
    sums = ("count", "intervals", "covers", "estimates", "least", "largest")
    own = [row for row in rows if row["kind"] == "box"]
    head = ["box", "runs", "true bounds", "seeds", "both are contained", "by estimates alone"]
    head += ["mean range", "refused"]
    yield from lines(
        head, (_box_line(*key[1:], cell) for key, cell in totals(own, KEYS, sums).items())
    )


def _box_line(name: str, runs: int, cell: object) -> list[str]:
    found = cell.__dict__
    count, known = found["count"], found["intervals"]
    truth = " to ".join(f"{each:.3g}" for each in BOXES[name].bounds)
    ends = (found["least"], found["largest"])
    mean = " to ".join(f"{each / known:.3g}" for each in ends) if known else "–"
    row = [name, f"{runs}", truth, f"{count}", _share(found["covers"], known)]
    return [*row, _share(found["estimates"], count), mean, _share(count - known, count)]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in totals(rows, KEYS, ("count", "covers")).items():
        if key[0] != "box" and cell.covers < 0.92 * cell.count:
            yield f"{key}: {per_cent(cell.covers, cell.count)} %"
    boxes = [row for row in rows if row["kind"] == "box"]
    for key, cell in totals(boxes, KEYS, ("covers", "intervals")).items():
        if cell.covers < 0.92 * cell.intervals:
            yield f"{key}: {per_cent(cell.covers, cell.intervals)} %"


TABLE = SeedTable(
    KEYS,
    _cases,
    _rows,
    {"specimens": _specimens, "specimens by runs": _of_runs, "boxes": _boxes},
    _failing,
    seeds=200,
)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
