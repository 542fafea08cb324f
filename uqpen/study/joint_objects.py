"""Joint distributions that are Python objects, as tables of a study file."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from uqpen.core.columns import heading_parts
from uqpen.core.errors import Problem, TableError
from uqpen.core.units import DIMENSIONLESS
from uqpen.distributions.chaospy_joint import declare_joint, is_joint
from uqpen.distributions.frozen import is_chaospy
from uqpen.study.named_object import OBJECT

__all__ = ["find_tuple_faults", "joint_paths", "joint_units", "with_joint_tables"]


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
    paths = joint_paths(inputs, tables)
    for names, value in inputs.items():
        if not isinstance(names, tuple) or _tuple_fault(names, value):
            continue
        margins = [value] if len(names) == 1 else list(value)
        is_independent = len(names) == 1 or not value.stochastic_dependent
        # An input with another entry stays in its table, whose reader refuses it.
        is_new = len({*names} - single.keys()) == len(names)
        if is_new and is_independent and all(len(each) == 1 for each in margins):
            single |= dict(zip(names, margins, strict=True))
        else:
            tables[paths[names][1]] = _table({"inputs": list(names), "chaospy": value})
    found = {**arguments, "inputs": single or None, "joint": tables or None}
    return {name: value for name, value in found.items() if value is not None}


def find_tuple_faults(inputs: object) -> Iterator[Problem]:
    """Yield the problems of the entries of inputs under a tuple of names."""
    for names, value in inputs.items() if isinstance(inputs, Mapping) else ():
        if isinstance(names, tuple) and (fault := _tuple_fault(names, value)):
            yield Problem(("inputs", str(names)), *fault)


def _tuple_fault(names: tuple[Any, ...], value: object) -> tuple[str, str] | None:
    """Return what is wrong with an entry, and what is expected; None where nothing is."""
    expected = f"a distribution of chaospy of dimension {len(names)}"
    if not names:
        return "no names of inputs", "a tuple of the inputs of a joint distribution"
    if not is_chaospy(value):
        return f"an object of class {type(value).__name__}", expected
    dimension = len(value)  # type: ignore[arg-type]
    return None if dimension == len(names) else (f"one of dimension {dimension}", expected)


def joint_paths(
    inputs: Iterable[Any], taken: Collection[str] = ()
) -> dict[tuple[Any, ...], tuple[str, str]]:
    """Return the path of the table of each joint distribution, by the tuple of its inputs.

    Parameters
    ----------
    inputs : iterable
        Names of inputs, and tuples of them.
    taken : collection of str
        Names of other tables.
    """
    paths: dict[tuple[Any, ...], tuple[str, str]] = {}
    for names in inputs:
        if isinstance(names, tuple):
            used = {*taken, *(path[1] for path in paths.values())}
            joined = "_".join(map(str, names))
            # ("a_b", "c") and ("a", "b_c") are two.
            numbered = (f"{joined}_{number}" for number in itertools.count(2))
            name = next(each for each in itertools.chain([joined], numbered) if each not in used)
            paths[names] = ("joint", name)
    return paths


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
        # Both a dict of columns and a DataFrame are iterables of headings.
        for heading in (
            sample if isinstance(sample, Iterable) and not isinstance(sample, str) else ()
        ):
            try:
                name, unit = heading_parts(str(heading), "the table")
            except TableError:
                continue  # the reader of the table says what is wrong
            if name != "weight":
                yield name, unit
