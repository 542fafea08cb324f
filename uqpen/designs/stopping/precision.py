"""Stopping rule: estimates are as precise as wanted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import xarray as xr

from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import EXCEEDANCE, MOMENTS
from uqpen.core.lookup import choices
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import setting, validate
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.stopping_rule import RequestedOutput, StoppingRule

__all__ = ["Precision"]

_MEAN, _EXCEEDS = "mean", "exceeds"

_TARGETS = 'a table of outputs, each with mean = "1 %" or exceeds = { "60 cm" = 0.01 }, say'
_HALF_WIDTH = 'a half-width above 0: a quantity, or a share of the mean such as "1 %"'
_HALF_WIDTH_OF_PROBABILITY = "the half-width of a probability, above 0 and below 1"


class _Target(NamedTuple):
    """Wanted half-width of an interval: of a mean, or of the probability to exceed a threshold."""

    output: str
    threshold: str | None
    half_width: Any

    @property
    def path(self) -> tuple[str, ...]:
        """Keys that lead to it in the table of targets."""
        end = (_MEAN,) if self.threshold is None else (_EXCEEDS, self.threshold)
        return (self.output, *end)

    def estimate(self, feedback: Feedback, model: str) -> xr.DataArray:
        """Return the estimate array of its statistic."""
        if self.threshold is None:
            return feedback.estimates(model, self.output, only=[MOMENTS])["mean"]
        found = feedback.estimates(model, self.output, only=[EXCEEDANCE])["exceedance"]
        return found.sel(threshold=self.threshold)

    def wanted(self, value: float, unit: str) -> float:
        """Return the wanted half-width in SI units, given the estimate and its unit."""
        if self._is_share:
            return self._share * abs(value)
        unit = DIMENSIONLESS if self.threshold else unit
        return parse_quantity(self.half_width, unit, difference=True).value

    def problem(self, unit: str) -> Problem | None:
        """Return what is wrong with it for an output in a unit; None where it is right."""
        expected = _HALF_WIDTH if self.threshold is None else _HALF_WIDTH_OF_PROBABILITY
        try:
            wanted = self.wanted(1.0, unit)
        except QuantityError as error:
            return Problem(self.path, error.found, error.expected)
        is_right = wanted > 0 and (wanted < 1 or self.threshold is None)
        return None if is_right else Problem(self.path, toml_text(self.half_width), expected)

    def __str__(self) -> str:
        of = "the mean" if self.threshold is None else f"P(> {self.threshold})"
        share = " of it" if self._is_share else ""
        return f"{of} of {self.output} within {self.half_width}{share}"

    @property
    def _is_share(self) -> bool:
        is_text = isinstance(self.half_width, str)
        return self.threshold is None and is_text and self.half_width.rstrip().endswith("%")

    @property
    def _share(self) -> float:
        return parse_quantity(self.half_width, DIMENSIONLESS).value


@dataclass(frozen=True)
class Precision(StoppingRule):
    """Stop when intervals are as narrow as wanted: half of the width of each is at most its target.

    Of several models, it looks at each that has the output. A mean whose interval contains 0 never
    meets a share of itself; a quantity is the right target for such a mean.

    Parameters
    ----------
    targets : mapping
        By output a mapping with ``"mean"``, ``"exceeds"`` or both. The mean has a quantity
        (``"5 mm"``, or a number where the output has no unit) or a share of itself (``"1 %"``).
        ``"exceeds"`` has a probability for each threshold, named as the study requests it.

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
            _is_precise(target, target.estimate(feedback, model))
            for target in self._targets()
            for model, runs in feedback.runs.items()
            if target.output in runs
        )

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        known = {each.output.name: each for each in requested}
        for name in self.targets:
            if name not in known:
                yield Problem((name,), "an unknown output", choices(name, known))
            elif not known[name].output.is_number:
                found = "categories" if known[name].output.categories else "dimensions"
                yield Problem((name,), f"an output with {found}", "an output that is a number")
        for target in self._targets():
            if target.output not in known or not known[target.output].output.is_number:
                continue
            thresholds = [each.text for each in known[target.output].thresholds]
            if target.threshold is not None and target.threshold not in thresholds:
                place = f"exceeds of [outputs.{target.output}]"
                expected = f"a value that {place} has; {choices(target.threshold, thresholds)}"
                yield Problem(target.path, toml_text(target.threshold), expected)
            elif problem := target.problem(known[target.output].output.unit):
                yield problem

    def __str__(self) -> str:
        return f"until {', '.join(map(str, self._targets()))}"

    def _targets(self) -> Iterator[_Target]:
        for output, wanted in self.targets.items():
            if _MEAN in wanted:
                yield _Target(output, None, wanted[_MEAN])
            for threshold, half_width in wanted.get(_EXCEEDS, {}).items():
                yield _Target(output, str(threshold), half_width)

    def _problems(self) -> Iterator[Problem]:
        """Yield the problems that show without the units of the outputs."""
        if not self.targets:
            yield Problem((), "no output", _TARGETS)
        for output, wanted in self.targets.items():
            if not isinstance(wanted, Mapping) or not wanted:
                expected = 'a table such as { mean = "1 %" }'
                yield Problem((output,), toml_text(wanted), expected)
                continue
            for key in wanted:
                if key not in (_MEAN, _EXCEEDS):
                    expected = choices(str(key), [_MEAN, _EXCEEDS])
                    yield Problem((output, str(key)), "an unknown key", expected)
            exceeds = wanted.get(_EXCEEDS)
            if _EXCEEDS in wanted and not (isinstance(exceeds, Mapping) and exceeds):
                expected = 'a table of thresholds, such as { "60 cm" = 0.01 }'
                yield Problem((output, _EXCEEDS), toml_text(exceeds), expected)


def _is_precise(target: _Target, estimate: xr.DataArray) -> bool:
    """Check the half-width of an interval; one that is not known is NaN, which is never enough."""
    value, lower, upper = estimate.values.tolist()
    return bool((upper - lower) / 2 <= target.wanted(value, estimate.attrs["units"]))
