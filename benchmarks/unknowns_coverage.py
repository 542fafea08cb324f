"""How often estimates over unknowns of distributions contain the true ones.

Three tables of docs/coverage/unknowns.md as `seed_table.py` makes them. The first is of parameters
fitted to eight specimens, the probability of each draw exact; the second has it from runs by
weights; the third is of parameters that are intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy
import xarray as xr
from seed_table import LOWEST, Case, Row, SeedTable, mean_range, share, share_of, table, totals

from uqpen.core.arrays import FloatArray
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
    output: Callable[[Mapping[str, FloatArray]], FloatArray],
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
    output: Callable[[Mapping[str, FloatArray]], FloatArray]
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


def _rows(kind: str, name: str, runs: int, seeds: Sequence[int]) -> Iterator[Row]:
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


_HOLDS = {"holds P = 0.05": share_of("covers"), "holds P = 0.001": share_of("covers_rare")}
COLUMNS = {
    "specimens": {
        "family": "name",
        "seeds": "count",
        **_HOLDS,
        "next one below the 5 % value, as fitted": lambda c: (
            f"{100 * c.next_fitted / c.count:.2f} %"
        ),
        "predictive": lambda c: f"{100 * c.next / c.count:.2f} %",
    },
    "runs": {
        "inputs": "name",
        "runs": "runs",
        "seeds": "count",
        **_HOLDS,
        "as fitted, P = 0.05": share_of("plug_in"),
        "as fitted, P = 0.001": share_of("plug_in_rare"),
    },
    "box": {
        "box": "name",
        "runs": "runs",
        "true bounds": lambda c: " to ".join(f"{each:.3g}" for each in BOXES[c.name].bounds),
        "seeds": "count",
        "both are contained": share_of("covers", "intervals"),
        "by estimates alone": share_of("estimates"),
        "mean range": mean_range,
        "refused": lambda c: share(c.count - c.intervals, c.count),
    },
}


def _page(kind: str, rows: Sequence[Row]) -> Iterator[str]:
    own = [row for row in rows if row["kind"] == kind]
    return table(totals(own, *KEYS).values(), COLUMNS[kind])


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in totals(rows, *KEYS).items():
        given = cell.intervals if cell.kind == "box" else cell.count
        if cell.covers < LOWEST * given:
            yield f"{key}: {share(cell.covers, given)}"


TABLE = SeedTable(
    KEYS,
    _rows,
    {
        "specimens": partial(_page, "specimens"),
        "specimens by runs": partial(_page, "runs"),
        "boxes": partial(_page, "box"),
    },
    _failing,
    seeds=200,
    cases=_cases,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
