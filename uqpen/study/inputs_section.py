"""``[inputs]`` and ``[constraints]``: what is fixed, what is random, and where the law ends."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.errors import ConstraintError, QuantityError, SettingsError, as_written
from uqpen.inputs.constraints import Constraint, parse_constraint
from uqpen.inputs.distribution import Distribution
from uqpen.inputs.distributions import DISTRIBUTIONS, Normal
from uqpen.inputs.law import FixedInput, InputLaw, RandomInput
from uqpen.inputs.truncated import Truncated
from uqpen.lookup import choices, resolve
from uqpen.model import Input, Model
from uqpen.quantities import parse_quantity, parse_spread
from uqpen.streams import Stream
from uqpen.study.measurements_section import MEASURED, Origin, read_measured
from uqpen.study.section import Section
from uqpen.units import DIMENSIONLESS

__all__ = ["read_constraints", "read_inputs"]

Entry = FixedInput | RandomInput


def read_inputs(table: Section, model: Model, folder: Path, stream: Stream) -> InputLaw:
    """The law of a model's inputs; what could not be understood is noted and left out.

    Parameters
    ----------
    table : Section
        ``[inputs]``.
    model : Model
        Whose inputs they are.
    folder : Path
        Where files of measurements lie.
    stream : Stream
        For the tests of fits to them.
    """
    origins = _Origins(folder, stream)
    known = {variable.name: variable for variable in model.inputs}
    found: dict[str, Entry] = {}
    for name in table:
        value = table.take(name)
        if name not in known:
            expected = f"an input of {model.name}; {choices(name, known)}"
            table.wrong(name, "an unknown input", expected)
            continue
        entry = _entry(table, known[name], value, origins)
        if entry is not None:
            found[name] = entry
    for variable in model.inputs:
        if variable.name not in table and variable.default is not None:
            found[variable.name] = FixedInput(variable, variable.default, variable.shown_unit)
    ordered = tuple(found[variable.name] for variable in model.inputs if variable.name in found)
    return InputLaw(ordered, model.inputs)


def read_constraints(
    table: Section | None, model: Model, given: Collection[str]
) -> tuple[Constraint, ...]:
    """The comparisons that every point must satisfy, of inputs that are given."""
    if table is None:
        return ()
    units = {
        variable.name: variable.unit
        for variable in model.inputs
        if variable.name in given or variable.default is not None
    }
    found = []
    for position, text in enumerate(table.entries("keep")):
        path = ("keep", position)
        if not isinstance(text, str):
            table.wrong(path, as_written(text), 'a comparison such as "a > b"')
            continue
        try:
            found.append(parse_constraint(text, units))
        except ConstraintError as error:
            table.wrong(path, error.found, error.expected)
    table.close()
    return tuple(found)


def _entry(table: Section, variable: Input, value: Any, origins: _Origins) -> Entry | None:
    if isinstance(value, dict):
        section = Section(table.document, table.problems, (*table.path, variable.name), value)
        return _distribution(section, variable, origins)
    try:
        spread = parse_spread(value, variable.unit) if isinstance(value, str) else None
        if spread is None:
            quantity = parse_quantity(value, variable.unit)
            return _fixed(table, variable, value, quantity.value, quantity.unit)
        normal = Normal(spread.mean, spread.std)
        if not _is_usable(table, variable.name, normal):
            return None
    except QuantityError as error:
        expected = error.expected
        if not isinstance(value, str | int | float):
            expected += ", or a distribution such as { normal = { mean = …, std = … } }"
        table.wrong(variable.name, error.found, expected)
    except SettingsError:
        table.wrong(variable.name, as_written(value), "a standard deviation above 0 behind the ±")
    else:
        return RandomInput(variable, normal, spread.unit, f"normal {value}")
    return None


def _fixed(table: Section, variable: Input, written: Any, value: float, unit: str) -> Entry | None:
    if not variable.bounds.contain(np.array(value)):
        where = "" if variable.unit == DIMENSIONLESS else f" {variable.unit}"
        table.wrong(variable.name, as_written(written), f"a value {variable.bounds}{where}")
        return None
    return FixedInput(variable, value, unit)


def _distribution(table: Section, variable: Input, origins: _Origins) -> Entry | None:
    """A random input from ``{ family = { … }, lower = …, upper = … }``."""
    families = [key for key in table if key not in ("lower", "upper")]
    if len(families) != 1:
        found = "no distribution" if not families else " and ".join(families)
        for key in families:
            table.take(key)
        table.wrong((), found, f"one distribution of {', '.join([*DISTRIBUTIONS, MEASURED])}")
        return None
    (family,) = families
    if family not in (*DISTRIBUTIONS, MEASURED):
        expected = choices(family, [*DISTRIBUTIONS, MEASURED])
        table.wrong(family, "an unknown distribution", expected)
        return None
    section = table.table(family)
    if section is None:
        return None
    origin = origins.read(section, family, variable)
    limits = {key: table.quantity(key, variable.unit) for key in ("lower", "upper") if key in table}
    if origin is None or None in limits.values():
        return None
    try:
        law = Truncated(origin.law, **limits) if limits else origin.law  # type: ignore[arg-type]
    except SettingsError as error:
        table.refused(error)
        return None
    if not _is_usable(table, family, law):
        return None
    limited = {key: table.content[key] for key in table if key != family}
    description = "; ".join([origin.description, *_limits(limited)])
    return RandomInput(variable, law, origin.unit, description, origin.fit, origin.files)


@dataclass(frozen=True)
class _Origins:
    """Where laws come from: a family's parameters, or measurements in a folder."""

    folder: Path
    stream: Stream

    def read(self, table: Section, family: str, variable: Input) -> Origin | None:
        if family == MEASURED:
            return read_measured(table, variable, self.folder, self.stream.child(variable.name))
        law: Distribution | None = table.settings(
            resolve(DISTRIBUTIONS[family]), like=variable.unit
        )
        table.close()
        if law is None:
            return None
        parameters = ", ".join(f"{name} {value}" for name, value in table.content.items())
        return Origin(law, _unit_of(table.content, variable), f"{family}: {parameters}")


def _is_usable(table: Section, key: str, law: Distribution) -> bool:
    """Note a law whose draws are not all finite, or are all the same."""
    if not law.is_finite:
        expected = "parameters whose draws are finite and differ in double precision"
        table.wrong(key, "a law too wide or too narrow to draw from", expected)
    return law.is_finite


def _unit_of(parameters: Mapping[str, Any], variable: Input) -> str:
    """The unit that the author wrote the first parameter in."""
    for value in parameters.values():
        if isinstance(value, str):
            try:
                return parse_quantity(value, variable.unit).unit
            except QuantityError:
                continue
    return variable.shown_unit


def _limits(content: Mapping[str, Any]) -> list[str]:
    """Where a distribution is truncated, in its author's own words."""
    sides = {"lower": "at least", "upper": "at most"}
    return [f"{sides[key]} {value}" for key, value in content.items()]
