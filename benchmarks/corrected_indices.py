"""How often the corrected indices of surrogates cover where draws stand in for terms.

A table of docs/coverage/surrogates.md as `seed_table.py` makes it. Each seed is a whole study of
independent runs with a sparse polynomial chaos of an order fixed beforehand. Some studies have
inadmissible draws, some dependent inputs; a depth is fitted as its logarithm. So draws stand in for
terms in all of them. True indices are from pairs of draws of the model. A cell fails if its
intervals cover in less than 92 %.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from seed_table import LOWEST, STUDIES, Row, SeedTable, grouped, lines, per_cent

import uqpen
from uqpen.core.arrays import FloatArray
from uqpen.core.streams import Stream
from uqpen.execution import Evaluator
from uqpen.statistics.surrogate.surrogate_draws import ConditionalDraws, paired_outputs

_TRUTHS = 2

_ISHIGAMI = """
seed = {seed}
[model]
use = "ishigami"
[inputs]
x1 = {{ uniform = {{ lower = -3.141592653589793, upper = 3.141592653589793 }} }}
x2 = {{ uniform = {{ lower = -3.141592653589793, upper = 3.141592653589793 }} }}
x3 = {{ uniform = {{ lower = -3.141592653589793, upper = 3.141592653589793 }} }}
[outputs.y]
exceeds = [7]
"""
_DEPENDENT = """
[dependence]
copula = "gaussian"
of = "normal-scores"
pairs = [
    {{ inputs = ["x1", "x2"], correlation = 0.6 }},
    {{ inputs = ["x1", "x3"], correlation = 0.6 }},
    {{ inputs = ["x2", "x3"], correlation = 0.6 }},
]
"""
# A part of the draws is inadmissible, or next to none, so that draws stand in all the same.
_PARTIAL = '\n[constraints]\nkeep = ["x1 + x2 < 3"]\n'
_WHOLE = '\n[constraints]\nkeep = ["x1 < 3.1415"]\n'
_SURROGATE = """
[designs.runs]
kind = "monte-carlo"
runs = {runs}
[surrogates.chaos]
kind = "polynomial-chaos"
design = "runs"
order = {order}
truncation = 1.0
{transform}
"""


_STUDY = (STUDIES / "concrete.toml").read_text(encoding="utf-8")
_INPUTS = _STUDY[_STUDY.index("[model]") : _STUDY.index("[designs.")]
_CONCRETE = "seed = {seed}\n" + _INPUTS.replace("{", "{{").replace("}", "}}")


class Problem(NamedTuple):
    """A study by its text, and the order of its surrogate."""

    title: str
    text: str
    order: int
    transform: str = ""

    def study(self, runs: int, seed: int) -> uqpen.ValidatedStudy:
        """Return the study of a seed."""
        text = self.text + _SURROGATE
        return uqpen.parse_study(
            text.format(seed=seed, runs=runs, order=self.order, transform=self.transform)
        )


PROBLEMS = {
    "dependent": Problem("Ishigami, dependent", _ISHIGAMI + _DEPENDENT, 8),
    "partial": Problem("Ishigami, inadmissible draws", _ISHIGAMI + _PARTIAL, 8),
    "poor": Problem("Ishigami, order 4", _ISHIGAMI + _WHOLE, 4),
    "concrete": Problem("concrete", _CONCRETE, 4, 'transform = { penetration_depth = "log" }'),
}


@cache
def _truth(name: str) -> dict[tuple[str, str, str], FloatArray]:
    """Return the indices of the model itself, by output, variable and kind."""
    study = PROBLEMS[name].study(10, 0)
    (variant,) = study.models.values()
    evaluator = Evaluator(variant.model, study.constraints)
    single = [1 << number for number in range(len(study.joint.random))]
    others = [sum(single) - each for each in single]
    found = defaultdict(list)
    for number in range(_TRUTHS):
        draws = ConditionalDraws(evaluator, study.joint, variant.given, Stream(number, "truth"))
        (pairs,) = paired_outputs(draws, [evaluator], sorted({0, *single, *others}))
        for output, variable, function in _variables(study):
            whole = np.nanvar(function(pairs.first[output]))
            first = [pairs.explained(output, function, each) for each in single]
            found[output, variable, "first"].append(np.mean(first, axis=1) / whole)
            if study.joint.is_independent:
                total = [pairs.left(output, function, each) for each in others]
                found[output, variable, "total"].append(np.mean(total, axis=1) / whole)
    return {key: np.mean(each, axis=0) for key, each in found.items()}


def _variables(
    study: uqpen.ValidatedStudy,
) -> Iterator[tuple[str, str, Callable[[FloatArray], FloatArray]]]:
    """Yield an output, one of its variables and that as a function: itself, logarithm, events."""
    (variant,) = study.models.values()
    (surrogate,) = study.surrogates.values()
    for quantity in study.model_quantities(variant.model):
        output = quantity.output.name
        if quantity.output.categories:
            continue
        yield output, "", lambda values: values
        if output in surrogate.transform:
            yield output, "log_", np.log
        for each in quantity.thresholds:
            yield output, each.text, lambda y, x=each.value: np.where(np.isnan(y), np.nan, y > x)


def _rows(name: str, runs: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the intervals of all inputs."""
    for seed in seeds:
        tree = uqpen.run(PROBLEMS[name].study(runs, seed))
        for (output, variable, kind), exact in _truth(name).items():
            statistics = tree[f"statistics/chaos/{output}"]
            if variable in ("", "log_"):
                bounds = statistics[f"{variable}{kind}_order"].values
                title = f"{'log ' * bool(variable)}{output}"
            else:
                array = statistics[f"exceedance_{kind}_order"]
                (place,) = np.flatnonzero(array["threshold"].values == variable)
                bounds, title = array.values[place], f"{output} > {variable}"
            for number, (true, (_, lower, upper)) in enumerate(zip(exact, bounds, strict=True)):
                row = {"statistic": f"{title}, {kind}", "input": number}
                yield row | {"true": true, "lower": lower, "upper": upper}


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ("study", "runs", "index of", "seeds", "coverage", "width", "given")
    cells = sorted(grouped(rows, "study", "runs", "statistic").items())
    of = ([PROBLEMS[study].title, *key, *_texts(cell)] for (study, *key), cell in cells)
    yield from lines(head, of)


def _texts(rows: Sequence[Row]) -> list[str]:
    covering, widths = _given(rows)
    seeds = len({row["first"] for row in rows})
    if not widths:
        return [str(seeds), "–", "–", "0 %"]
    share = f"{100 * len(widths) / len(rows):.0f} %"
    return [str(seeds), per_cent(covering, len(widths)), f"{np.mean(widths):.3f}", share]


def _given(rows: Sequence[Row]) -> tuple[int, list[float]]:
    """Return how many intervals cover, and the widths of all that there are."""
    covering = sum(row["lower"] <= row["true"] <= row["upper"] for row in rows)
    widths = [row["upper"] - row["lower"] for row in rows]
    return covering, [width for width in widths if np.isfinite(width)]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, found in grouped(rows, "study", "runs", "statistic").items():
        covering, widths = _given(found)
        if covering < LOWEST * len(widths):
            yield f"{key}: {covering} of {len(widths)}"


TABLE = SeedTable(
    {"study": PROBLEMS, "runs": (100, 200, 500)},
    _rows,
    {"corrected indices": _page},
    _failing,
    seeds=300,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
