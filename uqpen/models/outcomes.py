"""Endings of a run that a study declares as outcomes: results with a category and no numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.errors import toml_text
from uqpen.core.labels import OUTCOME_OUTPUT
from uqpen.core.model import Category, Output, Results, RunOutcome
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS

COMPLETED = "completed"  # the category of all other runs


@dataclass(frozen=True)
class DeclaredOutcome:
    """Ending that is a result: the run is completed, and has no numbers."""

    name: str
    # How it is known, one of these.
    exit_code: int | None = None  # the exit code of a program
    text: str = ""  # a text in a line that a program prints
    exception: str = ""  # the class of an exception, as `class_name` has it

    def is_raised(self, error: BaseException) -> bool:
        """Return True if a function has raised an exception of the class, or of one below it.

        Names are compared, as another process has loaded the class for itself.
        """
        return bool(self.exception) and self.exception in map(class_name, type(error).__mro__)


def class_name(cls: type) -> str:
    """Return the full name of a class."""
    return f"{cls.__module__}.{cls.__qualname__}"


def with_outcomes(outputs: Sequence[Output], names: Sequence[str]) -> tuple[Output, ...]:
    """Return outputs that runs with an outcome lack, and the category of each run."""
    if not names:
        return tuple(outputs)
    labels = [name.replace("_", " ") for name in names]
    absent = f"the run ends as {' or '.join(labels)}"
    categories = [Category(*each) for each in zip(names, labels, strict=True)]
    category = Output(
        OUTCOME_OUTPUT, DIMENSIONLESS, categories=(Category(COMPLETED, COMPLETED), *categories)
    )
    return (*(replace(each, absent=absent) for each in outputs), category)


def with_outcome(number: int) -> RunOutcome:
    """Return a run that has ended with an outcome, given by its position in the categories."""
    return RunOutcome({OUTCOME_OUTPUT: np.array(float(number))})


def without_gaps(results: Results, outputs: Sequence[Output]) -> Results:
    """Return results in which runs that came to their usual end have every number, or fail."""
    status, reasons = results.status.copy(), dict(results.reasons)
    for output in outputs:
        values = results.outputs[output.name]
        is_usual = (status == Status.OK) & (results.outputs[OUTCOME_OUTPUT] == 0)
        for run in np.flatnonzero(is_usual & ~np.isfinite(values)).tolist():
            status[run] = Status.NOT_FINITE
            reasons[run] = replace(output, absent="").invalid_text(values[run])
    return replace(results, status=status, reasons=reasons)


def undecided_outcome(text: str, *, is_any: bool) -> tuple[str, str] | None:
    """Return what is wrong with an outcome beside limits of numbers, and what is expected.

    A run that ends so has no number. So the outcome has to decide, or the event never occurs or
    always does.
    """
    *negation, flag = text.split()
    if (bool(negation) == (flag == COMPLETED)) == is_any:
        return None
    found = f"{toml_text(text)} {'or' if is_any else 'and'} a limit of a number"
    if is_any:
        return found, "all of them: every run that has the number is so"
    return found, "any of them: a run that ends so has no number"
