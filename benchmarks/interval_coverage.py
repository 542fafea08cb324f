"""How often every interval covers, over many seeds; the reason for each label that one carries.

Run it as ``python benchmarks/interval_coverage.py``, with uqpen installed. It goes the way a study
goes, from drawn points over the model's runs to the analyses, on functions whose statistics are
known: exactly, or from four million scrambled Sobol' points. Thousand seeds tell a coverage of
95 % to 0.7 points. A cell fails if an interval called nominal covers in less than 92 % or more
than 98 % of the seeds, or if any other covers in less than 92 %; intervals that warn of their tail
are listed apart, and so are statistics that get none.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy import stats
from scipy.stats import qmc

from uqpen.analyses import ANALYSES
from uqpen.analyses.question import Question, Threshold
from uqpen.analyses.sample import Sample
from uqpen.archive.told import told
from uqpen.designs.design import Design
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.evaluation import Evaluator, evaluate
from uqpen.inputs.constraints import parse_constraint
from uqpen.inputs.distributions import Distribution, Normal, Uniform
from uqpen.inputs.law import InputLaw, RandomInput
from uqpen.labels import BOUNDS, RUN, SAMPLING, Status
from uqpen.lookup import resolve
from uqpen.model import Input, Model, Output
from uqpen.models.ishigami import Ishigami
from uqpen.models.python_function import PythonFunction
from uqpen.streams import Stream
from uqpen.study.load import load_study

FloatArray = npt.NDArray[np.float64]

STUDIES = Path(__file__).parents[1] / "studies"
REFERENCE_EXPONENT = 22
REFERENCE_SEED = 20_010

LOWEST, HIGHEST = 0.92, 0.98
LABELS = ("nominal", "discrete", "conservative")
# Fewer seeds than this tell too little of a cell to judge it.
FEWEST_SEEDS = 50

QUANTILES = (0.05, 0.5, 0.95, 0.99)
HOLDS = (0.95, 0.99)
# Where the distribution function is looked at for a value fixed beforehand.
FIXED = (0.05, 0.5, 0.95)

DESIGNS: dict[str, Callable[[int], Design]] = {
    "monte-carlo": lambda runs: MonteCarlo(runs=runs),
    "latin-hypercube x10": lambda runs: LatinHypercube(runs=runs, replicates=10),
    "latin-hypercube x1": lambda runs: LatinHypercube(runs=runs, replicates=1),
    # The power of two of points in each of 16 replicates that comes nearest.
    "sobol-sequence x16": lambda runs: SobolSequence(
        runs=16 * 2 ** round(math.log2(runs / 16)), replicates=16
    ),
}


@dataclass(frozen=True)
class Truth:
    """What the statistics of an output should be.

    Parameters
    ----------
    mean, std : float
        Moments.
    cdf, quantile : callable
        The distribution function and its inverse, over arrays.
    shares : mapping of str to float
        Probability of each kind, of an output that has kinds beside the one looked at.
    """

    mean: float
    std: float
    cdf: Callable[[Any], FloatArray]
    quantile: Callable[[Any], FloatArray]
    shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Problem:
    """A model under a law, with the output whose statistics are known.

    Parameters
    ----------
    evaluator : Evaluator
        The model with its constraints.
    law : InputLaw
        Its inputs.
    output : Output
        The one looked at.
    truth : Truth
        Of that output.
    exceeds : tuple of float
        Thresholds.
    """

    evaluator: Evaluator
    law: InputLaw
    output: Output
    truth: Truth
    exceeds: tuple[float, ...]


class Cell(NamedTuple):
    """One interval of one seed; NaN in place of what there is not."""

    covers: float
    error: float
    half_width: float
    label: str
    warns: bool


def main() -> int:
    options = _options()
    chosen = [
        (problem, design, runs)
        for problem, design, runs in itertools.product(PROBLEMS, DESIGNS, options.runs)
        if options.only in f"{problem}, {design}, {runs} runs"
    ]
    problems = {name: PROBLEMS[name]() for name in dict.fromkeys(name for name, _, _ in chosen)}
    table: list[dict[str, str | float]] = []
    for name, design, runs in chosen:
        began = time.perf_counter()
        work = partial(cells, problems[name], DESIGNS[design](runs))
        collected = _over_seeds(work, options.seeds, options.workers)
        title = f"{name}, {design}, {runs} runs"
        print(f"\n{title} ({time.perf_counter() - began:.0f} s)", flush=True)
        for statistic in collected[0]:
            row = summary([seed[statistic] for seed in collected])
            print(f"  {_line(statistic, row)}", flush=True)
            table.append(
                {"problem": name, "design": design, "runs": runs, "statistic": statistic, **row}
            )
    _report(table)
    if options.output:
        _write(options.output, table)
    if options.markdown:
        options.markdown.write_text(_markdown(table, options.seeds), encoding="utf-8")
    return 1 if any(row["verdict"] == "FAILS" for row in table) else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument(
        "--runs",
        type=lambda text: [int(part) for part in text.split(",")],
        default=[100, 1000, 10_000],
        metavar="N,N,…",
    )
    parser.add_argument("--only", default="", help="part of a cell's title", metavar="SUBSTRING")
    parser.add_argument("--output", type=Path, metavar="FILE.csv")
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the table of the docs")
    parser.add_argument("--workers", type=int, default=1)
    return parser.parse_args()


def _over_seeds(
    work: Callable[[int], dict[str, Cell]], seeds: int, workers: int
) -> list[dict[str, Cell]]:
    """Results in the order of the seeds, which alone decide them."""
    if workers == 1:
        return [work(seed) for seed in range(seeds)]
    # Forked workers share the reference samples; the work itself is not sent, being no plain data.
    global _work
    _work = work
    with multiprocessing.get_context("fork").Pool(workers) as pool:
        return pool.map(_call, range(seeds), chunksize=max(1, seeds // (8 * workers)))


_work: Callable[[int], dict[str, Cell]]


def _call(seed: int) -> dict[str, Cell]:
    return _work(seed)


def cells(problem: Problem, design: Design, seed: int) -> dict[str, Cell]:
    """Every interval that one seed's runs get, held against the truth."""
    points = next(design.rounds(problem.law, Stream(seed, "designs", "coverage")))
    runs = evaluate(problem.evaluator, points, {}).assign_attrs({SAMPLING: str(design.sampling)})
    found = dict(_moments(problem, runs))
    found |= _quantiles(problem, runs)
    found |= _exceedance(problem, runs)
    found |= _cdf(problem, runs)
    found |= _shares(problem, runs)
    return found


