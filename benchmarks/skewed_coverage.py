"""How often intervals of means and standard deviations cover, for skewed and heavy outputs.

Run it as ``python benchmarks/skewed_coverage.py --output FILE.csv``, with uqpen installed, and then
with ``--from FILE.csv … --markdown docs/coverage.md``. The functions have few inputs that matter,
most of them unbounded. All of them are evaluated at common points: the first inputs of a set of
many inputs are a set of few. A cell fails if its intervals without a note cover in less than 92 %.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from coverage_table import SKEWED
from result_files import add_table_options, read_rows, write_rows
from scipy import integrate, special

from uqpen.core.labels import NOTE
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence, sobol_points
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

FloatArray = npt.NDArray[np.float64]

LOWEST = 0.92
# A cell with fewer intervals has too large an error to be judged.
FEWEST = 50
OUTPUT = Output("y", "1")
QUANTITY = QuantityOfInterest(OUTPUT, "1")
STATISTICS = {"mean": "mean", "std": "standard deviation"}


class Function(NamedTuple):
    """A function of uniform inputs, with its exact mean and standard deviation."""

    inputs: int
    values: Callable[[FloatArray], FloatArray]
    mean: float
    std: float


def _peak(inputs: int) -> Function:
    """Genz's product peak with its top inside the cube."""

    def factor(u: Any) -> Any:
        return 1 / (1 + 25 * (u - 0.5) ** 2)

    first, second = (integrate.quad(lambda u, k=k: factor(u) ** k, 0, 1)[0] for k in (1, 2))
    std = math.sqrt(second**inputs - first ** (2 * inputs))
    return Function(inputs, lambda u: np.prod(factor(u), axis=-1), first**inputs, std)


def _corner_peak(inputs: int) -> Function:
    """Genz's corner peak (1 + x̄ · 5)^-(d + 1), by the alternating sum over the cube's corners."""
    slope, power = 5 / inputs, inputs + 1

    def moment(power: int) -> float:
        left = np.prod([slope * (power - each) for each in range(1, inputs + 1)])
        corners = (
            (-1) ** k * math.comb(inputs, k) * (1 + slope * k) ** (inputs - power)
            for k in range(inputs + 1)
        )
        return math.fsum(corners) / float(left)

    mean, second = moment(power), moment(2 * power)
    return Function(
        inputs,
        lambda u: (1 + slope * u.sum(axis=-1)) ** -power,
        mean,
        math.sqrt(second - mean**2),
    )


def _pareto(index: float) -> Function:
    mean, second = index / (index - 1), index / (index - 2)
    return Function(1, lambda u: (1 - u[..., 0]) ** (-1 / index), mean, math.sqrt(second - mean**2))


def _exponential(inputs: int, slope: float) -> Function:
    variance = inputs * slope**2
    mean = math.exp(variance / 2)
    return Function(
        inputs,
        lambda u: np.exp(slope * special.ndtri(u).sum(axis=-1)),
        mean,
        mean * math.sqrt(math.expm1(variance)),
    )


def _normal(u: FloatArray, position: int) -> FloatArray:
    return np.asarray(special.ndtri(u[..., position]))


FUNCTIONS: dict[str, Function] = {
    "x₁² + x₂³": Function(
        2,
        lambda u: (1 + 9 * u[..., 0]) ** 2 + (2 + _normal(u, 1)) ** 3,
        51.0,
        # Of a power of U(1, 10): (10⁵ - 1) / 45 - 37²; of (2 + z)³: 2⁶ + 15·2⁴ + 45·2² + 15 - 14².
        math.sqrt((10**5 - 1) / 45 - 37**2 + 499 - 14**2),
    ),
    "z⁴": Function(1, lambda u: _normal(u, 0) ** 4, 3.0, math.sqrt(96)),
    "exp z": _exponential(1, 1.0),
    "(1 + z₁/2)(1 + z₂/2)": Function(
        2, lambda u: (1 + _normal(u, 0) / 2) * (1 + _normal(u, 1) / 2), 1.0, 0.75
    ),
    "peak, 2 inputs": _peak(2),
    "peak, 5 inputs": _peak(5),
    "corner peak, 5 inputs": _corner_peak(5),
    "exp of a sum, 20 inputs": _exponential(20, 0.1),
    "sum, 20 inputs": Function(20, lambda u: special.ndtri(u).sum(axis=-1), 0.0, math.sqrt(20)),
    "Pareto 3.3": _pareto(3.3),
    "Pareto 2.5": _pareto(2.5),
}


class Design(NamedTuple):
    """Replicates of a number of points each; 0 replicates are independent draws."""

    draw: Callable[[np.random.Generator, int, int], FloatArray]
    replicates: int
    points: int

    def sample(self, rng: np.random.Generator, dimension: int) -> tuple[FloatArray, Sample]:
        """Points of the unit cube, and a sample at them whose values and inputs are to come."""
        sets = [self.draw(rng, self.points, dimension) for _ in range(max(self.replicates, 1))]
        points = np.concatenate(sets)
        everything = np.arange(len(points))
        return points, Sample(
            values=np.full(len(points), np.nan),
            used=everything,
            missing=everything[:0],
            columns=InputColumns.none(len(points)),
            replicates=everything // len(sets[0]),
            sampling=Sampling.STRATIFIED if self.replicates else Sampling.INDEPENDENT,
        )


