"""How often corrected estimates cover on the use cases of OpenTURNS, and what goes without a word.

Run it as ``python benchmarks/surrogate_usecases.py --output FILE.csv``, with uqpen and OpenTURNS
installed, and then with ``--from FILE.csv … --markdown docs/coverage.md``; files of other seeds
(``--first``) add up. Each seed is a whole study: independent runs, and a surrogate of the kind
under test, with the settings of a user who states nothing.

A figure is off if its interval misses the true value. It goes without a word if it has no note
either. At most 2 % of all figures may.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from coverage_table import SURROGATE_USE_CASES
from result_files import add_table_options, read_rows, result_file
from scipy import special
from usecase_coverage import INFINITE_VARIANCE, QUANTILES, Truth, UseCase, true_values, use_cases

import uqpen
from uqpen.core.labels import BOUND, INPUT, NOTE, PROBABILITY, SURROGATE_ESTIMATE

FloatArray = npt.NDArray[np.float64]

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
_KEY = ("output", "kind", "runs", "statistic")


def main() -> int:
    options = _options()
    if not options.earlier:
        _run(options)
        options.earlier = [options.output]
    rows = _read(options.earlier)
    page = "\n".join(_page(rows))
    if options.markdown:
        SURROGATE_USE_CASES.fill(options.markdown, page)
    print(page)
    total = _total(rows)
    return 1 if total["silent"] > MOST_WITHOUT_A_WORD * total["figures"] else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", default="", help="part of a use case's name", metavar="SUBSTRING")
    parser.add_argument("--kind", choices=tuple(KINDS), help="one of the kinds")
    add_table_options(parser, "surrogate_usecases.csv")
    return parser.parse_args()


def _run(options: argparse.Namespace) -> None:
    """Write the counts of each study, one seed of all use cases after the other."""
    cases = [case for case in use_cases() if options.only in case.name]
    truths = {case.name: list(true_values(case)) for case in cases}
    with result_file(options.output, (*_KEY, *COUNTS)) as file:
        for seed in range(options.first, options.first + options.seeds):
            for case in cases:
                for kind in KINDS if options.kind is None else (options.kind,):
                    for runs in RUNS:
                        file.add(_rows(case, truths[case.name], kind, runs, seed))
            print(f"seed {seed} is done", flush=True)


def _rows(
    case: UseCase, truths: Sequence[Truth], kind: str, runs: int, seed: int
) -> Iterator[dict[str, Any]]:
    """Yield the counts of the study of a seed, by output and statistic."""
    archive = uqpen.run(_study(case, truths, kind, runs, seed))
    for number, (output, truth) in enumerate(zip(case.outputs, truths, strict=True)):
        found = archive[f"statistics/surrogate/y{number}"].to_dataset()
        for statistic in STATISTICS:
            if statistic == "std" and output in INFINITE_VARIANCE:
                continue
            if statistic in found:
                described = dict(zip(_KEY, (output, kind, runs, statistic), strict=True))
                yield described | _counts(found[statistic], statistic, truth)


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
        has_note = bool(_text(estimate))
        is_off = not lower <= true <= upper
        counts["off"] += is_off
        counts["silent"] += is_off and not has_note
        if own is not None and abs(own - true) > (upper - lower) / 2:
            counts["surrogate_off"] += 1
            counts["surrogate_silent"] += lower <= own <= upper and not has_note
    return counts


def _text(estimate: xr.DataArray) -> str:
    note = estimate.coords.get(NOTE)
    return "" if note is None else str(note.values)


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


def _read(paths: Sequence[Path]) -> list[dict[str, Any]]:
    return [row | {name: int(row[name]) for name in ("runs", *COUNTS)} for row in read_rows(paths)]


def _total(rows: Sequence[Mapping[str, Any]]) -> Counter[str]:
    total: Counter[str] = Counter()
    for row in rows:
        total.update({name: row[name] for name in COUNTS})
    return total


def _page(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for kind in dict.fromkeys(row["kind"] for row in rows):
        for runs in RUNS:
            of = [row for row in rows if (row["kind"], row["runs"]) == (kind, runs)]
            if of:
                yield f"| {kind}, {runs} runs | {' | '.join(COUNTS.values())} |"
                yield "|---" * (len(COUNTS) + 1) + "|"
                for statistic, title in STATISTICS.items():
                    yield _line(title, [row for row in of if row["statistic"] == statistic])
                yield _line("**all**", of)
                yield ""
    total = _total(rows)
    outputs = len({row["output"] for row in rows})
    yield (
        f"{outputs} outputs. Of {total['figures']} figures, {total['silent']} are off without a"
        f" word: {100 * total['silent'] / total['figures']:.2f} %."
    )


def _line(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    total = _total(rows)
    return f"| {title} | {' | '.join(str(total[name]) for name in COUNTS)} |"


if __name__ == "__main__":
    sys.exit(main())
