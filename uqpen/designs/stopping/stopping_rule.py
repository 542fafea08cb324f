"""Interface of a stopping rule, and the setting with which a design takes one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.lookup import choices, resolve
from uqpen.core.quantities import parse_quantity
from uqpen.core.setting_fields import Context
from uqpen.core.settings import setting
from uqpen.core.variables import Output
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping import STOPPING_RULES

__all__ = [
    "RequestedOutput",
    "RequestedThreshold",
    "StatisticName",
    "StoppingRule",
    "output_value_problems",
    "stopping_rule",
]


class StatisticName(NamedTuple):
    """Name of an estimate in an archive.

    Parameters
    ----------
    output, statistic : str
        Names of the output and of the statistic in the catalogue.
    label : str or float
        Coordinate along the statistic's dimension, such as a threshold; empty without one.
    """

    output: str
    statistic: str
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