def _blocks(rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
    """The matrices A and B of a replicate."""
    drawn = sobol_points(rng, points, 2 * dimension)
    return np.concatenate([drawn[:, :dimension], drawn[:, dimension:]])


_HYPERCUBE, _SOBOL, _HALTON = (
    LatinHypercube(runs=20, replicates=10),
    SobolSequence(runs=32),
    Halton(runs=32),
)
DESIGNS: dict[str, Design] = {
    "monte-carlo 200": Design(lambda rng, n, d: rng.random((n, d)), 0, 200),
    "monte-carlo 2 000": Design(lambda rng, n, d: rng.random((n, d)), 0, 2000),
    "latin-hypercube 10 × 20": Design(_HYPERCUBE.draw, 10, 20),
    "latin-hypercube 10 × 200": Design(_HYPERCUBE.draw, 10, 200),
    "sobol-sequence 1 024": Design(_SOBOL.draw, 16, 64),
    "sobol-sequence 8 192": Design(_SOBOL.draw, 16, 512),
    "halton 1 024": Design(_HALTON.draw, 16, 64),
    "saltelli 512": Design(_blocks, 16, 32),
}


def main() -> int:
    options = _options()
    if options.earlier:
        rows = _read(options.earlier)
    else:
        rows = list(_run(options.design, options.seeds, options.inputs))
        write_rows(options.output, rows)
    if options.markdown:
        SKEWED.fill(options.markdown, "\n".join(_page(rows)))
    failing = [row for row in rows if _fails(row)]
    for row in failing:
        print("FAILS", row)
    return 1 if failing else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--design", default="", help="part of a design's name")
    parser.add_argument("--inputs", type=int, default=20, help="the most that a function has")
    add_table_options(parser, "skewed_coverage.csv")
    return parser.parse_args()


def _run(part: str, seeds: int, most: int) -> Iterator[dict[str, Any]]:
    functions = {name: each for name, each in FUNCTIONS.items() if each.inputs <= most}
    dimension = max(each.inputs for each in functions.values())
    for name, design in DESIGNS.items():
        if part not in name:
            continue
        began = time.perf_counter()
        found = [_intervals(design, functions, dimension, seed) for seed in range(seeds)]
        print(f"{name}: {time.perf_counter() - began:.0f} s", flush=True)
        for function in functions:
            for statistic in STATISTICS:
                cells = [each[function, statistic] for each in found]
                row = {"function": function, "design": name, "statistic": statistic}
                row |= _summary(cells)
                print(row, flush=True)
                yield row


# Whether an interval covers, None where there is none; whether it carries a note.
_Cell = tuple[bool | None, bool]


def _intervals(
    design: Design, functions: dict[str, Function], dimension: int, seed: int
) -> dict[tuple[str, str], _Cell]:
    """Every interval that one seed's points give."""
    rng = Stream(seed, "coverage").generator()
    points, whole = design.sample(rng, dimension)
    found = {}
    for name, function in functions.items():
        values = function.values(points[:, : function.inputs])
        sample = replace(whole, values=values)
        for statistic, array in islice(sample_moments(sample, QUANTITY), 2):
            _, lower, upper = array.values.tolist()
            truth = getattr(function, statistic)
            covers = None if math.isnan(lower) else lower <= truth <= upper
            found[name, statistic] = covers, bool(str(array.coords[NOTE].values))
    return found


def _summary(cells: Sequence[_Cell]) -> dict[str, Any]:
    """Coverage of the intervals with and without a note, and their numbers."""
    row: dict[str, Any] = {"seeds": len(cells)}
    for name, has_note in (("plain", False), ("noted", True)):
        covers = [each for each, noted in cells if each is not None and noted is has_note]
        row[name] = len(covers)
        row[f"{name}_coverage"] = sum(covers) / len(covers) if covers else math.nan
    return row


def _fails(row: dict[str, Any]) -> bool:
    return row["plain"] >= FEWEST and row["plain_coverage"] < LOWEST


def _read(paths: Sequence[Path]) -> list[dict[str, Any]]:
    texts = ("function", "design", "statistic")
    return [
        {key: text if key in texts else float(text) for key, text in row.items()}
        for row in read_rows(paths)
    ]


def _page(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    designs = [name for name in DESIGNS if any(row["design"] == name for row in rows)]
    by_cell = {(row["statistic"], row["function"], row["design"]): row for row in rows}
    for statistic, title in STATISTICS.items():
        yield f"| {title} | {' | '.join(designs)} |"
        yield "|---" * (len(designs) + 1) + "|"
        for function in FUNCTIONS:
            cells = (_text(by_cell.get((statistic, function, design))) for design in designs)
            yield f"| {function} | {' | '.join(cells)} |"
        yield ""
    seeds = {
        design: int(next(r["seeds"] for r in rows if r["design"] == design)) for design in designs
    }
    yield f"Seeds: {', '.join(f'{count} for {design}' for design, count in seeds.items())}."


def _text(row: dict[str, Any] | None) -> str:
    """Coverage in per cent: of intervals without a note, and of those with one in brackets."""
    if row is None:
        return "–"
    texts = []
    for name, form in (("plain", "{:.1f}"), ("noted", "({:.1f})")):
        if row[name] >= FEWEST:
            share = row[name] / row["seeds"]
            of = f" of {100 * share:.0f} %" if share < 0.995 else ""
            texts.append(form.format(100 * row[f"{name}_coverage"]) + of)
    return ", ".join(texts) or "none"


if __name__ == "__main__":
    sys.exit(main())