def _moments(problem: Problem, runs: xr.Dataset) -> Iterator[tuple[str, Cell]]:
    truth = problem.truth
    low, high = truth.quantile([0.16, 0.84]).tolist()
    known = {"mean": truth.mean, "std": truth.std, "half_spread": (high - low) / 2}
    answers = _answers("moments", runs, Question(problem.output, ""))
    for statistic, value in known.items():
        yield statistic, _cell(answers[f"{problem.output.name}_{statistic}"], value)


def _quantiles(problem: Problem, runs: xr.Dataset) -> Iterator[tuple[str, Cell]]:
    name = problem.output.name
    question = Question(problem.output, "", quantiles=QUANTILES, hold=HOLDS)
    for p, answer in zip(QUANTILES, _answers("quantiles", runs, question)[name], strict=True):
        yield f"quantile {p}", _cell(answer, float(problem.truth.quantile(p)))
    for p, answer in zip(HOLDS, _answers("holds", runs, question)[name], strict=True):
        yield f"hold {p}", _cell(answer, float(problem.truth.quantile(p)), one_sided=True)


def _exceedance(problem: Problem, runs: xr.Dataset) -> Iterator[tuple[str, Cell]]:
    for value in problem.exceeds:
        probability = 1 - float(problem.truth.cdf(value))
        question = Question(problem.output, "", exceeds=(Threshold("", value),))
        answers = _answers("exceedance", runs, question)
        answer = answers[problem.output.name][0]
        yield f"P(> {value:.4g}) = {probability:.3g}", _cell(answer, probability)


def _cdf(problem: Problem, runs: xr.Dataset) -> Iterator[tuple[str, Cell]]:
    name = problem.output.name
    answers = _answers("cdfs", runs, Question(problem.output, ""))
    values = answers[name].values
    pointwise = answers[f"{name}_probability"]
    for p in FIXED:
        value = problem.truth.quantile(p)
        # Between two ranks the function is a step that the archive does not keep.
        between = [np.interp(value, values, column) for column in pointwise.values.T]
        yield f"cdf at fixed q{p}", _cell(pointwise[0].copy(data=between), p)
    band = answers[f"{name}_band"]
    _, lower, upper = band.values.T
    exact = problem.truth.cdf(values)
    inside = bool(((lower <= exact) & (exact <= upper)).all())
    error = float(np.abs(band.values[:, 0] - exact).max())
    half = float((upper - lower).max() / 2)
    yield "cdf band", Cell(inside, error, half, band.attrs["interval_label"], warns=False)


