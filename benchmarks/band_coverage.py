"""How often simultaneous bands cover a whole curve, and tolerance bands hold their share.

A table of docs/coverage/fields.md as `seed_table.py` makes it. A band of the mean or of a quantile
covers where the true curve lies inside at all places that the band has. A tolerance band covers
where it holds its content of all curves. True curves are from half a million points of a Sobol'
sequence, contents from eight thousand. A cell fails below 92 %.

Curves that few runs decide at most places have a second figure: the share of places that the band
has. That of a tolerance band is the height of the highest one of all seeds, over the range of 95 %
of the values where this is largest.

The rod's truth is that of 65 536 runs, which ``--rod`` names a file for; they are made once, in two
minutes. Its independent runs are drawn from them, so this truth is exact; hypercubes are run.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import special
from scipy.stats import qmc
from seed_table import LOWEST, STUDIES, Row, SeedTable, grouped, lines, per_cent, totals
from skewed_coverage import Design

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.model import Dimension, Output
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.models.rod_trajectories import WalkerAndersonTrajectory
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.fields.simultaneous_bands import mean_band, quantile_band, tolerance_band
from uqpen.statistics.quantity_of_interest import DEFAULT_QUANTILES, QuantityOfInterest
from uqpen.study.load import load_study

ROD_INPUTS = load_study(STUDIES / "rod_course.toml").joint

# A cell with fewer bands has too large an error to be judged.
FEWEST = 100
CONTENT = 0.95
STATISTICS = ("mean", *(f"quantile {p:g}" for p in DEFAULT_QUANTILES), "tolerance band")


def campbell(u: FloatArray, angle: FloatArray) -> FloatArray:
    """Campbell-1D: four inputs U(-1, 5), a curve over an angle in degrees."""
    x1, x2, x3, x4 = (column[:, None] for column in (-1 + 6 * u).T)
    bell = np.exp(-((angle - 10 * x2) ** 2) / (60 * x1**2 + x3**2))
    return 10 + x1 * bell + (x2 + x4) * np.exp(0.002 * x1 * angle)


def arctangents(u: FloatArray, time: FloatArray) -> FloatArray:
    """Two inputs U(-7, 7), a curve over a period: atan(x1) cos t + atan(x2) sin t."""
    first, second = np.arctan(-7 + 14 * u).T
    return first[:, None] * np.cos(time) + second[:, None] * np.sin(time)


def pulse(u: FloatArray, time: FloatArray) -> FloatArray:
    """A travelling pulse: exp(a - (t - c)² / (2 · 0.15²)), a ~ N(0, 0.3), c ~ N(3, 0.6)."""
    height, centre = special.ndtri(u).T * np.array([[0.3], [0.6]])
    return np.exp(height[:, None] - (time - 3 - centre[:, None]) ** 2 / (2 * 0.15**2))


def step(u: FloatArray, time: FloatArray) -> FloatArray:
    """A step of a height U(1, 2) at a random time N(3, 0.6); 0 before."""
    is_after = time > 3 + 0.6 * special.ndtri(u[:, :1])
    return np.where(is_after, 1 + u[:, 1:], 0.0)


def rare(u: FloatArray, time: FloatArray) -> FloatArray:
    """A bump with a lognormal height in 4 % of the runs, else 0."""
    bump = np.exp(0.5 * special.ndtri(u[:, 1:]) - (time - 3) ** 2 / 2)
    return np.where(u[:, :1] < 0.04, bump, 0.0)


def rod(u: FloatArray, depth: FloatArray) -> FloatArray:
    """The nose velocity of the rod of ``studies/rod_course.toml``, which ends where it rests.

    A run that fails is NaN at all depths.
    """
    model = WalkerAndersonTrajectory(along="depth", depth_limit=depth[-1], depths=len(depth))
    fixed = {each.variable.name: np.full(len(u), each.value) for each in ROD_INPUTS.fixed}
    return model.evaluate({**fixed, **ROD_INPUTS.ppf(u)}).outputs["nose_velocity_at_depth"]


class Problem(NamedTuple):
    """Curves of uniform inputs, at some places.

    A model that takes long has a pool of curves, from which independent runs are drawn.
    """

    inputs: int
    curves: Callable[[FloatArray, FloatArray], FloatArray]
    places: FloatArray
    title: str
    pool: FloatArray | None = None

    def runs(self, points: FloatArray, design: Design) -> FloatArray:
        """Return the curves of a design's points."""
        if self.pool is None or design.replicates:
            return self.curves(points, self.places)
        return self.pool[(points[:, 0] * len(self.pool)).astype(np.int64)]


