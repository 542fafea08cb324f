"""How well 300 runs of the concrete study's rod give its mean depth and its mean residue.

A table of docs/coverage/surrogates.md as `seed_table.py` makes it. Each
seed is a design of 300 runs, to which each kind of surrogate is fitted in five folds. True means
are from a million points of a Sobol' sequence.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from seed_table import STUDIES, Row, SeedTable, grouped, lines

from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics.surrogate.corrected_moments import CorrectedMoments
from uqpen.statistics.surrogate.corrected_statistics import correction_evidence
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.study.load import load_study
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.fitting import cross_fit
from uqpen.surrogates.gaussian_process import GaussianProcess

STUDY = load_study(STUDIES / "concrete.toml")
(VARIANT,) = STUDY.models.values()
OUTPUTS = {"penetration_depth": "depth", "projectile_residue": "residue"}
QUANTITIES = [each for each in STUDY.model_quantities(VARIANT.model) if each.output.name in OUTPUTS]
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


@cache
def _truths() -> dict[str, float]:
    runs = _runs(SobolSequence(runs=_TRUTH_RUNS), Stream(1, "few runs, truth"))
    return {name: float(np.nanmean(runs[name])) for name in OUTPUTS}


def _runs(design: Any, stream: Stream) -> xr.Dataset:
    points = next(design.rounds(STUDY.joint, stream)).assign(VARIANT.given)
    runs = evaluate(Evaluator(VARIANT.model, STUDY.constraints), points, {})
    return runs.assign_attrs(sampling=str(design.sampling))


def _rows(design: str, kind: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the corrected mean of each output."""
    for seed in seeds:
        stream = Stream(seed, "few runs", design)
        runs, surrogate = _runs(DESIGNS[design], stream), KINDS[kind]
        fitted = surrogate.fit("surrogate", runs, VARIANT.model, STUDY.joint, stream)
        folds = cross_fit(surrogate, "surrogate", runs, VARIANT.model, STUDY.joint, stream)
        draws = SurrogateDraws(fitted, STUDY.joint, STUDY.constraints, VARIANT.given, stream)
        found = correction_evidence(draws, folds, runs, None, QUANTITIES)
        for output in OUTPUTS:
            mean = CorrectedMoments(found.runs[output]).mean()
            _, low, high = found.plain[output]["mean"].values
            row = {"output": output, "mean": mean.value, "lower": mean.lower, "upper": mean.upper}
            yield row | {"plain": (high - low) / 2, "truth": _truths()[output]}


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ["design", "surrogate", "output", "seeds", "covers", "half-width, median"]
    head += ["90 % of seeds", "plain", "seeds with a half-width of at most"]
    of = grouped(rows, "design", "kind", "output")
    cases = product(DESIGNS, KINDS, OUTPUTS)
    yield from lines(head, (_line(of[key], *key) for key in cases if key in of))


def _line(rows: Sequence[Row], design: str, kind: str, output: str) -> list[str]:
    widths = np.array([(row["upper"] - row["lower"]) / 2 / row["truth"] for row in rows])
    covers = np.mean([row["lower"] <= row["truth"] <= row["upper"] for row in rows])
    plain = np.median([row["plain"] / row["truth"] for row in rows])
    return [
        *(design, kind, OUTPUTS[output], f"{len(rows)}", f"{100 * covers:.0f} %"),
        *(f"{100 * width:.2f} %" for width in (np.median(widths), np.quantile(widths, 0.9), plain)),
        f"{100 * AIMS[output]:g} %: {100 * np.mean(widths <= AIMS[output]):.0f} %",
    ]


TABLE = SeedTable({"design": DESIGNS, "kind": KINDS}, _rows, {"300 runs": _page}, seeds=100)

if __name__ == "__main__":
    TABLE.main(__doc__)