def _shares(problem: Problem, runs: xr.Dataset) -> Iterator[tuple[str, Cell]]:
    for output in problem.evaluator.model.outputs:
        if output.categories:
            answer = _answers("shares", runs, Question(output, ""))[output.name]
            for position, category in enumerate(output.categories):
                value = problem.truth.shares[category.flag]
                yield f"share {category.flag} = {value:.3g}", _cell(answer[position], value)


def _answers(analysis: str, runs: xr.Dataset, question: Question) -> dict[str, xr.DataArray]:
    sample = Sample.of(runs, question.output.name)
    (reference,) = ANALYSES[analysis]
    return dict(resolve(reference)(sample, question))


def _cell(answer: xr.DataArray, truth: float, *, one_sided: bool = False) -> Cell:
    estimate, lower, upper = (float(part) for part in answer.values)
    assert len(BOUNDS) == answer.shape[-1]
    error = estimate - truth
    label = told(answer, "interval_label")
    if math.isnan(upper) or (math.isnan(lower) and not one_sided):
        return Cell(math.nan, error, math.nan, "none", warns=False)
    covers = truth <= upper and (one_sided or lower <= truth)
    half = upper - estimate if one_sided else (upper - lower) / 2
    # Rounding alone decides whether an interval of an output that does not vary covers.
    covers = covers or abs(error) <= 1e-12 * abs(truth)
    return Cell(covers, error, half, label, warns=bool(told(answer, "note")))


def summary(found: Sequence[Cell]) -> dict[str, str | float]:
    """One cell over all seeds, with its verdict."""
    given = [cell for cell in found if cell.label != "none" and not cell.warns]
    warned = [cell for cell in found if cell.warns]
    row: dict[str, str | float] = {
        "given": len(given) / len(found),
        "coverage": _mean([cell.covers for cell in given]),
        "error_of_coverage": math.nan,
        "half_width": _mean([cell.half_width for cell in given]),
        # Half-width of the interval that an oracle would give: one that knows the error's scatter.
        "true_half_width": 1.96 * math.sqrt(_mean([cell.error**2 for cell in found])),
        "labels": _labels(given),
        "warned": len(warned) / len(found),
        "coverage_warned": _mean([cell.covers for cell in warned]),
    }
    if given:
        coverage = float(row["coverage"])
        row["error_of_coverage"] = math.sqrt(coverage * (1 - coverage) / len(given))
    row["verdict"] = _verdict(given, warned)
    return row


def _labels(given: Sequence[Cell]) -> str:
    """Each label with the share of seeds that got it and how often it covered."""
    texts = []
    for label in sorted({cell.label for cell in given}):
        covers = [cell.covers for cell in given if cell.label == label]
        if len(covers) == len(given):
            return label
        texts.append(f"{label} ({len(covers)} seeds: {100 * _mean(covers):.1f})")
    return ", ".join(texts)


def _verdict(given: Sequence[Cell], warned: Sequence[Cell]) -> str:
    if len(given) < FEWEST_SEEDS:
        if warned:
            return "warns"
        return "few" if given else "none given"
    coverage = _mean([cell.covers for cell in given])
    all_nominal = all(cell.label == "nominal" for cell in given)
    return "ok" if LOWEST <= coverage <= (HIGHEST if all_nominal else 1.0) else "FAILS"


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan


def _line(statistic: str, row: Mapping[str, Any]) -> str:
    text = (
        f"{statistic:24} {100 * row['coverage']:5.1f} ± {100 * row['error_of_coverage']:.1f}"
        f"  half-width {row['half_width']:.3e} (true {row['true_half_width']:.3e})"
        f"  {row['verdict']:10} {row['labels']}"
    )
    if row["given"] < 1:
        text += f"; given {100 * row['given']:.1f} %"
    if row["warned"]:
        text += f"; warned {100 * row['warned']:.1f} %, {100 * row['coverage_warned']:.1f} cover"
    return text


def _report(table: Sequence[Mapping[str, Any]]) -> None:
    """What is not simply right, by verdict, with every label that was given."""
    for verdict in ("FAILS", "warns", "few", "none given"):
        rows = [row for row in table if row["verdict"] == verdict]
        print(f"\n{verdict}: {len(rows)} of {len(table)} cells")
        for row in rows:
            where = f"{row['problem']}, {row['design']}, {row['runs']}: "
            print(f"  {where}{_line(row['statistic'], row)}")


# What the statistics of a cell begin with, and what a reader calls them.
_FAMILIES = {
    "mean": "mean",
    "std": "standard deviation",
    "half_spread": "half the 16–84 % range",
    "quantile": "quantiles 0.05, 0.5, 0.95, 0.99",
    "hold": "values not exceeded, 0.95 and 0.99",
    "P(": "probabilities from 0.5 to 0.00014",
    "share": "shares",
    "cdf at": "cdf at a value",
    "cdf band": "cdf, simultaneous band",
}


