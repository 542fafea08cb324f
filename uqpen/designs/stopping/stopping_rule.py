"""Interface of a stopping rule, and the setting with which a design takes one."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import (
    STOPPING_AT_MOST,
    STOPPING_NOTE,
    STOPPING_RULE,
    STOPPING_STATISTICS,
)
from uqpen.core.lookup import choices, resolve
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Context, setting
from uqpen.core.variables import Output
from uqpen.designs.drawn_points import Points
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping import STOPPING_RULES


class StatisticName(NamedTuple):
    """Name of an estimate in an archive."""

    output: str  # name of the output
    statistic: str  # name of the statistic in the catalogue
    # Coordinate along the statistic's dimension, such as a threshold; empty without one.
    label: str | float = ""


class RequestedThreshold(Protocol):
    """Value whose probability of exceedance a study requests."""

    @property
    def text(self) -> str:
        """The value as its author wrote it, which names the probability."""


class RequestedOutput(Protocol):
    """Output and what a study requests of it; a `QuantityOfInterest` is one."""

    @property
    def output(self) -> Output:
        """The output."""

    @property
    def thresholds(self) -> Sequence[RequestedThreshold]:
        """Values whose probability of exceedance is requested."""

    @property
    def lower_thresholds(self) -> Sequence[RequestedThreshold]:
        """Values; the probability that the output lies below each is requested."""

    @property
    def quantiles(self) -> Sequence[float]:
        """Probabilities of the requested quantiles."""


def output_value_problems(
    name: str, value: str, requested: Sequence[RequestedOutput]
) -> Iterator[Problem]:
    """Yield the problem of a value that a design compares with an output of a study."""
    known = {each.output.name: each.output for each in requested if each.output.is_number}
    if name not in known:
        yield Problem((), toml_text(name), f"an output that is a number; {choices(name, known)}")
        return
    output = known[name]
    try:
        parse_quantity(value, output.unit, allow_offset=not output.is_difference)
    except QuantityError as error:
        yield from error.problems


class StoppingRule(ABC):
    """Stopping rule: frozen settings that decide after a round whether a design has enough runs.

    Its decision follows from the estimates alone. So it is the same for any number of workers, and
    after an interruption. `str` of a rule is one line for a reader.
    """

    @abstractmethod
    def is_satisfied(self, feedback: Feedback) -> bool:
        """Check whether the runs so far are enough.

        An estimate without an interval is never precise enough.

        Parameters
        ----------
        feedback : Feedback
            Of the last round.
        """

    def statistics(self) -> Iterator[StatisticName]:
        """Yield the statistics by whose precision it decides: their intervals stay as they are.

        A note marks the interval of any other statistic of a design that it has stopped.
        """
        yield from ()

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        """Yield the problems between its settings and the outputs of a study.

        Parameters
        ----------
        requested : sequence of RequestedOutput
            One for each output of the study's first model.
        """
        yield from ()


def stopping_rule(key: str) -> Any:
    """Declare a setting that is a stopping rule, None by default.

    Parameters
    ----------
    key : str
        Key in `STOPPING_RULES`. A study file gives the rule as a table of its settings.
    """

    def read(written: Any, _: Context) -> Any:
        return resolve(STOPPING_RULES[key])(written) if isinstance(written, Mapping) else written

    expected = 'a table of outputs, such as { depth = { mean = "1 %" } }'
    accepts = lambda value: isinstance(value, StoppingRule)  # noqa: E731
    return setting("stopping rule", expected, accepts, read, default=None)


# Rounds of a design that doubles its runs until a stopping rule is satisfied.

# Number of runs before the first look. In 4 000 trials of an exponential output, intervals of
# nominal 95 % covered in 94.5 % at the worst target, in 92.9 % from 64 runs and 85.5 % from 8
# (docs/decisions/047-designs-that-end-by-themselves.md).
FIRST_LOOK = 512

_NOTE = (
    "the runs decided their own number; as looks double from {first} runs, intervals {of} "
    "cover about as they do after a number that was fixed; no rule can know of a "
    "part of the output that none of the runs has met"
)


def doubling_looks(at_most: int, first: int = FIRST_LOOK) -> Iterator[int]:
    """Yield the numbers of runs at which a rule looks.

    >>> list(doubling_looks(3_000))
    [512, 1024, 2048, 3000]
    """
    look = first
    while look < at_most:
        yield look
        look *= 2
    yield at_most


def doubling_rounds(
    rule: StoppingRule,
    at_most: int,
    draw: Callable[[int, int], Points],
    *,
    first: int = FIRST_LOOK,
    intervals: str = "of independent draws",
) -> Generator[Points, Feedback, None]:
    """Yield rounds of points, as a design does, until a rule is satisfied.

    The rule looks at the first runs, then whenever their number has doubled. The points say so in
    attributes, which the archive keeps with the runs.

    Parameters
    ----------
    rule : StoppingRule
        The rule.
    at_most : int
        Number of runs at which the design ends in any case.
    draw : callable
        Returns the points from one number to another, the last excluded, as a design may yield
        them.
    first : int
        Number of runs at the first look.
    intervals : str
        Which intervals are certified, for a reader: those of independent draws, or over enough
        replicates. Of fewer replicates, the smallest standard errors end a design too soon.
    """
    attributes = {
        STOPPING_RULE: f"{rule}; at most {at_most} runs",
        STOPPING_NOTE: _NOTE.format(first=first, of=intervals),
        STOPPING_AT_MOST: at_most,
        STOPPING_STATISTICS: json.dumps(list(rule.statistics())),
    }
    start = 0
    for look in doubling_looks(at_most, first):
        feedback = yield draw(start, look).assign_attrs(attributes)
        if look < at_most and rule.is_satisfied(feedback):
            return
        start = look
