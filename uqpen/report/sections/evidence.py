"""What the page's answers are made of: which design, and its runs as a sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from uqpen.analyses.question import Question, Threshold
from uqpen.analyses.sample import Sample, sample_of_law
from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.figures.texts import named
from uqpen.labels import EXCEEDANCE, MISSING, QUANTILES, RUNS, SHARES, STATUSES
from uqpen.model import Category, Output

__all__ = ["asked_of", "called", "leading", "left_out", "question_of", "sample_of", "titled"]


def leading(part: Part) -> str | None:
    """The design that answers come from; None where no run of a sample came back.

    It is the first of the study's whose runs are a sample, so that it is chosen by its place and
    not by what it says; one that is made for another purpose only where there is no other.
    """
    found = [name for name in part.samples if part.came_back(name)]
    plain = [name for name in found if part.is_plain(name)]
    return next(iter((*plain, *found)), None)


def sample_of(part: Part, design: str, output: str) -> Sample:
    """The runs of a design that came back, as a sample of an output."""
    return Sample.of(sample_of_law(group(part.tree, RUNS, design)), output)


def left_out(part: Part, design: str) -> list[str]:
    """What a distribution function and its band say nothing of, as a note; none where nothing."""
    missing = group(part.tree, STATUSES, design).attrs.get(MISSING)
    if not missing:
        return []
    return [f"Curve and band are of the runs that came back; {missing} did not."]


def question_of(part: Part, output: str, quantiles: Sequence[float]) -> Question:
    """What an analysis is asked of an output that is a number."""
    described = part.described(output)
    unit = str(described.get("units", ""))
    asked = Output(output, unit, str(described.get("long_name", output)))
    return Question(asked, part.unit(output), tuple(quantiles))


def asked_of(part: Part, output: str, source: str) -> Question:
    """What the study asks of an output, by what a source answers."""
    quantiles = group(part.tree, QUANTILES, source).get(output)
    asked = [] if quantiles is None else quantiles[f"{output}_probability"].values.tolist()
    question = question_of(part, output, asked)
    if (exceedance := group(part.tree, EXCEEDANCE, source).get(output)) is not None:
        along = f"{output}_threshold"
        pairs = zip(exceedance[along].values, exceedance[f"{along}_value"].values, strict=True)
        thresholds = tuple(Threshold(str(text), float(value)) for text, value in pairs)
        question = replace(question, exceeds=thresholds)
    if (shares := group(part.tree, SHARES, source).get(output)) is not None:
        along = f"{output}_category"
        pairs = zip(shares[along].values, shares[f"{along}_label"].values, strict=True)
        kinds = tuple(Category(str(flag), str(label)) for flag, label in pairs)
        question = replace(question, output=replace(question.output, categories=kinds))
    return question


def titled(part: Part, output: str) -> str:
    """What a person reads of an output."""
    return str(part.described(output).get("long_name", output))


def called(part: Part, output: str) -> str:
    """What an output is called in a heading."""
    return named(titled(part, output), output)
