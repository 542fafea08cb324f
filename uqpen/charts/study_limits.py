"""Limits of a study on an output: the axis that includes them, their lines and their texts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from uqpen.charts.axes import ValueAxis
from uqpen.charts.chart import LegendKey
from uqpen.charts.marks import Rule
from uqpen.core.arrays import FloatArray
from uqpen.core.errors import plural
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_statistics import THRESHOLD_PROBABILITIES
from uqpen.results.texts import plain_text, typeset_quantity

# Widths of an axis by which it is made longer, at the most, for a limit.
_FAR = 1.5
# The part of a narrow chart that an upright text takes.
_ROOM = 0.05
# Dashes of a limit that the study has a verdict about, and of any other.
_DECIDED, _ASKED = "dash", "dot"


class StudyLimit(NamedTuple):
    """Limit of a study on an output: a value whose probability it asks for."""

    text: str  # as the study writes it, with its unit typeset
    value: float  # in the unit that is shown
    in_si: float  # in the output's SI unit
    # The probabilities that the study accepts, and the verdict; None where it accepts any.
    acceptance: Acceptance | None

    @property
    def dash(self) -> str:
        """Dashes of its line."""
        return _ASKED if self.acceptance is None else _DECIDED

    @property
    def description(self) -> str:
        """Text of the limit, with the share of cases that the study accepts."""
        accepted = "" if self.acceptance is None else f", {self.acceptance} of cases"
        return f"{self.text}{accepted}"


def study_limits(view: ArchiveView, output: str) -> list[StudyLimit]:
    """Return the limits of a study on an output; first those that it has a verdict about."""
    found: dict[str, StudyLimit] = {}
    for statistic in THRESHOLD_PROBABILITIES:
        source = next(iter(view.estimates(output, statistic.name)), None)
        entries = {} if source is None else view.statistics.entries(source, output, statistic.name)
        for label, entry in entries.items():
            in_si = float(entry.coords.variables[f"{statistic.dims[0]}_value"].values)
            text = typeset_quantity(plain_text(str(label), 20))
            value = float(view.scale(output).from_si(in_si))
            if str(label) not in found or found[str(label)].acceptance is None:
                acceptance = Acceptance.from_array(entry)
                found[str(label)] = StudyLimit(text, value, in_si, acceptance)
    return sorted(found.values(), key=lambda each: each.acceptance is None)


def output_span(
    view: ArchiveView,
    output: str,
    every: Sequence[FloatArray],
    marked: Sequence[float] = (),
    *,
    has_all_limits: bool = True,
) -> ValueAxis:
    """Return the axis of an output, past most of its values and past the limits of the study.

    Not past those so far away that nothing could be seen of the rest. Values are in the unit that
    is shown; the marked ones are on the axis in any case. Without all limits, those count that the
    study has a verdict about.
    """
    is_logarithmic = view.is_logarithmic(output)
    span = ValueAxis.of_values(every, marked, is_logarithmic=is_logarithmic)
    near = [
        limit.value
        for limit in study_limits(view, output)
        if (has_all_limits or limit.acceptance is not None)
        and (limit.value > 0 or not is_logarithmic)
        and -_FAR <= span.share(limit.value) <= 1 + _FAR
    ]
    return ValueAxis.of_values(every, [*marked, *near], is_logarithmic=is_logarithmic)


class LimitMarks(NamedTuple):
    """Limits of the study on an output, as a chart shows them."""

    rules: Sequence[Rule] = ()  # lines at those on the axis, the one that a verdict is about first
    keys: Sequence[LegendKey] = ()  # their texts
    notes: Sequence[str] = ()  # on those beyond the axis

    @property
    def values(self) -> list[float]:
        """The limits on the axis."""
        return [rule.at for rule in self.rules]


def limit_marks(
    view: ArchiveView, output: str, span: ValueAxis, *, at_foot: bool = False
) -> LimitMarks:
    """Return the marks of all limits of the study on the axis of an output.

    Each has its text where there is room: at the top of a chart or at its foot, where no curve is.
    """
    every = study_limits(view, output)
    drawn = [limit for limit in every if span.contains(limit.value)]
    rules: list[Rule] = []
    named: list[float] = []  # places of the texts
    for limit in drawn:
        place = span.share(limit.value)
        has_room = all(abs(place - other) >= _ROOM for other in named)
        named += [place] * has_room
        label, is_last = limit.text * has_room, place > 1 - _ROOM
        rule = Rule(
            limit.value, "accent", limit.dash, label=label, at_foot=at_foot, is_before=is_last
        )
        rules.append(rule)
    keys = []
    for dash in (_DECIDED, _ASKED):
        if texts := [limit.description for limit in drawn if limit.dash == dash]:
            noun = plural("limit", len(texts))
            keys.append(LegendKey(f"{noun} {', '.join(texts)}", "accent", "line", dash))
    beyond = ", ".join(limit.description for limit in every if limit not in drawn)
    notes = [f"Limits of the study beyond the axis: {beyond}."] * bool(beyond)
    return LimitMarks(rules, keys, notes)
