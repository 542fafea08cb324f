"""``[joint_probabilities]``: events that concern several outputs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME
from uqpen.core.list_reading import read_list
from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.core.quantities import parse_quantity
from uqpen.statistics.joint_event import JointEvent, OutputLimit
from uqpen.statistics.threshold import AcceptanceLimits
from uqpen.study.table_reader import StudyParts, TableReader

__all__ = ["read_joint_probabilities"]

_COMPARISON = re.compile(r"\s*(\w+)\s*([<>])(?!=)\s*(.+?)\s*\Z", re.ASCII)
_LIMIT = 'a limit of an output, such as "depth < 60 cm"'
_ALL, _ANY, _GIVEN, _SENSITIVITIES = "all", "any", "given", "sensitivities"
_EVENT = 'a list of limits, or a table such as { any = ["depth > 60 cm"], at_most = 0.05 }'

_CONDITION = 'a list of limits, or a table such as { any = ["depth > 60 cm"] }'


def read_joint_probabilities(table: TableReader, parts: StudyParts) -> tuple[JointEvent, ...]:
    """Read the events whose probabilities a study requests; invalid ones are noted and left out."""
    found = []
    for name in table:
        written = table.take(name)
        if not NAME.match(name):
            table.add_wrong(name, name, "a name of letters, digits and _, at most 100")
            continue
        try:
            found.append(_read_event(name, written, parts.model))
        except (SettingsError, QuantityError) as error:
            table.add_problems(error.problems, name)
    return tuple(found)


def _read_event(name: str, written: object, model: Model) -> JointEvent:
    if isinstance(written, list):
        return JointEvent(name, _read_limits(written, model))
    if not isinstance(written, dict):
        raise QuantityError(toml_text(written), _EVENT)
    content = dict(written)
    limits, is_any = _read_quantified(content, model)
    given = _read_given(content.pop(_GIVEN), model) if _GIVEN in content else None
    sensitivities = content.pop(_SENSITIVITIES, False)
    if not isinstance(sensitivities, bool):
        raise SettingsError([Problem((_SENSITIVITIES,), toml_text(sensitivities), "true or false")])
    if sensitivities and given:
        found, expected = "true, of a conditional probability", "an event without given"
        raise SettingsError([Problem((_SENSITIVITIES,), found, expected)])
    if unknown := [key for key in content if key not in ("at_most", "at_least")]:
        expected = "all or any, given, sensitivities, at_most or at_least"
        raise SettingsError([Problem((unknown[0],), "an unknown key", expected)])
    return JointEvent(name, limits, is_any, AcceptanceLimits(**content), given, sensitivities)


def _read_quantified(
    content: dict[str, object], model: Model
) -> tuple[tuple[OutputLimit, ...], bool]:
    """Take the limits out of a table; return them, and whether any of them suffices."""
    quantifiers = [key for key in (_ALL, _ANY) if key in content]
    if len(quantifiers) != 1:
        found = "both all and any" if quantifiers else "neither all nor any"
        raise QuantityError(found, _EVENT)
    (quantifier,) = quantifiers
    with _within(quantifier):
        return _read_limits(content.pop(quantifier), model), quantifier == _ANY


def _read_given(written: object, model: Model) -> JointEvent:
    """Read the condition of an event: limits that all hold, or a table of those."""
    with _within(_GIVEN):
        if isinstance(written, list):
            return JointEvent(_GIVEN, _read_limits(written, model))
        if not isinstance(written, dict):
            raise QuantityError(toml_text(written), _CONDITION)
        content = dict(written)
        limits, is_any = _read_quantified(content, model)
        if content:
            raise SettingsError([Problem((next(iter(content)),), "an unknown key", "all or any")])
        return JointEvent(_GIVEN, limits, is_any)


@contextmanager
def _within(key: str) -> Iterator[None]:
    """Extend the path of problems that are raised in this context by a key."""
    try:
        yield
    except (SettingsError, QuantityError) as error:
        raise SettingsError([each.within(key) for each in error.problems]) from None


def _read_limits(written: object, model: Model) -> tuple[OutputLimit, ...]:
    limits = read_list(written, lambda each: _read_limit(each, model))
    if not limits:
        raise QuantityError("an empty list", _LIMIT)
    return tuple(limits)


def _read_limit(written: object, model: Model) -> OutputLimit:
    match = _COMPARISON.match(written) if isinstance(written, str) else None
    if match is None:
        raise QuantityError(toml_text(written), _LIMIT)
    name, sign, value = match.groups()
    outputs = {output.name: output for output in model.all_outputs if output.is_number}
    if name not in outputs:
        expected = f"an output of {model.name} that is a number; {choices(name, outputs)}"
        raise QuantityError(toml_text(name), expected)
    output = outputs[name]
    number = parse_quantity(value, output.unit, allow_offset=not output.is_difference).value
    return OutputLimit(f"{name} {sign} {value}", name, sign == ">", number)