PROBLEMS = {
    "campbell": Problem(4, campbell, np.linspace(-90, 90, 181), "Campbell-1D"),
    "arctangents": Problem(
        2, arctangents, np.linspace(0, 2 * np.pi, 100), "atan x₁ cos t + atan x₂ sin t"
    ),
    "pulse": Problem(2, pulse, np.linspace(0, 6, 61), "a travelling pulse"),
    "step": Problem(2, step, np.linspace(0, 6, 61), "a step at a random place"),
    "rare": Problem(2, rare, np.linspace(0, 6, 61), "curves that are 0 but for 4 %"),
    "rod": Problem(4, rod, np.linspace(0, 1, 51), "velocity of a rod by depth, curves that end"),
}

_HYPERCUBE, _SOBOL = LatinHypercube(runs=20, replicates=10), SobolSequence(runs=32)
DESIGNS = {
    **{
        f"monte-carlo {runs}": Design(lambda rng, n, d: rng.random((n, d)), 0, runs)
        for runs in (100, 200, 400, 1000)
    },
    "latin-hypercube 10 × 20": Design(_HYPERCUBE.draw, 10, 20),
    "latin-hypercube 10 × 100": Design(_HYPERCUBE.draw, 10, 100),
    "sobol-sequence 16 × 64": Design(_SOBOL.draw, 16, 64),
    "sobol-sequence 32 × 32": Design(_SOBOL.draw, 32, 32),
}


class Truth(NamedTuple):
    """The true mean curve and quantile curves, by place, and curves that a band may hold."""

    mean: FloatArray
    quantiles: FloatArray
    curves: FloatArray

    @classmethod
    def of(cls, problem: Problem) -> Truth:
        """Compute the truth of a problem."""
        if problem.pool is not None:
            return cls(
                np.nanmean(problem.pool, axis=0),
                np.nanquantile(problem.pool, DEFAULT_QUANTILES, axis=0).T,
                problem.pool[: 2**13],
            )
        points = qmc.Sobol(problem.inputs, seed=1).random_base2(19)
        mean, quantiles = [], []
        for place in problem.places:
            values = problem.curves(points, np.array([place]))[:, 0]
            mean.append(values.mean())
            quantiles.append(np.quantile(values, DEFAULT_QUANTILES))
        others = qmc.Sobol(problem.inputs, seed=2).random_base2(13)
        curves = problem.curves(others, problem.places)
        return cls(np.array(mean), np.array(quantiles), curves)


@cache
def _problem(name: str, every: int, rod_runs: Path) -> tuple[Problem, Truth]:
    problem = PROBLEMS[name]._replace(places=PROBLEMS[name].places[::every])
    if name == "rod":
        problem = problem._replace(pool=_pool(problem, rod_runs))
    return problem, Truth.of(problem)


def _rows(name: str, design: str, seeds: Sequence[int], every: int, rod: Path) -> Iterator[Row]:
    """Yield numbers of bands and of those that cover, shares of places, and the largest height."""
    problem, truth = _problem(name, every, rod)
    found: dict[str, list[Band]] = defaultdict(list)
    for field in _fields(problem, truth, DESIGNS[design], seeds):
        for statistic, band in _bands(field, truth):
            found[statistic].append(band)
    for statistic, own in found.items():
        yield {
            "statistic": statistic,
            "covers": sum(band.covers for band in own),
            "bands": len(own),
            "places": sum(band.places for band in own),
            "highest": max(band.height for band in own),
        }


def _pool(problem: Problem, path: Path) -> FloatArray:
    """Return the curves of many runs that a file keeps, or make them."""
    if not path.exists():
        points = qmc.Sobol(problem.inputs, seed=1).random_base2(16)
        curves = problem.curves(points, problem.places)
        np.save(path, curves[~np.isnan(curves).all(axis=1)])
    pool: FloatArray = np.load(path)
    if pool.shape[1] != len(problem.places):
        raise SystemExit(f"{path}: curves at {pool.shape[1]} depths, not {len(problem.places)}")
    return pool


