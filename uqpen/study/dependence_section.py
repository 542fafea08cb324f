"""``[dependence]``: how the random inputs depend on each other."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from uqpen.errors import SettingsError, as_written
from uqpen.inputs.copulas import COPULAS
from uqpen.inputs.dependence import Dependence
from uqpen.inputs.elliptical_copulas import MEASURES, Elliptical, of_scores
from uqpen.inputs.law import InputLaw
from uqpen.lookup import choices
from uqpen.settings import declared
from uqpen.study.section import Section, member

__all__ = ["read_dependence"]

_CORRELATION = "a correlation, strictly between -1 and 1"
_PAIR = '{ inputs = ["a", "b"], correlation = 0.6 }'


def read_dependence(table: Section | None, law: InputLaw) -> InputLaw:
    """The law with its inputs' dependence; without, where a mistake was noted."""
    if table is None:
        return law
    copula = member(table, "copula", COPULAS, "a copula")
    if copula is None:
        return law
    noted = len(table.problems)
    is_elliptical = issubclass(copula, Elliptical)
    parameters = _elliptical(table, law, copula) if is_elliptical else _inputs(table, law)
    for field, setting in declared(copula):
        value = table.take(field.name)
        if value is None and field.default is dataclasses.MISSING:
            table.missing(field.name, setting.expected)
        elif value is not None:
            parameters[field.name] = _double(value)
    table.close()
    if len(table.problems) > noted:
        return law
    dependence = _built(table, copula, parameters)
    return law if dependence is None else dataclasses.replace(law, dependence=dependence)


def _built(
    table: Section, copula: Callable[..., Dependence], parameters: dict[str, Any]
) -> Dependence | None:
    try:
        return copula(**parameters)
    except SettingsError as error:
        for problem in error.problems:
            if problem.path == ("matrix",):  # a fault of all of it, told in the problem's words
                key = "matrix" if "matrix" in table else "pairs"
                table.wrong(key, problem.found, problem.expected)
            else:
                table.refused(SettingsError([problem]))
    return None


def _inputs(table: Section, law: InputLaw) -> dict[str, Any]:
    if "inputs" not in table:
        table.missing("inputs", 'the random inputs that it joins, such as ["a", "b"]')
    names = table.entries("inputs")
    _check_names(table, ("inputs",), names, law)
    return {"inputs": tuple(names)}


def _check_names(
    table: Section, path: tuple[str | int, ...], names: list[Any], law: InputLaw
) -> None:
    """Note names that are none of a random input."""
    random = [entry.variable.name for entry in law.random]
    fixed = {entry.variable.name for entry in law.fixed}
    for position, name in enumerate(names):
        if name in random if isinstance(name, str) else False:
            continue
        is_fixed = isinstance(name, str) and name in fixed
        found = f"{as_written(name)}{', an input that is fixed' if is_fixed else ''}"
        table.wrong((*path, position), found, f"a random input; {choices(str(name), random)}")


def _elliptical(table: Section, law: InputLaw, copula: type[Elliptical]) -> dict[str, Any]:
    """Inputs and matrix of scores, from a matrix or from pairs."""
    measures = {name: MEASURES[name] for name in copula.measures}
    listing = "; ".join(f'"{name}": {meaning}' for name, meaning in measures.items())
    expected = f"what the correlations are of: {listing}"
    measure = table.text("of", expected)
    if measure is not None and measure not in measures:
        table.wrong("of", as_written(measure), expected)
        measure = None
    if ("pairs" in table) == ("matrix" in table):
        found = "both pairs and matrix" if "pairs" in table else "no correlations"
        table.wrong((), found, f"either pairs = [{_PAIR}], or inputs with a matrix")
        for key in ("pairs", "inputs", "matrix"):
            table.take(key)
        return {}
    convert = lambda value: of_scores(value, measure or "")  # noqa: E731 - of this study's measure
    if "matrix" in table:
        return {**_inputs(table, law), "matrix": _matrix(table, convert)}
    return _pairs(table, law, convert)


def _matrix(table: Section, convert: Callable[[float], float]) -> tuple[tuple[float, ...], ...]:
    rows = []
    for row, values in enumerate(table.entries("matrix")):
        if not isinstance(values, list):
            table.wrong(("matrix", row), as_written(values), "a row of correlations in brackets")
            continue
        found = []
        for column, value in enumerate(values):
            if not _is_number(value):
                table.wrong(("matrix", row, column), as_written(value), "a number")
            elif row == column or not abs(value) < 1:  # which the copula refuses where it is wrong
                found.append(_double(value))
            else:
                found.append(convert(value))
        rows.append(tuple(found))
    return tuple(rows)


def _pairs(table: Section, law: InputLaw, convert: Callable[[float], float]) -> dict[str, Any]:
    """Of a pair that is not given, the scores are not correlated."""
    correlations: dict[frozenset[str], float] = {}
    for position, entry in enumerate(table.entries("pairs")):
        if not isinstance(entry, dict):
            table.wrong(("pairs", position), as_written(entry), _PAIR)
            continue
        pair = Section(table.document, table.problems, (*table.path, "pairs", position), entry)
        noted = len(table.problems)
        names, value = pair.entries("inputs"), pair.take("correlation")
        pair.close()
        _check_names(pair, ("inputs",), names, law)
        if not _is_number(value) or not abs(value) < 1:
            found = "nothing" if value is None else as_written(value)
            pair.wrong("correlation", found, _CORRELATION)
        if len(table.problems) > noted:
            continue
        if len(names) != 2 or names[0] == names[1]:
            pair.wrong("inputs", f"{len(set(names))} of them", 'two inputs, such as ["a", "b"]')
        elif frozenset(names) in correlations:
            pair.wrong("inputs", f"{names[0]} and {names[1]} for the second time", "each pair once")
        else:
            correlations[frozenset(names)] = convert(value)
    joined = [entry.variable.name for entry in law.random]
    joined = [name for name in joined if any(name in pair for pair in correlations)]
    matrix = tuple(
        tuple(1.0 if a == b else correlations.get(frozenset((a, b)), 0.0) for b in joined)
        for a in joined
    )
    return {"inputs": tuple(joined), "matrix": matrix}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _double(value: Any) -> Any:
    """A number as a float, of which TOML's whole numbers may be too large; else the value."""
    if not _is_number(value):
        return value
    return float(value) if abs(value) < 1e300 else math.inf
