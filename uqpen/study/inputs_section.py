"""``[inputs]`` and ``[constraints]``: fixed inputs, random inputs and admissible points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.errors import ConstraintError, QuantityError, SettingsError, toml_text
from uqpen.core.lookup import choices, resolve
from uqpen.core.model import Input, Model
from uqpen.core.quantities import parse_quantity, parse_spread
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS
from uqpen.distributions.constraints import Constraint, parse_constraint
from uqpen.distributions.continuous import DISTRIBUTIONS, Normal
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.truncated import Truncated
from uqpen.study.measurements_section import MEASURED, InputDistribution, read_measured
from uqpen.study.table_reader import TableReader

__all__ = ["Inputs", "read_constraints", "read_inputs"]

Entry = FixedInput | RandomInput


@dataclass(frozen=True)
class Inputs:
    """The inputs of a study, as far as they could be read.

    Parameters
    ----------
    joint : JointDistribution
        The joint distribution of those without a mistake.
    unclear : frozenset of str
        Inputs with a mistake that is noted already, so that nothing more is said of them.
    """

    joint: JointDistribution
    unclear: frozenset[str] = frozenset()


def read_inputs(table: TableReader | None, model: Model, folder: Path, stream: Stream) -> Inputs:
    """Read the joint distribution of a model's inputs; invalid entries are noted and left out.

    Parameters
    ----------
    table : TableReader or None
        ``[inputs]``.
    model : Model
        The model of the inputs.
    folder : Path
        Folder with files of measurements.
    stream : Stream
        For the tests of fits to them.
    """
    origins = _DistributionReader(folder, stream)
    known = {variable.name: variable for variable in model.inputs}
    found: dict[str, Entry] = {}
    for name in table or ():
        assert table is not None
        value = table.take(name)
        if name not in known:
            expected = f"an input of {model.name}; {choices(name, known)}"
            table.add_problem(name, "an unknown input", expected)
            continue
        entry = _read_input(table, known[name], value, origins)
        if entry is not None:
            found[name] = entry
    for variable in model.inputs:
        if table is not None and variable.name not in table and variable.default is not None:
            found[variable.name] = FixedInput(variable, variable.default, variable.preferred_unit)
    ordered = tuple(found[variable.name] for variable in model.inputs if variable.name in found)
    joint = JointDistribution(ordered, model.inputs)
    unclear = {name for name in table or () if name not in found}
    if table is None or not unclear <= known.keys():
        # What is absent may stand there under a name with a mistake.
        unclear |= known.keys() - set(table or ())
    return Inputs(joint, frozenset(unclear))


def read_constraints(
    table: TableReader | None, model: Model, inputs: Inputs
) -> tuple[Constraint, ...]:
    """Read the comparisons of inputs that every point must satisfy."""
    if table is None:
        return ()
    given = inputs.unclear.union(entry.variable.name for entry in inputs.joint.inputs)
    units = dict.fromkeys(inputs.unclear, ANY_DIMENSION) | {
        variable.name: variable.unit
        for variable in model.inputs
        if variable.name in given or variable.unit is ANY_DIMENSION
    }
    found = []
    for position, text in enumerate(table.entries("keep")):
        path = ("keep", position)
        if not isinstance(text, str):
            table.add_problem(path, toml_text(text), 'a comparison such as "a > b"')
            continue
        try:
            found.append(parse_constraint(text, units))
        except ConstraintError as error:
            table.add_problem(path, error.found, error.expected)
    table.check_unknown_keys()
    return tuple(found)


def _read_input(
    table: TableReader, variable: Input, value: Any, origins: _DistributionReader
) -> Entry | None:
    if isinstance(value, dict):
        section = TableReader(table.document, table.problems, (*table.path, variable.name), value)
        return _distribution(section, variable, origins)
    try:
        spread = parse_spread(value, variable.unit) if isinstance(value, str) else None
        if spread is None:
            quantity = parse_quantity(value, variable.unit)
            return _fixed_input(table, variable, value, quantity.value, quantity.unit)
        normal = Normal(spread.mean, spread.std)
        if not _is_usable(table, variable.name, normal):
            return None
    except QuantityError as error:
        expected = error.expected
        if not isinstance(value, str | int | float):
            expected += ", or a distribution such as { normal = { mean = …, std = … } }"
        table.add_problem(variable.name, error.found, expected)
    except SettingsError:
        table.add_problem(
            variable.name, toml_text(value), "a standard deviation above 0 behind the ±"
        )
    else:
        return RandomInput(variable, normal, spread.unit, f"normal {value}")
    return None


def _fixed_input(
    table: TableReader, variable: Input, written: Any, value: float, unit: str
) -> Entry | None:
    if not variable.bounds.contain(np.array(value)):
        where = "" if variable.unit == DIMENSIONLESS else f" {variable.unit}"
        table.add_problem(variable.name, toml_text(written), f"a value {variable.bounds}{where}")
        return None
    return FixedInput(variable, value, unit)


def _distribution(
    table: TableReader, variable: Input, origins: _DistributionReader
) -> Entry | None:
    """Read a random input from ``{ family = { … }, lower = …, upper = … }``."""
    families = [key for key in table if key not in ("lower", "upper")]
    if len(families) != 1:
        found = "no distribution" if not families else " and ".join(families)
        for key in families:
            table.take(key)
        table.add_problem((), found, f"one distribution of {', '.join([*DISTRIBUTIONS, MEASURED])}")
        return None
    (family,) = families
    if family not in (*DISTRIBUTIONS, MEASURED):
        expected = choices(family, [*DISTRIBUTIONS, MEASURED])
        table.add_problem(family, "an unknown distribution", expected)
        return None
    section = table.table(family)
    if section is None:
        return None
    origin = origins.read(section, family, variable)
    limits = {key: table.quantity(key, variable.unit) for key in ("lower", "upper") if key in table}
    if origin is None or None in limits.values() or (limits and variable.unit is ANY_DIMENSION):
        return None
    try:
        distribution = Truncated(origin.distribution, **limits) if limits else origin.distribution  # type: ignore[arg-type]
    except SettingsError as error:
        table.add_problems(error)
        return None
    if not _is_usable(table, family, distribution):
        return None
    limited = {key: table.content[key] for key in table if key != family}
    description = "; ".join([origin.description, *_truncation_texts(limited)])
    return RandomInput(variable, distribution, origin.unit, description, origin.fit, origin.files)


@dataclass(frozen=True)
class _DistributionReader:
    """Reader of distributions, given by a family's parameters or by measurements in a folder."""

    folder: Path
    stream: Stream

    def read(self, table: TableReader, family: str, variable: Input) -> InputDistribution | None:
        if family == MEASURED:
            return read_measured(table, variable, self.folder, self.stream.child(variable.name))
        distribution: Distribution | None = table.settings(
            resolve(DISTRIBUTIONS[family]), like=variable.unit
        )
        table.check_unknown_keys()
        if distribution is None:
            return None
        parameters = ", ".join(f"{name} {value}" for name, value in table.content.items())
        return InputDistribution(
            distribution, _first_unit(table.content, variable), f"{family}: {parameters}"
        )


def _is_usable(table: TableReader, key: str, distribution: Distribution) -> bool:
    """Check a distribution; note one whose draws are not all finite, or are all the same."""
    if not distribution.is_finite:
        expected = "parameters whose draws are finite and differ in double precision"
        table.add_problem(key, "a law too wide or too narrow to draw from", expected)
    return distribution.is_finite


def _first_unit(parameters: Mapping[str, Any], variable: Input) -> str:
    """Return the unit of the first parameter as written in the study."""
    for value in parameters.values():
        if isinstance(value, str):
            try:
                return parse_quantity(value, variable.unit).unit
            except QuantityError:
                continue
    return variable.preferred_unit


def _truncation_texts(content: Mapping[str, Any]) -> list[str]:
    """Return the limits of a truncated distribution as written in the study."""
    sides = {"lower": "at least", "upper": "at most"}
    return [f"{sides[key]} {value}" for key, value in content.items()]
