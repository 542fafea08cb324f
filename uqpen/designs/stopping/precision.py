"""Stopping rule: estimates are as precise as wanted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uqpen.core.errors import Problem
from uqpen.core.lookup import choices
from uqpen.core.settings import setting, validate
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.stopping_rule import RequestedOutput, StatisticName, StoppingRule
from uqpen.designs.stopping.target import Target, read_targets

__all__ = ["Precision"]

_TARGETS = 'a table of outputs, each with mean = "1 %" or exceeds = { "60 cm" = 0.01 }, say'


@dataclass(frozen=True)
class Precision(StoppingRule):
    """Stop when intervals are as narrow as wanted: half of the width of each is at most its target.

    Of several models, it looks at each that has the output. A mean whose interval contains 0 never
    meets a share of itself; a quantity or a share of the standard deviation is the right target for
    such a mean.

    Parameters
    ----------
    targets : mapping
        By output a mapping with at least one of ``"mean"``, ``"standard_deviation"``,
        ``"quantile_95"`` (of any probability, its digits behind the point), ``"exceeds"`` and
        ``"below"``. The first three have a quantity (``"5 mm"``, or a number where the output has
        no unit), a share of the estimate (``"1 %"``) or of the output's standard deviation (``"5 %
        of sd"``). The last two have a probability for each threshold, named as the study requests
        it.

    Examples
    --------
    >>> print(Precision({"depth": {"mean": "1 %", "exceeds": {"60 cm": 0.01}}}))
    until the mean of depth within 1 % of it, P(> 60 cm) of depth within 0.01
    """

    targets: Mapping[str, Mapping[str, Any]] = setting(
        "targets", _TARGETS, lambda value: isinstance(value, Mapping), default={}
    )

    def __post_init__(self) -> None:
        validate(self, self._problems())

    def is_satisfied(self, feedback: Feedback) -> bool:
        return all(
            target.excess(feedback, model) <= 1
            for target in self.each_target()
            for model, runs in feedback.runs.items()
            if target.output in runs
        )

    def statistics(self) -> Iterator[StatisticName]:
        for target in self.each_target():
            yield StatisticName(target.output, target.statistic, target.label)

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        known = {each.output.name: each for each in requested}
        for name in self.targets:
            if name not in known:
                yield Problem((name,), "an unknown output", choices(name, known))
            elif not known[name].output.is_number:
                found = "categories" if known[name].output.categories else "dimensions"
                yield Problem((name,), f"an output with {found}", "an output that is a number")
        for target in self.each_target():
            if target.output in known and known[target.output].output.is_number:
                yield from target.problems(known[target.output])

    def __str__(self) -> str:
        return f"until {', '.join(map(str, self.each_target()))}"

    def each_target(self) -> Iterator[Target]:
        """Yield the target of each statistic."""
        for name in self.targets:
            yield from read_targets(*self._table(name))[0]

    def _problems(self) -> Iterator[Problem]:
        """Yield the problems that show without the units of the outputs."""
        if not self.targets:
            yield Problem((), "no output", _TARGETS)
        for name in self.targets:
            yield from read_targets(*self._table(name))[1]

    def _table(self, name: str) -> tuple[str, Any]:
        return name, self.targets[name]
