"""How well 300 runs of the concrete study's rod give its mean depth and its mean residue.

Run it as ``python benchmarks/few_runs.py --output FILE.csv``, with uqpen installed, and then with
``--from FILE.csv … --markdown docs/coverage.md``; files of other seeds (``--first``) add up. Each
seed is a design of 300 runs, to which each kind of surrogate is fitted in five folds. True means
are from a million points of a Sobol' sequence.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from coverage_table import FEW_RUNS
from result_files import add_table_options, read_rows, result_file

from uqpen.core.processors import one_blas_thread
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.corrected_moments import CorrectedMoments
from uqpen.statistics.surrogate.corrected_statistics import correction_evidence
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.study.load import load_study
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.fitting import cross_fit
from uqpen.surrogates.gaussian_process import GaussianProcess

STUDY = load_study(Path(__file__).parents[1] / "studies" / "concrete.toml")
(VARIANT,) = STUDY.models.values()
OUTPUTS = {"penetration_depth": "depth", "projectile_residue": "residue"}
RUNS = 300
DESIGNS = {
    "monte-carlo": MonteCarlo(runs=RUNS),
    "latin-hypercube × 10": LatinHypercube(runs=RUNS, replicates=10),
}
_LOGARITHM = {"penetration_depth": "log"}
KINDS = {
    "polynomial-chaos": PolynomialChaos(design="runs", transform=_LOGARITHM),
    "gaussian-process": GaussianProcess(design="runs", transform=_LOGARITHM),
}
# Half-widths that such few runs are meant to reach, as shares of the mean.
AIMS = {"penetration_depth": 0.01, "projectile_residue": 0.008}
_TRUTH_RUNS = 2**20
_COLUMNS = ("seed", "design", "kind", "output", "mean", "lower", "upper", "plain", "truth")


def main() -> int:
    options = _options()
    if not options.earlier:
        _run(options)
        options.earlier = [options.output]
    rows = _read(options.earlier)
    page = "\n".join(_page(rows))
    if options.markdown:
        FEW_RUNS.fill(options.markdown, page)
    print(page)
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--kind", choices=tuple(KINDS), help="one of the kinds")
    add_table_options(parser, "few_runs.csv")
    return parser.parse_args()


def _run(options: argparse.Namespace) -> None:
    """Write the corrected means of each seed, design and kind."""
    truths = _truths()
    with result_file(options.output, _COLUMNS) as file:
        for seed in range(options.first, options.first + options.seeds):
            for design in DESIGNS:
                for kind in KINDS if options.kind is None else (options.kind,):
                    with one_blas_thread():
                        file.add(_rows(seed, design, kind, truths))
            print(f"seed {seed} is done", flush=True)


def _truths() -> dict[str, float]:
    runs = _runs(SobolSequence(runs=_TRUTH_RUNS), Stream(1, "few runs, truth"))
    return {name: float(np.nanmean(runs[name])) for name in OUTPUTS}


def _runs(design: Any, stream: Stream) -> xr.Dataset:
    points = next(design.rounds(STUDY.joint, stream)).assign(VARIANT.given)
    runs = evaluate(Evaluator(VARIANT.model, STUDY.constraints), points, {})
    return runs.assign_attrs(sampling=str(design.sampling))


def _rows(seed: int, design: str, kind: str, truths: dict[str, float]) -> Iterator[dict[str, Any]]:
    """Yield the corrected mean of each output."""
    stream = Stream(seed, "few runs", design)
    runs, surrogate = _runs(DESIGNS[design], stream), KINDS[kind]
    fitted = surrogate.fit("surrogate", runs, VARIANT.model, STUDY.joint, stream)
    folds = cross_fit(surrogate, "surrogate", runs, VARIANT.model, STUDY.joint, stream)
    draws = SurrogateDraws(fitted, STUDY.joint, STUDY.constraints, VARIANT.given, stream)
    found = correction_evidence(draws, folds, runs, None, _quantities())
    for output in OUTPUTS:
        mean = CorrectedMoments(found.runs[output]).mean()
        _, low, high = found.plain[output]["mean"].values
        values = (mean.value, mean.lower, mean.upper, (high - low) / 2, truths[output])
        yield dict(zip(_COLUMNS, (seed, design, kind, output, *values), strict=True))


def _quantities() -> list[QuantityOfInterest]:
    every = STUDY.model_quantities(VARIANT.model)
    return [each for each in every if each.output.name in OUTPUTS]


def _read(paths: Sequence[Path]) -> list[dict[str, Any]]:
    return [row | {name: float(row[name]) for name in _COLUMNS[4:]} for row in read_rows(paths)]


def _page(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    yield (
        "| design | surrogate | output | seeds | covers | half-width, median | 90 % of seeds |"
        + (" plain | seeds with a half-width of at most |")
    )
    yield "|---" * 9 + "|"
    for design in DESIGNS:
        for kind in KINDS:
            for output in OUTPUTS:
                key = (design, kind, output)
                of = [row for row in rows if (row["design"], row["kind"], row["output"]) == key]
                if of:
                    yield _line(of, *key)


def _line(rows: Sequence[dict[str, Any]], design: str, kind: str, output: str) -> str:
    widths = np.array([(row["upper"] - row["lower"]) / 2 / row["truth"] for row in rows])
    covers = np.mean([row["lower"] <= row["truth"] <= row["upper"] for row in rows])
    plain = np.median([row["plain"] / row["truth"] for row in rows])
    texts = (
        *(design, kind, OUTPUTS[output], f"{len(rows)}", f"{100 * covers:.0f} %"),
        *(f"{100 * width:.2f} %" for width in (np.median(widths), np.quantile(widths, 0.9), plain)),
        f"{100 * AIMS[output]:g} %: {100 * np.mean(widths <= AIMS[output]):.0f} %",
    )
    return f"| {' | '.join(texts)} |"


if __name__ == "__main__":
    sys.exit(main())
