"""Constraints on the inputs, written as comparisons in a study file.

``"plasticity_radius > crater_radius"`` or ``"impact_velocity * 2 < '3 km/s'"``: comparisons of
formulas of inputs.
"""

from __future__ import annotations

import ast
import functools
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray
from uqpen.core.errors import ConstraintError, toml_text
from uqpen.core.formulas import check_same_unit, check_unit, evaluate, parse_tree
from uqpen.core.lookup import choices
from uqpen.core.units import DIMENSIONLESS

_SHAPE = (
    'a comparison of inputs, such as "plasticity_radius > crater_radius", or with a quantity in '
    "quotes of its own, such as \"impact_velocity < '3 km/s'\""
)

_COMPARISONS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


@dataclass(frozen=True)
class Constraint:
    """Comparison that the inputs of an admissible run must satisfy: its text, and their names."""

    text: str
    names: frozenset[str]

    def is_satisfied(self, inputs: Arrays) -> BoolArray:
        """Return a mask of the points that satisfy it; false where a value in it is not finite.

        The inputs are SI values of shapes that broadcast.
        """
        with np.errstate(all="ignore"):
            tree = _parse(self.text)
            sides = [evaluate(side, inputs) for side in (tree.left, *tree.comparators)]
            results = [
                _COMPARISONS[type(comparison)](left, right)
                for comparison, left, right in zip(tree.ops, sides, sides[1:], strict=False)
            ]
            return np.asarray(
                functools.reduce(np.logical_and, [*results, *map(np.isfinite, sides)])
            )


def parse_constraint(text: str, units: Mapping[str, str]) -> Constraint:
    """Read a constraint on inputs, whose SI units are given, and check its names and units.

    ConstraintError if it is no comparison, names something else, or mixes dimensions.
    """
    tree = _parse(text)
    sides = [tree.left, *tree.comparators]
    try:
        found = [check_unit(side, units) for side in sides]
    except RecursionError:
        raise ConstraintError(f"{toml_text(text)}, nested too deeply", _SHAPE) from None
    check_same_unit(found, text)
    names = frozenset(
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in units
    )
    if not names:
        raise ConstraintError(f"{toml_text(text)}, which names no input", _SHAPE)
    return Constraint(text, names)


def evaluate_formula(text: str, values: Mapping[str, Any]) -> Any:
    """Return the value of a formula of plain numbers and of named values, such as ``"a / 10"``.

    The values may be anything with arithmetic. ConstraintError if it is no such formula.
    """
    example = f'such as "2 * {next(iter(values))}"' if values else "such as 2"
    expected = f"a formula of {', '.join(values) or 'numbers'}, {example}"
    tree = parse_tree(text, expected)
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id not in values:
            raise ConstraintError(f'"{node.id}"', f"a name before it; {choices(node.id, values)}")
    constants = (each.value for each in ast.walk(tree) if isinstance(each, ast.Constant))
    if any(isinstance(each, str) for each in constants):
        raise ConstraintError(toml_text(text), "plain numbers, in the units of the values")
    try:
        check_unit(tree, dict.fromkeys(values, DIMENSIONLESS))
        return evaluate(tree, values)
    except (ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, ConstraintError):
            raise
        raise ConstraintError(toml_text(text), expected) from None


def _parse(text: str) -> ast.Compare:
    tree = parse_tree(text, _SHAPE)
    if not isinstance(tree, ast.Compare):
        raise ConstraintError(toml_text(text), _SHAPE)
    if not all(type(comparison) in _COMPARISONS for comparison in tree.ops):
        raise ConstraintError(toml_text(text), "one of <, <=, >, >= between its sides")
    return tree