_HEAD = """\
# How often the intervals cover

Lowest and highest coverage, in per cent, of intervals that should cover 95 %: over {seeds} seeds of
each of {problems} problems with about 100, 1 000 and 10 000 runs. One cell of them has an error of
{error:.1f} points. *Discrete* and *conservative* intervals may cover more; cells whose interval
carries a warning are listed below. Made by `benchmarks/interval_coverage.py`.
"""


def _markdown(table: Sequence[Mapping[str, Any]], seeds: int) -> str:
    """Coverage by statistic and design, over all problems and sizes, and what is warned of."""
    designs = list(dict.fromkeys(str(row["design"]) for row in table))
    problems = len({row["problem"] for row in table})
    error = 100 * math.sqrt(0.95 * 0.05 / seeds)
    lines = [_HEAD.format(seeds=seeds, problems=problems, error=error)]
    lines += ["| statistic | " + " | ".join(designs) + " |", "|---" * (len(designs) + 1) + "|"]
    for prefix, name in _FAMILIES.items():
        of_family = [row for row in table if str(row["statistic"]).startswith(prefix)]
        cells = [_span([row for row in of_family if row["design"] == each]) for each in designs]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    for title, verdict, figure in (
        ("Nominal intervals outside 92 to 98 %", "FAILS", "coverage"),
        ("What carries a warning", "warns", "coverage_warned"),
    ):
        lines += ["", f"## {title}", "", "| cell | covers |", "|---|---|"]
        lines += [
            f"| {row['problem']}, {row['design']}, {row['runs']} runs: {row['statistic']} "
            f"| {100 * row[figure]:.1f} |"
            for row in table
            if row["verdict"] == verdict
        ]
    return "\n".join(lines) + "\n"


def _span(rows: Sequence[Mapping[str, Any]]) -> str:
    """The lowest and the highest coverage of some cells, and the labels they carry."""
    certain = [row for row in rows if row["verdict"] in ("ok", "FAILS")]
    if not certain:
        return "none"
    covered = [100 * row["coverage"] for row in certain]
    labels = [label for label in LABELS if any(label in row["labels"] for row in certain)]
    return f"{min(covered):.1f} … {max(covered):.1f} ({', '.join(labels)})"


def _write(path: Path, table: Sequence[Mapping[str, str | float]]) -> None:
    if not table:
        return
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]))
        writer.writeheader()
        writer.writerows(table)


def _concrete() -> Problem:
    study = load_study(STUDIES / "concrete.toml")
    study.model.prepare()
    evaluator = Evaluator(study.model, study.constraints)
    drawn = _reference(evaluator, study.law)
    depth = np.sort(drawn["penetration_depth"])
    termination = study.model.output("termination")
    shares = {
        category.flag: float((drawn["termination"] == position).mean())
        for position, category in enumerate(termination.categories)
    }
    truth = replace(_empirical(depth), shares=shares)
    output = study.model.output("penetration_depth")
    return Problem(evaluator, study.law, output, truth, (0.54, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0))


def _ishigami() -> Problem:
    model = Ishigami()
    a, b = model.a, model.b
    variance = 0.5 + a**2 / 8 + b * math.pi**4 / 5 + b**2 * math.pi**8 / 18
    evaluator = Evaluator(model)
    law = _law(model, [Uniform(-math.pi, math.pi)] * 3)
    drawn = _empirical(np.sort(_reference(evaluator, law)["y"]))
    truth = replace(drawn, mean=a / 2, std=math.sqrt(variance))
    return Problem(evaluator, law, model.outputs[0], truth, _beyond(truth))


def _additive() -> Problem:
    """A sum of normal inputs is normal."""
    model = _function("additive", lambda x1, x2, x3: {"y": x1 + x2 + x3})
    deviations = (1.0, 2.0, 0.5)
    law = _law(model, [Normal(0.0, deviation) for deviation in deviations])
    std = math.hypot(*deviations)
    exact = stats.norm(0.0, std)
    truth = Truth(0.0, std, exact.cdf, exact.ppf)
    return Problem(Evaluator(model), law, model.outputs[0], truth, _beyond(truth))


# Uniform inputs lie beyond x1 + x2 = _EDGE with this probability.
_JUMP = 0.3
_EDGE = 2 - math.sqrt(2 * _JUMP)
_RISE = 3.0


