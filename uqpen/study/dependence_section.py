"""``[dependence]``: how the random inputs depend on each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from uqpen.core.errors import QuantityError, SettingsError, toml_text
from uqpen.core.list_reading import as_float, read_each, read_list
from uqpen.core.lookup import choices
from uqpen.core.settings import number
from uqpen.distributions.copulas import MEASURES, Dependence, EllipticalCopula, score_correlation
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.inputs_section import Inputs
from uqpen.study.table_reader import TableReader
from uqpen.study.user_defined_members import COPULA, read_class

__all__ = ["read_dependence"]

_PAIR = '{ inputs = ["a", "b"], correlation = 0.6 }'


@dataclass(frozen=True)
class _Pair:
    """Correlation of a pair of inputs."""

    correlation: float = number(
        above=-1, below=1, expected="a correlation, strictly between -1 and 1"
    )


def read_dependence(
    table: TableReader, inputs: Inputs, owners: Mapping[str, str]
) -> JointDistribution:
    """Return the joint distribution with dependent inputs; unchanged where a mistake was noted.

    Inputs of a group, which `owners` names, cannot be joined to others.
    """
    joint = inputs.joint
    if not table.is_given or _note_grouped(table, owners):
        return joint
    copula = read_class(table, "copula", COPULA, "a copula")
    if copula is None:
        return joint
    noted = len(table.problems)
    is_elliptical = issubclass(copula, EllipticalCopula)
    given = _elliptical(table, inputs, copula) if is_elliptical else _inputs(table, inputs)
    parameters = table.setting_values(copula)
    table.check_unknown_keys()
    if parameters is None or len(table.problems) > noted:
        return joint
    dependence = _build_copula(table, copula, given | parameters)
    if dependence is None or inputs.unclear:
        return joint
    return replace(joint, dependence=dependence)


def _note_grouped(table: TableReader, owners: Mapping[str, str]) -> bool:
    """Note inputs whose joint distribution is given already; return True for any."""
    pairs = table.content.get("pairs")
    lists = [table.content, *(pairs if isinstance(pairs, list) else [])]
    named = [each.get("inputs") for each in lists if isinstance(each, dict)]
    joined = [name for names in named if isinstance(names, list) for name in names]
    grouped = [name for name in joined if isinstance(name, str) and name in owners]
    for name in dict.fromkeys(grouped):
        found = f"{name}, whose joint distribution is [joint.{owners[name]}]"
        table.add_problem((), found, "inputs that [inputs] has")
    return bool(grouped)


def _build_copula(
    table: TableReader, copula: Callable[..., Dependence], parameters: dict[str, Any]
) -> Dependence | None:
    try:
        return copula(**parameters)
    except SettingsError as error:
        for problem in error.problems:
            if problem.path == ("matrix",):  # of all of it, in the problem's words
                key = "matrix" if "matrix" in table else "pairs"
                table.add_problem(key, problem.found, problem.expected)
            else:
                table.add_refused([problem])
    return None


def _inputs(table: TableReader, inputs: Inputs) -> dict[str, Any]:
    if "inputs" not in table:
        table.add_missing("inputs", 'the random inputs that it joins, such as ["a", "b"]')
    return {"inputs": tuple(_input_names(table, inputs))}


def _input_names(table: TableReader, inputs: Inputs) -> list[Any]:
    """Read names of inputs; note those that do not name a random input."""
    random = _possibly_random(inputs)
    fixed = [entry.variable.name for entry in inputs.joint.fixed]
    names = table.entries("inputs")
    for position, name in enumerate(names):
        if name not in random:
            found = f"{toml_text(name)}{', an input that is fixed' * (name in fixed)}"
            expected = f"a random input; {choices(str(name), random)}"
            table.add_problem(("inputs", position), found, expected)
    return names


def _possibly_random(inputs: Inputs) -> list[str]:
    """Return the random inputs, and behind them those that could not be read."""
    return [*(entry.variable.name for entry in inputs.joint.random), *sorted(inputs.unclear)]


def _elliptical(
    table: TableReader, inputs: Inputs, copula: type[EllipticalCopula]
) -> dict[str, Any]:
    """Read inputs and the matrix of their scores, from a matrix or from pairs."""
    listing = "; ".join(f'"{name}": {MEASURES[name]}' for name in copula.measures)
    expected = f"the kind of the correlations: {listing}"
    measure = table.text("of", expected) or ""
    if measure and measure not in copula.measures:
        table.add_wrong("of", measure, expected)
    if ("pairs" in table) == ("matrix" in table):
        found = "both pairs and matrix" if "pairs" in table else "no correlations"
        table.add_problem((), found, f"either pairs = [{_PAIR}], or inputs with a matrix")
        for key in ("pairs", "inputs", "matrix"):
            table.take(key)
        return {}
    if "pairs" in table:
        return _pairs(table, inputs, measure)
    return {**_inputs(table, inputs), "matrix": _matrix(table, measure)}


def _matrix(table: TableReader, measure: str) -> tuple[tuple[float, ...], ...]:
    def read_value(value: Any) -> float:
        number = as_float(value)
        if not isinstance(number, float):
            raise QuantityError(toml_text(value), "a number")
        # The copula refuses what is no correlation.
        return score_correlation(number, measure) if abs(number) < 1 else number

    def read_row(values: Any) -> tuple[float, ...]:
        if not isinstance(values, list):
            raise QuantityError(toml_text(values), "a row of correlations in brackets")
        return tuple(read_each(values, read_value))

    try:
        return tuple(read_list(table.take("matrix"), read_row))
    except (SettingsError, QuantityError) as error:
        table.add_problems(error.problems, "matrix")
    return ()


def _pairs(table: TableReader, inputs: Inputs, measure: str) -> dict[str, Any]:
    """Read the correlations of pairs of inputs; a pair that is not given is uncorrelated."""
    correlations: dict[frozenset[str], float] = {}
    for position, entry in enumerate(table.entries("pairs")):
        if not isinstance(entry, dict):
            table.add_wrong(("pairs", position), entry, _PAIR)
            continue
        pair = table.inside(entry, "pairs", position)
        noted = len(table.problems)
        names = _input_names(pair, inputs)
        given = pair.whole_settings(_Pair)
        if given is None or len(table.problems) > noted:
            continue
        if len(names) != 2 or names[0] == names[1]:
            found = f"{len(set(names))} of them"
            pair.add_problem("inputs", found, 'two inputs, such as ["a", "b"]')
        elif frozenset(names) in correlations:
            found = f"{names[0]} and {names[1]} for the second time"
            pair.add_problem("inputs", found, "each pair once")
        else:
            correlations[frozenset(names)] = score_correlation(given.correlation, measure)
    joined = [
        name for name in _possibly_random(inputs) if any(name in pair for pair in correlations)
    ]
    matrix = tuple(
        tuple(1.0 if a == b else correlations.get(frozenset((a, b)), 0.0) for b in joined)
        for a in joined
    )
    return {"inputs": tuple(joined), "matrix": matrix}
