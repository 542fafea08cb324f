"""How often corrected estimates cover on the use cases of OpenTURNS, and what goes without a word.

A table of docs/coverage/use_cases.md as `seed_table.py` makes it, with OpenTURNS installed. Each
seed is a whole study: independent runs, and a surrogate of the kind under test, with the settings
of a user who states nothing.

A figure is off if its interval misses the true value. It goes without a word if it has no note
either. At most 2 % of all figures may.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr
from scipy import special
from seed_table import Row, SeedTable, lines, totals
from usecase_coverage import INFINITE_VARIANCE, QUANTILES, Truth, UseCase, true_values, use_cases

import uqpen
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import BOUND, INPUT, NOTE, PROBABILITY, SURROGATE_ESTIMATE

MOST_WITHOUT_A_WORD = 0.02
RUNS = (60, 200)
KINDS: dict[str, Any] = {
    "polynomial-chaos": uqpen.PolynomialChaos(design="runs"),
    "gaussian-process": uqpen.GaussianProcess(design="runs"),
}
STATISTICS = {
    "mean": "mean",
    "std": "standard deviation",
    "half_spread": "half the 16–84 % range",
    "quantile": "quantiles 0.05, 0.5, 0.95",
    "exceedance": "exceedance of the 95 % point",
    "first_order": "first-order index",
}
COUNTS = {
    "figures": "figures",
    "refused": "without an interval",
    "off": "off",
    "silent": "off, without a word",
    "surrogate_off": "surrogate's own figure off by more than the interval",
    "surrogate_silent": "of these inside an interval without a note",
}
# Marginals of these classes have bounds; polynomials then are of uniform inputs.
_BOUNDED = ("Uniform", "Beta", "Triangular", "TruncatedNormal", "Dirac")


@cache
def _use_cases() -> dict[str, UseCase]:
    return {case.name: case for case in use_cases()}


@cache
def _truths(name: str) -> list[Truth]:
    return list(true_values(_use_cases()[name]))


def _rows(name: str, kind: str, runs: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the counts of the study of a seed, by output and statistic."""
    case, truths = _use_cases()[name], _truths(name)
    for seed in seeds:
        archive = uqpen.run(_study(case, truths, kind, runs, seed))
        for number, (output, truth) in enumerate(zip(case.outputs, truths, strict=True)):
            found = archive[f"statistics/surrogate/y{number}"].to_dataset()
            for statistic in STATISTICS:
                is_infinite = statistic == "std" and output in INFINITE_VARIANCE
                if statistic in found and not is_infinite:
                    counts = _counts(found[statistic], statistic, truth)
                    yield {"output": output, "statistic": statistic, **counts}


def _study(case: UseCase, truths: Sequence[Truth], kind: str, runs: int, seed: int) -> uqpen.Study:
    """Return a study of a use case, whose inputs are standard normal or uniform from 0 to 1."""
    is_bounded = [
        case.distribution.getMarginal(number).getImplementation().getClassName() in _BOUNDED
        for number in range(case.dimension)
    ]

    def evaluate(**inputs: FloatArray) -> dict[str, FloatArray]:
        columns = [
            column if bounded else special.ndtr(column)
            for column, bounded in zip(inputs.values(), is_bounded, strict=True)
        ]
        found = np.asarray(case.model(case.inputs(np.stack(columns, axis=-1))))
        return {f"y{number}": values for number, values in enumerate(found.T)}

    names = [f"x{number}" for number in range(case.dimension)]
    return uqpen.Study(
        model=uqpen.PythonModel(
            evaluate,
            inputs=dict.fromkeys(names, "1"),
            outputs={f"y{number}": "1" for number in range(len(truths))},
            vectorized=True,
        ),
        inputs={
            name: uqpen.Uniform(0, 1) if bounded else uqpen.Normal(0, 1)
            for name, bounded in zip(names, is_bounded, strict=True)
        },
        outputs={
            f"y{number}": uqpen.OutputSpec(
                "1", exceeds=[repr(truth.threshold)], quantiles=list(QUANTILES)
            )
            for number, truth in enumerate(truths)
        },
        designs={"runs": uqpen.MonteCarlo(runs=runs)},
        surrogates={"surrogate": KINDS[kind]},
        seed=seed,
    )


def _counts(array: xr.DataArray, statistic: str, truth: Truth) -> dict[str, int]:
    """Return how many figures of a statistic are off, and how many of them without a word."""
    counts = dict.fromkeys(COUNTS, 0)
    for estimate, true in _figures(array, statistic, truth):
        _, lower, upper = estimate.transpose(..., BOUND).values.tolist()
        own = float(estimate[SURROGATE_ESTIMATE]) if SURROGATE_ESTIMATE in estimate.coords else None
        counts["figures"] += 1
        if math.isnan(upper - lower):
            counts["refused"] += 1
            continue
        has_note = NOTE in estimate.coords and bool(str(estimate.coords[NOTE].values))
        is_off = not lower <= true <= upper
        counts["off"] += is_off
        counts["silent"] += is_off and not has_note
        if own is not None and abs(own - true) > (upper - lower) / 2:
            counts["surrogate_off"] += 1
            counts["surrogate_silent"] += lower <= own <= upper and not has_note
    return counts


def _figures(
    array: xr.DataArray, statistic: str, truth: Truth
) -> Iterator[tuple[xr.DataArray, float]]:
    """Yield the estimates of a statistic that have a true value, with that."""
    values: Mapping[str, float] = truth.values
    if statistic == "quantile":
        for p in QUANTILES:
            yield array.sel({PROBABILITY: p}), values[f"quantile {p}"]
    elif statistic == "exceedance":
        yield array[0], values[statistic]
    elif statistic == "first_order":
        if not math.isnan(values[statistic]):
            yield array.sel({INPUT: f"x{truth.driver}"}), values[statistic]
    else:
        yield array, values[statistic]


def _page(rows: Sequence[Row]) -> Iterator[str]:
    by_statistic = totals(rows, "kind", "runs", "statistic")
    by_size = totals(rows, "kind", "runs")
    for (kind, runs), whole in by_size.items():
        found = {STATISTICS[each]: by_statistic.get((kind, runs, each)) for each in STATISTICS}
        of = [[title, *_numbers(cell)] for title, cell in found.items() if cell]
        head = [f"{kind}, {runs} runs", *COUNTS.values()]
        yield from lines(head, [*of, ["**all**", *_numbers(whole)]])
        yield ""
    outputs = len({row["output"] for row in rows})
    whole = totals(rows)[()]
    yield (
        f"{outputs} outputs. Of {whole.figures} figures, {whole.silent} are off without a"
        f" word: {100 * whole.silent / whole.figures:.2f} %."
    )


def _numbers(cell: SimpleNamespace) -> list[int]:
    return [getattr(cell, name) for name in COUNTS]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    whole = totals(rows)[()]
    if whole.silent > MOST_WITHOUT_A_WORD * whole.figures:
        yield f"{whole.silent} of {whole.figures} figures"


TABLE = SeedTable(
    ("case", "kind", "runs"),
    _rows,
    {"surrogates of use cases": _page},
    _failing,
    seeds=20,
    cases=lambda: product(_use_cases(), KINDS, RUNS),
)

if __name__ == "__main__":
    TABLE.main(__doc__)