def _step() -> Problem:
    """A jump along a diagonal plus the square of a uniform input: a mixture of two such squares."""
    model = _function(
        "step", lambda x1, x2, x3: {"y": _RISE * (np.asarray(x1) + x2 > _EDGE) + np.square(x3)}
    )
    law = _law(model, [Uniform(0.0, 1.0)] * 3)
    truth = Truth(
        mean=_RISE * _JUMP + 1 / 3,
        std=math.sqrt(_RISE**2 * _JUMP * (1 - _JUMP) + 4 / 45),
        cdf=lambda y: (
            (1 - _JUMP) * np.sqrt(np.clip(y, 0, 1))
            + _JUMP * np.sqrt(np.clip(np.asarray(y) - _RISE, 0, 1))
        ),
        quantile=lambda p: np.where(
            np.asarray(p) <= 1 - _JUMP,
            np.square(np.asarray(p) / (1 - _JUMP)),
            _RISE + np.square((np.asarray(p) - 1 + _JUMP) / _JUMP),
        ),
    )
    return Problem(Evaluator(model), law, model.outputs[0], truth, _beyond(truth))


def _single_input() -> Problem:
    """A uniform input as it is: over strata, shares err by no more than counting whole runs."""
    model = _function("single input", lambda x1: {"y": x1}, names=("x1",))
    law = _law(model, [Uniform(0.0, 1.0)])
    exact = stats.uniform()
    truth = Truth(0.5, math.sqrt(1 / 12), exact.cdf, exact.ppf)
    # Not between two strata, where a share has no error at all.
    exceeds = (0.4987, 0.8953, 0.9871, 0.99877)
    return Problem(Evaluator(model), law, model.outputs[0], truth, exceeds)


def _half_lost() -> Problem:
    """A sum of two uniform inputs, of which the first is to be larger: a triangular law."""
    model = _function("half lost", lambda x1, x2: {"y": x1 + x2}, names=("x1", "x2"))
    law = _law(model, [Uniform(0.0, 1.0)] * 2)
    larger = parse_constraint("x1 > x2", {"x1": "1", "x2": "1"})
    exact = stats.triang(0.5, 0.0, 2.0)
    truth = Truth(1.0, math.sqrt(1 / 6), exact.cdf, exact.ppf)
    return Problem(Evaluator(model, (larger,)), law, model.outputs[0], truth, _beyond(truth))


PROBLEMS: dict[str, Callable[[], Problem]] = {
    "concrete depth": _concrete,
    "ishigami": _ishigami,
    "additive": _additive,
    "step": _step,
    "single input": _single_input,
    "half lost": _half_lost,
}


def _function(
    name: str,
    function: Callable[..., Mapping[str, Any]],
    names: tuple[str, ...] = ("x1", "x2", "x3"),
) -> PythonFunction:
    inputs = tuple(Input(name, "1") for name in names)
    called_in = dict.fromkeys((*names, "y"), "1")
    return PythonFunction(function, name, inputs, (Output("y", "1"),), called_in, vectorized=True)


def _law(model: Model, distributions: Sequence[Distribution]) -> InputLaw:
    entries = tuple(
        RandomInput(variable, distribution, variable.unit)
        for variable, distribution in zip(model.inputs, distributions, strict=True)
    )
    return InputLaw(entries, tuple(model.inputs))


def _beyond(truth: Truth) -> tuple[float, ...]:
    """Thresholds that are exceeded often, at times and rarely."""
    return tuple(truth.quantile([0.5, 0.9, 0.99, 0.999]).tolist())


def _reference(evaluator: Evaluator, law: InputLaw) -> dict[str, FloatArray]:
    """Admissible runs at scrambled Sobol' points; their errors are far below any interval's."""
    unit = qmc.Sobol(len(law.random), rng=REFERENCE_SEED).random_base2(REFERENCE_EXPONENT)
    parts: list[dict[str, FloatArray]] = []
    for some in np.split(unit, 64):
        points = law.points(some, {})
        columns = {
            str(name): np.broadcast_to(column.values, points.sizes[RUN])
            for name, column in points.data_vars.items()
        }
        results = evaluator(columns)
        ok = results.status == Status.OK
        parts.append({name: values[ok] for name, values in results.outputs.items()})
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _empirical(ordered: FloatArray) -> Truth:
    size = len(ordered)
    return Truth(
        mean=float(ordered.mean()),
        std=float(ordered.std()),
        cdf=lambda values: np.searchsorted(ordered, values, side="right") / size,
        quantile=lambda p: ordered[np.floor(np.asarray(p) * size).astype(np.int64)],
    )


if __name__ == "__main__":
    sys.exit(main())
