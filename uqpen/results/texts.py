"""Texts for figures, tables and progress: plain, short, with typeset units."""

from __future__ import annotations

import re
from collections.abc import Sequence

from uqpen.core.progress import StudyProgress
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.digits import grouped_number, typeset_unit

_LONGEST = 80  # characters

_WORD = re.compile(r"\w+")


def capitalized(text: str) -> str:
    """A text with a capital, as at the start of a sentence; a symbol stays as it is.

    >>> capitalized("depth of penetration, median"), capitalized("y, median")
    ('Depth of penetration, median', 'y, median')
    """
    first = _WORD.match(text)
    if first is None or len(first[0]) == 1 or not first[0].isalpha():
        return text
    return f"{text[0].upper()}{text[1:]}"


def join_names(names: Sequence[str]) -> str:
    """Names as a sentence lists them."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def plain_text(text: str, longest: int = _LONGEST) -> str:
    """A text in one line, its control characters spelled out, and cut where it is too long."""
    shown = "".join(
        character
        if character.isprintable()
        else character.encode("unicode_escape", "replace").decode("ascii")
        for character in text.replace("\u202f", " ")
    )
    return shown if len(shown) <= longest else f"{shown[: longest - 1]}…"


def typeset_quantity(text: str) -> str:
    """Return a quantity as written, with its unit typeset.

    >>> typeset_quantity("70 degC"), typeset_quantity("1e-3 m2"), typeset_quantity("10")
    ('70 °C', '1e-3 m²', '10')
    """
    number, space, unit = text.partition(" ")
    return f"{number}{space}{typeset_unit(unit)}"


def title_with_name(title: str, name: str) -> str:
    """A title and, in brackets, the name that a study gives it, unless that says the same.

    >>> title_with_name("wall heat flux", "wall_heat_flux"), title_with_name("depth", "h")
    ('wall heat flux', 'depth (h)')
    """
    return title if title.replace(" ", "_") == name else f"{title} ({name})"


def unit_suffix(unit: str) -> str:
    """Return the text behind a number: a space and its unit, if it has one.

    >>> unit_suffix("kg m-3"), unit_suffix("1")
    (' kg m⁻³', '')
    """
    return "" if unit == DIMENSIONLESS else f" {plain_text(typeset_unit(unit), 30)}"


def title_with_unit(title: str, unit: str) -> str:
    """Return the title of an axis: a quantity and, in brackets, its unit, if it has one."""
    head = plain_text(title, 50)
    return head if unit == DIMENSIONLESS else f"{head} [{plain_text(typeset_unit(unit), 30)}]"


# Progress of a study in words: on a terminal, in a notebook, on the page of a running study.

# Characters of a design's name: a line of 80 has the counts of its runs as well.
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
