"""Joint distributions that are Python objects, as tables of a study file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from uqpen.core.columns import heading_parts
from uqpen.core.errors import TableError
from uqpen.core.units import DIMENSIONLESS
from uqpen.distributions.chaospy_joint import declare_joint, is_joint
from uqpen.study.object_section import OBJECT

__all__ = ["joint_path", "joint_units", "with_joint_tables"]


def with_joint_tables(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a study with its joint distributions as tables.

    A distribution of chaospy under a tuple of inputs becomes an entry of ``joint``, or an entry of
    ``inputs`` for each input if these are independent.
    """
    inputs, joint = arguments.get("inputs"), arguments.get("joint")
    if not isinstance(inputs, Mapping) or not isinstance(joint, Mapping | None):
        return dict(arguments)
    single = {name: value for name, value in inputs.items() if not isinstance(name, tuple)}
    tables = {name: _table(value) for name, value in (joint or {}).items()}
    for names, value in inputs.items():
        if not isinstance(names, tuple):
            continue
        margins = list(value) if is_joint(value) and not value.stochastic_dependent else []
        # An input with another entry stays in its table, whose reader refuses it.
        is_new = len({*names} - single.keys()) == len(names)
        if is_new and len(margins) == len(names) and all(len(each) == 1 for each in margins):
            single |= dict(zip(names, margins, strict=True))
        else:
            tables[joint_path(names)[1]] = _table({"inputs": list(names), "chaospy": value})
    found = {**arguments, "inputs": single or None, "joint": tables or None}
    return {name: value for name, value in found.items() if value is not None}


def joint_path(names: tuple[Any, ...]) -> tuple[str, str]:
    """Return the path of the table of the joint distribution of some inputs."""
    return "joint", "_".join(map(str, names))


def _table(value: Any) -> Any:
    """Return a joint distribution as a study file has it: as data, else the object by its name."""
    if not isinstance(value, Mapping) or not is_joint(value.get("chaospy")):
        return value
    joint = value["chaospy"]
    others = {key: entry for key, entry in value.items() if key != "chaospy"}
    declared = declare_joint(joint)
    return {**others, **({OBJECT: joint} if declared is None else {"chaospy": declared})}


def joint_units(joint: Any) -> Iterator[tuple[str, str]]:
    """Yield the inputs of joint distributions with the units of their values."""
    tables = joint.values() if isinstance(joint, Mapping) else ()
    for table in tables:
        if not isinstance(table, Mapping):
            continue
        names, sample = table.get("inputs", ()), table.get("sample")
        units = [*map(str, table.get("units", ()))]
        units += [DIMENSIONLESS] * (len(names) - len(units))
        yield from zip(map(str, names), units, strict=False)
        for heading in sample if isinstance(sample, Mapping) else ():
            try:
                name, unit = heading_parts(str(heading), "the table")
            except TableError:
                continue  # the reader of the table says what is wrong
            if name != "weight":
                yield name, unit
