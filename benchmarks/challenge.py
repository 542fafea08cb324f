"""Scores of a black-box challenge: how near the answers are, and whether their intervals cover.

Run it as ``python benchmarks/challenge.py answers.csv … --truths truths.csv``. A line of the
answers has ``participant,problem,repeat,runs,estimate,lower,upper``; without an interval, the last
two are empty. A line of the truths has ``problem,truth``; it is not 0. All are in one unit for a
problem.

The interval score of Gneiting and Raftery (2007, J. Am. Stat. Assoc. 102, 359-378) is the width of
an interval, plus a penalty of 2/(1 - level) for each unit by which the truth lies outside. Its
expectation is least for the quantiles that the participant believes in, so nobody gains by an
interval that is too wide or too narrow. Errors and scores are relative to the truth.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from seed_table import fill, lines

from uqpen.core.arrays import FloatArray
from uqpen.statistics.intervals import clopper_pearson, student_quantile

LEVEL = 0.95


class Answer(NamedTuple):
    """One answer of a participant to a problem; the ends of its interval are NaN without one."""

    participant: str
    problem: str
    repeat: int
    runs: int
    estimate: float
    lower: float
    upper: float


class Score(NamedTuple):
    """Score of a participant in a problem, over repeats.

    Attributes
    ----------
    repeats, refused : int
        Answers, and those among them without an interval.
    runs : float
        Mean number of runs of an answer.
    bias, error : float
        Mean and root mean square of the errors, relative to the truth.
    coverage : tuple of float
        Share of the intervals that contain the truth, with its own 95 % interval (Clopper-Pearson).
    interval_score : tuple of float
        Mean over the intervals, relative to the truth, with a 95 % interval (Student's t).
    """

    repeats: int
    refused: int
    runs: float
    bias: float
    error: float
    coverage: tuple[float, float, float]
    interval_score: tuple[float, float, float]


def interval_score(
    lower: FloatArray, upper: FloatArray, truth: float, level: float = LEVEL
) -> FloatArray:
    """Return the interval score of each interval, in the unit of the truth; smaller is better.

    Equation (43) of Gneiting and Raftery, with alpha = 1 - level.
    """
    outside = np.maximum(lower - truth, 0) + np.maximum(truth - upper, 0)
    return (upper - lower) + 2 / (1 - level) * outside


def score(answers: Sequence[Answer], truth: float, level: float = LEVEL) -> Score:
    """Score the answers of one participant to one problem."""
    runs, estimate, lower, upper = np.array([each[3:] for each in answers], dtype=np.float64).T
    errors = (estimate - truth) / truth
    stated = ~(np.isnan(lower) | np.isnan(upper))
    lower, upper = lower[stated], upper[stated]
    covers = int(((lower <= truth) & (truth <= upper)).sum())
    size = int(stated.sum())
    ends = clopper_pearson(covers, size, 0.95) if size else (np.nan, np.nan)
    return Score(
        len(answers),
        len(answers) - size,
        float(runs.mean()),
        float(errors.mean()),
        float(np.sqrt(np.mean(errors**2))),
        (covers / size if size else math.nan, float(ends[0]), float(ends[1])),
        _mean_with_interval(interval_score(lower, upper, truth, level) / abs(truth)),
    )


def _mean_with_interval(values: FloatArray) -> tuple[float, float, float]:
    """Return a mean with its 95 % interval by Student's t; NaN where there are too few values."""
    if values.size < 2:
        return (float(values.mean()) if values.size else math.nan, math.nan, math.nan)
    half = student_quantile(values.size - 1, 0.95) * values.std(ddof=1) / math.sqrt(values.size)
    return float(values.mean()), float(values.mean() - half), float(values.mean() + half)


def page(
    answers: Sequence[Answer], truths: Mapping[str, float], level: float = LEVEL
) -> Iterator[str]:
    """Yield the lines of the table; within a problem, the best interval score comes first."""
    head = ["problem", "participant", "answers", "without interval", "runs", "bias", "error"]
    head += ["coverage (95 % interval)", "interval score (95 % interval)"]
    table = []
    groups: dict[tuple[str, str], list[Answer]] = {}
    for answer in answers:
        groups.setdefault((answer.problem, answer.participant), []).append(answer)
    for problem, truth in truths.items():
        found = {
            participant: score(group, truth, level)
            for (name, participant), group in groups.items()
            if name == problem
        }
        ranked = sorted(found.items(), key=lambda item: _rank(item[1]))
        table += [_line(problem, *each) for each in ranked]
    yield from lines(head, table)


def _rank(found: Score) -> tuple[int, float, float]:
    """Return where a score comes: who refuses more intervals comes later."""
    mean = found.interval_score[0]
    return found.refused, math.inf if math.isnan(mean) else mean, found.error


def _line(problem: str, participant: str, found: Score) -> list[object]:
    coverage = " to ".join(f"{100 * end:.1f}" for end in found.coverage[1:])
    scores = " to ".join(f"{end:.3g}" for end in found.interval_score[1:])
    return [
        *(problem, participant, found.repeats, found.refused, f"{found.runs:.0f}"),
        *(f"{100 * found.bias:+.1f} %", f"{100 * found.error:.1f} %"),
        f"{100 * found.coverage[0]:.1f} % ({coverage} %)",
        f"{found.interval_score[0]:.3g} ({scores})",
    ]


def read_answers(paths: Sequence[Path]) -> list[Answer]:
    """Read files of answers; a ValueError names the line of a mistake."""
    found = []
    for path in paths:
        for number, row in _rows(path):
            try:
                ends = [
                    float(row[key]) if row[key].strip() else math.nan for key in Answer._fields[5:]
                ]
                estimate, counts = float(row["estimate"]), (int(row["repeat"]), int(row["runs"]))
            except (KeyError, ValueError, AttributeError) as error:
                raise ValueError(f"{path}:{number}: no answer: {error}") from None
            if ends[0] > ends[1]:
                raise ValueError(f"{path}:{number}: the lower end is above the upper one")
            found.append(Answer(row["participant"], row["problem"], *counts, estimate, *ends))
    return found


def read_truths(path: Path) -> dict[str, float]:
    """Read the true values by problem."""
    return {row["problem"]: float(row["truth"]) for _, row in _rows(path)}


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    with path.open(newline="", encoding="utf-8") as file:
        yield from enumerate(csv.DictReader(file), 2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("answers", nargs="+", type=Path, metavar="ANSWERS.csv")
    parser.add_argument("--truths", type=Path, required=True, metavar="TRUTHS.csv")
    parser.add_argument("--level", type=float, default=LEVEL, help="of the stated intervals")
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="a page with marks")
    options = parser.parse_args()
    answers, truths = read_answers(options.answers), read_truths(options.truths)
    text = "\n".join(page(answers, truths, options.level))
    print(text)
    if options.markdown:
        fill(options.markdown, "challenge", text)


if __name__ == "__main__":
    main()
