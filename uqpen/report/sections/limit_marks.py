"""Limits of the study in a chart: a line with its text at each, and what the legend says."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.charts.axes import ValueAxis
from uqpen.charts.chart import LegendKey
from uqpen.charts.marks import Rule
from uqpen.figures.distributions import StudyLimit, labelled_limits
from uqpen.results.archive_view import ArchiveView
from uqpen.results.texts import plain_text, typeset_quantity

__all__ = ["LimitMarks", "limit_marks"]

# The part of a narrow chart that an upright text takes.
_ROOM = 0.05
# Dashes of a limit that the study has a verdict about, and of any other.
_DECIDED, _ASKED = "dash", "dot"


@dataclass(frozen=True)
class LimitMarks:
    """Limits of the study on an output, as a chart shows them.

    Parameters
    ----------
    limits : tuple of StudyLimit
        Those on the axis, the one that a verdict is about first.
    rules : tuple of Rule
        Their lines.
    keys : tuple of LegendKey
        Their texts.
    notes : tuple of str
        On those beyond the axis.
    """

    limits: tuple[StudyLimit, ...]
    rules: tuple[Rule, ...]
    keys: tuple[LegendKey, ...]
    notes: tuple[str, ...]


def limit_marks(
    view: ArchiveView, output: str, span: ValueAxis, *, at_foot: bool = False
) -> LimitMarks:
    """Return the marks of all limits of the study on the axis of an output.

    Their texts stand at the top of a chart or at its foot, where no curve is.
    """
    drawn, beyond = labelled_limits(view, output, span, _ROOM)
    rules = [
        _line(limit, span, at_foot=at_foot)
        if is_named
        else Rule(limit.value, "accent", _dash(limit))
        for limit, is_named in drawn
    ]
    keys = []
    for dash in (_DECIDED, _ASKED):
        texts = [_text(limit) for limit, _ in drawn if _dash(limit) == dash]
        if texts:
            noun = f"limit{'s' * (len(texts) > 1)}"
            keys.append(LegendKey(f"{noun} {', '.join(texts)}", "accent", "line", dash))
    left_out = ", ".join(map(_text, beyond))
    notes = [f"Limits of the study beyond the axis: {left_out}."] * bool(left_out)
    return LimitMarks(tuple(limit for limit, _ in drawn), tuple(rules), tuple(keys), tuple(notes))


def _line(limit: StudyLimit, span: ValueAxis, *, at_foot: bool) -> Rule:
    is_last = span.share(limit.value) > 1 - _ROOM
    return Rule(
        limit.value,
        "accent",
        _dash(limit),
        label=_written(limit),
        at_foot=at_foot,
        is_before=is_last,
    )


def _dash(limit: StudyLimit) -> str:
    return _ASKED if limit.acceptance is None else _DECIDED


def _text(limit: StudyLimit) -> str:
    accepted = "" if limit.acceptance is None else f", {limit.acceptance} of cases"
    return f"{_written(limit)}{accepted}"


def _written(limit: StudyLimit) -> str:
    return typeset_quantity(plain_text(limit.text, 20))