def _fields(
    problem: Problem, truth: Truth, design: Design, seeds: Sequence[int]
) -> Iterator[FieldSample]:
    """Yield the field of each seed's runs, which are made together: the rod is faster so."""
    dimension = Dimension("place", "1", values=tuple(problem.places))
    output = Output("y", "1", dims=(dimension,), may_end=bool(np.isnan(truth.curves).any()))
    drawn = [design.sample(Stream(seed, "coverage").generator(), problem.inputs) for seed in seeds]
    curves = problem.runs(np.concatenate([points for points, _ in drawn]), design)
    for values, (_, whole) in zip(np.split(curves, len(drawn)), drawn, strict=True):
        is_run = ~np.isnan(values).all(axis=1)
        runs = replace(whole, values=values[is_run], used=whole.used[is_run])
        yield FieldSample(runs, output)


class Band(NamedTuple):
    """Whether a band covers, its share of the places, and the height of one of tolerance."""

    covers: bool
    places: float
    height: float = 0


def _bands(field: FieldSample, truth: Truth) -> Iterator[tuple[str, Band]]:
    """Yield whether each band that one seed's runs give covers."""
    quantity = QuantityOfInterest(field.output, "1")
    ((_, mean),), ((_, quantiles),) = mean_band(field, quantity), quantile_band(field, quantity)
    curves = [mean, *(quantiles.isel(probability=k) for k in range(len(DEFAULT_QUANTILES)))]
    true = [truth.mean, *truth.quantiles.T]
    for statistic, band, curve in zip(STATISTICS, curves, true, strict=False):
        if share := _share_of_places(band):
            yield statistic, Band(bool(_is_inside(band, curve[None])[0]), share)
    ((_, tolerance),) = tolerance_band(field, quantity)
    one = tolerance.isel(band_content=0)
    if share := _share_of_places(one):
        is_held = _is_inside(one, truth.curves).mean() >= CONTENT
        ends = np.nanquantile(truth.curves, (0.025, 0.975), axis=0)
        height = np.nanmax(one.values[:, 2] - one.values[:, 1])
        highest = float(height / np.nanmax(ends[1] - ends[0]))
        yield STATISTICS[-1], Band(bool(is_held), share, highest)


def _share_of_places(band: xr.DataArray) -> float:
    return float(np.isfinite(band.values[:, 1:]).any(axis=1).mean())


def _is_inside(band: xr.DataArray, curves: FloatArray) -> BoolArray:
    """Mask of the curves that leave a band nowhere; NaN is no place, nor an end of the band."""
    _, lower, upper = band.values.T
    mask: BoolArray = ~((curves < lower) | (curves > upper)).any(axis=1)
    return mask


def _cells(rows: Sequence[Row]) -> dict[tuple[str, str, str], SimpleNamespace]:
    keys = ("problem", "design", "statistic")
    cells = totals(rows, *keys)
    for key, found in grouped(rows, *keys).items():
        cells[key].highest = max(row["highest"] for row in found)
    return cells


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in _cells(rows).items():
        if cell.bands >= FEWEST and cell.covers < LOWEST * cell.bands:
            yield f"{', '.join(key)}: {per_cent(cell.covers, cell.bands)}"


def _page(rows: Sequence[Row]) -> Iterator[str]:
    cells = _cells(rows)
    most = max(cell.bands for cell in cells.values())
    for name, problem in PROBLEMS.items():
        of = []
        for design in DESIGNS:
            found = [cells.get((name, design, each)) for each in STATISTICS]
            if any(found):
                of.append([design, *(_text(cell, most) for cell in found)])
        yield from lines([problem.title, *STATISTICS], of)
        yield ""
    yield f"Seeds: {most}, or the number in brackets."


def _text(cell: SimpleNamespace | None, most: float) -> str:
    if cell is None:
        return "–"
    if cell.bands < FEWEST:
        return "none"
    text = per_cent(cell.covers, cell.bands)
    if cell.highest:
        text += f", {cell.highest:.1f} times"
    elif cell.places < 0.995 * cell.bands:
        text += f", {100 * cell.places / cell.bands:.0f} % of places"
    return text + (f" ({cell.bands})" if cell.bands < most else "")


TABLE = SeedTable(
    {"problem": PROBLEMS, "design": DESIGNS},
    _rows,
    {"bands along a curve": _page},
    _failing,
    at_once=50,
    options={
        "--every": {"type": int, "default": 1, "help": "take every n-th place"},
        "--rod": {"type": Path, "default": Path("band_coverage_rod.npy"), "help": "its runs"},
    },
)

if __name__ == "__main__":
    TABLE.main(__doc__)
