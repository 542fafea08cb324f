"""What the page's answers are made of: which design, and its runs as a sample."""

from __future__ import annotations

from collections.abc import Sequence

from uqpen.analyses.question import Question
from uqpen.analyses.sample import Sample, sample_of_law
from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.labels import RUNS
from uqpen.model import Output

__all__ = ["called", "leading", "question_of", "sample_of"]


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


def question_of(part: Part, output: str, quantiles: Sequence[float]) -> Question:
    """What an analysis is asked of an output that is a number."""
    described = part.described(output)
    unit = str(described.get("units", ""))
    asked = Output(output, unit, str(described.get("long_name", output)))
    return Question(asked, part.unit(output), tuple(quantiles))


def called(part: Part, output: str) -> str:
    """What an output is called in a heading."""
    title = str(part.described(output).get("long_name", output))
    return title if title.replace(" ", "_") == output else f"{title} ({output})"
