"""Stopping rule: estimates are as precise as wanted."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import (
    EXCEEDANCE,
    LOWER_THRESHOLD,
    MOMENTS,
    PROBABILITY,
    QUANTILES,
    THRESHOLD,
)
from uqpen.core.lookup import choices
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import setting, validate
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.stopping_rule import RequestedOutput, StatisticName, StoppingRule

if TYPE_CHECKING:
    import xarray as xr

# Target of a stopping rule: the wanted half-width of the interval of one statistic.

_MEAN, _STD, _EXCEEDS, _BELOW = "mean", "standard_deviation", "exceeds", "below"
_KEYS = (_MEAN, _STD, "quantile_95", _EXCEEDS, _BELOW)

# Probabilities of an output, by their keys: the statistic, and its dimension.
_PROBABILITIES = {_EXCEEDS: ("exceedance", THRESHOLD), _BELOW: ("below", LOWER_THRESHOLD)}

# Of one digit, 5 could be taken for 5 % as well as for 50 %.
_QUANTILE = re.compile(r"quantile_([0-9]{2,12})\Z", re.ASCII)
_SHARE = re.compile(r"\s*(?P<share>\S.*?%)\s*(?P<of_sd>of\s+sd)?\s*\Z", re.DOTALL)

_HALF_WIDTH = (
    'a half-width above 0: a quantity, a share of the estimate such as "1 %", or of the standard '
    'deviation such as "5 % of sd"'
)
_HALF_WIDTH_OF_PROBABILITY = "the half-width of a probability, above 0 and below 1"


class Target(NamedTuple):
    """Wanted half-width of an interval."""

    output: str  # name of the output
    key: str  # key in the table of the output, which names the statistic
    half_width: Any  # as its author wrote it
    # The value whose probability it concerns, as its author wrote it; empty for none.
    threshold: str = ""

    @property
    def path(self) -> tuple[str, ...]:
        """Keys that lead to it in the table of targets."""
        return (self.output, self.key, self.threshold)[: 3 if self.threshold else 2]

    @property
    def statistic(self) -> str:
        """Name of the statistic in the catalogue."""
        if self.threshold:
            return _PROBABILITIES[self.key][0]
        return {_MEAN: "mean", _STD: "std"}.get(self.key, "quantile")

    @property
    def label(self) -> str | float:
        """Coordinate of the estimate along the statistic's dimension; empty without one."""
        return self.threshold or self._probability or ""

    def excess(self, feedback: Feedback, model: str) -> float:
        """Return the half-width of the interval in parts of the wanted one; NaN without any."""
        value, lower, upper = self._estimate(feedback, model).values.tolist()
        half, wanted = (upper - lower) / 2, self._wanted(value, feedback, model)
        return half / wanted if wanted else math.inf if half else 0.0

    def problems(self, requested: RequestedOutput) -> Iterator[Problem]:
        """Yield what is wrong with it for an output and what a study requests of it."""
        if self.threshold:
            asked = requested.thresholds if self.key == _EXCEEDS else requested.lower_thresholds
            thresholds = [each.text for each in asked]
            if self.threshold not in thresholds:
                expected = f"a value that {self.key} of [outputs.{self.output}] has; "
                expected += choices(self.threshold, thresholds)
                yield Problem(self.path, toml_text(self.threshold), expected)
                return
        elif self._probability and self._probability not in requested.quantiles:
            expected = f"a quantile that quantiles of [outputs.{self.output}] has; "
            expected += f"known: {', '.join(map(str, requested.quantiles))}"
            yield Problem(self.path, str(self._probability), expected)
            return
        yield from self._half_width_problems(requested.output.unit)

    def __str__(self) -> str:
        names = {_MEAN: "the mean", _STD: "the standard deviation"}
        of = f"P({'>' if self.key == _EXCEEDS else '<'} {self.threshold})"
        if not self.threshold:
            of = names.get(self.key, f"the {self._probability} quantile")
        of_it = " of it" if self._share and not self._share["of_sd"] else ""
        return f"{of} of {self.output} within {self.half_width}{of_it}"

    def _estimate(self, feedback: Feedback, model: str) -> xr.DataArray:
        if self.threshold:
            name, dimension = _PROBABILITIES[self.key]
            found = feedback.estimates(model, self.output, only=[EXCEEDANCE])[name]
            return found.sel({dimension: self.threshold})
        if self._probability:
            found = feedback.estimates(model, self.output, only=[QUANTILES])["quantile"]
            return found.sel({PROBABILITY: self._probability})
        return feedback.estimates(model, self.output, only=[MOMENTS])[self.statistic]

    def _wanted(self, value: float, feedback: Feedback, model: str) -> float:
        """Return the wanted half-width in SI units, given the estimate."""
        if self._share is None:
            unit = str(self._estimate(feedback, model).attrs["units"])
            return parse_quantity(self.half_width, unit, difference=True).value
        if self._share["of_sd"]:
            value = Target(self.output, _STD, "")._estimate(feedback, model).values.tolist()[0]
        return self._part(self._share) * abs(value)

    def _half_width_problems(self, unit: str) -> Iterator[Problem]:
        expected = _HALF_WIDTH_OF_PROBABILITY if self.threshold else _HALF_WIDTH
        try:
            wanted = (
                self._part(self._share)
                if self._share
                else parse_quantity(
                    self.half_width, DIMENSIONLESS if self.threshold else unit, difference=True
                ).value
            )
        except QuantityError as error:
            is_of_sd = str(self.half_width).endswith("sd")
            yield Problem(self.path, error.found, expected if is_of_sd else error.expected)
            return
        if not wanted > 0 or (self.threshold and wanted >= 1):
            yield Problem(self.path, toml_text(self.half_width), expected)

    @property
    def _share(self) -> re.Match[str] | None:
        """Match of a share of something; a probability has none, as its per cent are absolute."""
        is_text = isinstance(self.half_width, str) and not self.threshold
        return _SHARE.match(self.half_width) if is_text else None

    @staticmethod
    def _part(share: re.Match[str]) -> float:
        return parse_quantity(share["share"], DIMENSIONLESS).value

    @property
    def _probability(self) -> float:
        """Probability of a quantile; 0 for another statistic."""
        match = _QUANTILE.match(self.key)
        return float(f"0.{match[1]}") if match else 0.0


def read_targets(output: str, wanted: Any) -> tuple[list[Target], list[Problem]]:
    """Read the targets of an output, and what is wrong with its table.

    `Target.problems` checks what needs the unit of the output.
    """
    if not isinstance(wanted, Mapping) or not wanted:
        problem = Problem((output,), toml_text(wanted), 'a table such as { mean = "1 %" }')
        return [], [problem]
    targets, problems = list[Target](), list[Problem]()
    for key, half_width in wanted.items():
        if key in _PROBABILITIES:
            if isinstance(half_width, Mapping) and half_width:
                targets += [Target(output, key, each, str(t)) for t, each in half_width.items()]
            else:
                expected = 'a table of thresholds, such as { "60 cm" = 0.01 }'
                problems.append(Problem((output, key), toml_text(half_width), expected))
        elif key in (_MEAN, _STD) or _QUANTILE.match(str(key)):
            targets.append(Target(output, key, half_width))
        else:
            expected = choices(str(key), _KEYS)
            if str(key).startswith("quantile"):
                expected = "the digits behind the point, two at least, such as quantile_05"
            problems.append(Problem((output, str(key)), "an unknown key", expected))
    return targets, problems


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
