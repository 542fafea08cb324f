"""``[dependence]``: how the random inputs depend on each other."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from uqpen.core.errors import SettingsError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.settings import declared_settings
from uqpen.distributions.copulas import COPULAS
from uqpen.distributions.dependence import Dependence
from uqpen.distributions.elliptical_copulas import MEASURES, EllipticalCopula, score_correlation
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.inputs_section import Inputs
from uqpen.study.table_reader import TableReader, family_member

__all__ = ["read_dependence"]

_CORRELATION = "a correlation, strictly between -1 and 1"
_PAIR = '{ inputs = ["a", "b"], correlation = 0.6 }'


def read_dependence(table: TableReader | None, inputs: Inputs) -> JointDistribution:
    """Return the joint distribution with dependent inputs; unchanged where a mistake was noted."""
    joint = inputs.joint
    if table is None:
        return joint
    copula = family_member(table, "copula", COPULAS, "a copula")
    if copula is None:
        return joint
    noted = len(table.problems)
    is_elliptical = issubclass(copula, EllipticalCopula)
    parameters = _elliptical(table, inputs, copula) if is_elliptical else _inputs(table, inputs)
    for field, setting in declared_settings(copula):
        value = table.take(field.name)
        if value is None and field.default is dataclasses.MISSING:
            table.add_missing(field.name, setting.expected)
        elif value is not None:
            parameters[field.name] = _as_float(value)
    table.check_unknown_keys()
    if len(table.problems) > noted:
        return joint
    dependence = _build_copula(table, copula, parameters)
    if dependence is None or inputs.unclear:
        return joint
    return dataclasses.replace(joint, dependence=dependence)


def _build_copula(
    table: TableReader, copula: Callable[..., Dependence], parameters: dict[str, Any]
) -> Dependence | None:
    try:
        return copula(**parameters)
    except SettingsError as error:
        for problem in error.problems:
            if problem.path == ("matrix",):  # a fault of all of it, told in the problem's words
                key = "matrix" if "matrix" in table else "pairs"
                table.add_problem(key, problem.found, problem.expected)
            else:
                table.add_problems(SettingsError([problem]))
    return None


def _inputs(table: TableReader, inputs: Inputs) -> dict[str, Any]:
    if "inputs" not in table:
        table.add_missing("inputs", 'the random inputs that it joins, such as ["a", "b"]')
    names = table.entries("inputs")
    _check_names(table, ("inputs",), names, inputs)
    return {"inputs": tuple(names)}


def _check_names(
    table: TableReader, path: tuple[str | int, ...], names: list[Any], inputs: Inputs
) -> None:
    """Note names that are none of a random input."""
    random = _possibly_random(inputs)
    fixed = {entry.variable.name for entry in inputs.joint.fixed}
    for position, name in enumerate(names):
        if name in random if isinstance(name, str) else False:
            continue
        is_fixed = isinstance(name, str) and name in fixed
        found = f"{toml_text(name)}{', an input that is fixed' if is_fixed else ''}"
        table.add_problem((*path, position), found, f"a random input; {choices(str(name), random)}")


def _possibly_random(inputs: Inputs) -> list[str]:
    """The random inputs, and behind them those that could not be read."""
    random = [entry.variable.name for entry in inputs.joint.random]
    return [*random, *sorted(inputs.unclear)]


def _elliptical(
    table: TableReader, inputs: Inputs, copula: type[EllipticalCopula]
) -> dict[str, Any]:
    """Inputs and matrix of scores, from a matrix or from pairs."""
    measures = {name: MEASURES[name] for name in copula.measures}
    listing = "; ".join(f'"{name}": {meaning}' for name, meaning in measures.items())
    expected = f"what the correlations are of: {listing}"
    measure = table.text("of", expected)
    if measure is not None and measure not in measures:
        table.add_problem("of", toml_text(measure), expected)
        measure = None
    if ("pairs" in table) == ("matrix" in table):
        found = "both pairs and matrix" if "pairs" in table else "no correlations"
        table.add_problem((), found, f"either pairs = [{_PAIR}], or inputs with a matrix")
        for key in ("pairs", "inputs", "matrix"):
            table.take(key)
        return {}
    convert = lambda value: score_correlation(value, measure or "")  # noqa: E731 - of this study's measure
    if "matrix" in table:
        return {**_inputs(table, inputs), "matrix": _matrix(table, convert)}
    return _pairs(table, inputs, convert)


def _matrix(table: TableReader, convert: Callable[[float], float]) -> tuple[tuple[float, ...], ...]:
    rows = []
    for row, values in enumerate(table.entries("matrix")):
        if not isinstance(values, list):
            table.add_problem(
                ("matrix", row), toml_text(values), "a row of correlations in brackets"
            )
            continue
        found = []
        for column, value in enumerate(values):
            if not _is_number(value):
                table.add_problem(("matrix", row, column), toml_text(value), "a number")
            elif row == column or not abs(value) < 1:  # which the copula refuses where it is wrong
                found.append(_as_float(value))
            else:
                found.append(convert(value))
        rows.append(tuple(found))
    return tuple(rows)


def _pairs(table: TableReader, inputs: Inputs, convert: Callable[[float], float]) -> dict[str, Any]:
    """Read the correlations of pairs of inputs; a pair that is not given is uncorrelated."""
    correlations: dict[frozenset[str], float] = {}
    for position, entry in enumerate(table.entries("pairs")):
        if not isinstance(entry, dict):
            table.add_problem(("pairs", position), toml_text(entry), _PAIR)
            continue
        pair = TableReader(table.document, table.problems, (*table.path, "pairs", position), entry)
        noted = len(table.problems)
        names, value = pair.entries("inputs"), pair.take("correlation")
        pair.check_unknown_keys()
        _check_names(pair, ("inputs",), names, inputs)
        if not _is_number(value) or not abs(value) < 1:
            found = "nothing" if value is None else toml_text(value)
            pair.add_problem("correlation", found, _CORRELATION)
        if len(table.problems) > noted:
            continue
        if len(names) != 2 or names[0] == names[1]:
            pair.add_problem(
                "inputs", f"{len(set(names))} of them", 'two inputs, such as ["a", "b"]'
            )
        elif frozenset(names) in correlations:
            pair.add_problem(
                "inputs", f"{names[0]} and {names[1]} for the second time", "each pair once"
            )
        else:
            correlations[frozenset(names)] = convert(value)
    joined = _possibly_random(inputs)
    joined = [name for name in joined if any(name in pair for pair in correlations)]
    matrix = tuple(
        tuple(1.0 if a == b else correlations.get(frozenset((a, b)), 0.0) for b in joined)
        for a in joined
    )
    return {"inputs": tuple(joined), "matrix": matrix}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _as_float(value: Any) -> Any:
    """Return a number as a float, infinite for a TOML integer of 1e300 or more; else the value."""
    if not _is_number(value):
        return value
    return float(value) if abs(value) < 1e300 else math.inf
