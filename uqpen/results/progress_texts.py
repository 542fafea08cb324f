"""Texts on how far a study is, and on designs that stop by themselves."""

from __future__ import annotations

from uqpen.core.labels import (
    DECISION,
    DECISION_CLAIM,
    DECISION_LOWER,
    DECISION_PROBABILITY,
    DECISION_RUNS,
    DECISION_UPPER,
)
from uqpen.core.progress import StudyProgress
from uqpen.results.digits import grouped_number

__all__ = [
    "duration_text",
    "runs_text",
    "step_text",
]

# Progress of a study in words: on a terminal, in a notebook, on the page of a running study.

# Of a design's name on a line of 80 characters, which is to tell more.
_LONGEST_NAME = 24


def step_text(progress: StudyProgress) -> str:
    """Return what is done now, with its place in the study.

    >>> step_text(StudyProgress(step="fitting polynomial_chaos", step_number=8, steps=12))
    'step 8 of 12: fitting polynomial_chaos'
    >>> step_text(StudyProgress(design="monte_carlo", design_number=2, designs=4))
    'design 2 of 4: monte_carlo'
    >>> step_text(StudyProgress(design="a_latin_hypercube_of_the_rod", design_number=1, designs=1))
    'a_latin_hypercube_of_th…'
    """
    if progress.step:
        number, total, what = progress.step_number, progress.steps, "step"
        name = progress.step
    else:
        number, total, what = progress.design_number, progress.designs, "design"
        name = progress.design
        if len(name) > _LONGEST_NAME:
            name = f"{name[: _LONGEST_NAME - 1]}…"
    return f"{what} {number} of {total}: {name}" if total > 1 else name


def runs_text(progress: StudyProgress) -> str:
    """Return the counts of the runs of all designs, and how long the others will take.

    >>> runs_text(StudyProgress(runs=500, done=100, failed=3, runs_per_second=10.0))
    '100 of 500 runs, 3 failed, about 40 s left'
    """
    counts = {"failed": progress.failed, "under way": progress.in_progress}
    texts = [f"{grouped_number(progress.done)} of {grouped_number(progress.runs)} runs"]
    texts += [f"{grouped_number(count)} {what}" for what, count in counts.items() if count]
    if progress.seconds_left is not None and progress.done < progress.runs:
        texts.append(f"about {duration_text(progress.seconds_left)} left")
    return ", ".join(texts)


def duration_text(seconds: float) -> str:
    """Return a duration in words.

    >>> duration_text(0.2), duration_text(75), duration_text(7000)
    ('1 s', '75 s', '117 min')
    """
    for length, unit, most in ((1, "s", 120), (60, "min", 180), (3600, "h", 72)):
        if seconds < most * length:
            return f"{max(1, round(seconds / length))} {unit}"
    return f"{round(seconds / 86_400)} days"


# Texts on designs whose runs decided their own number: the rule, its limits, the decision.


# The attributes with the fields of a decision, in their order, and the types of these.
_FIELDS: dict[str, type] = {
    DECISION_CLAIM: str,
    DECISION: str,
    DECISION_RUNS: int,
    DECISION_PROBABILITY: float,
    DECISION_LOWER: float,
    DECISION_UPPER: float,
}
