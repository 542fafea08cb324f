"""Constraints on the inputs, written as comparisons in a study file.

``"plasticity_radius > crater_radius"`` or ``"impact_velocity * 2 < '3 km/s'"``: names of inputs,
numbers, quoted quantities, ``+ - * /``, whole powers and comparisons. The text is parsed into a
tree in which only these may stand, and the tree is walked by the functions below: nothing that a
file contains is ever executed.
"""

from __future__ import annotations

import ast
import functools
import itertools
import operator
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray
from uqpen.core.errors import ConstraintError, QuantityError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.quantities import Quantity, parse_any_dimension
from uqpen.core.units import DIMENSIONLESS, are_convertible, product, ratio, si_unit

_SHAPE = (
    'a comparison of inputs, such as "plasticity_radius > crater_radius", or with a quantity in '
    "quotes of its own, such as \"impact_velocity < '3 km/s'\""
)
_LONGEST = 500
_HIGHEST_POWER = 9

_OPERATIONS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
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
            sides = [_evaluate(side, inputs) for side in (tree.left, *tree.comparators)]
            results = [
                _OPERATIONS[type(comparison)](left, right)
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
        found = [_check_unit(side, units) for side in sides]
    except RecursionError:
        raise ConstraintError(f"{toml_text(text)}, nested too deeply", _SHAPE) from None
    _check_same_unit(found, text)
    names = frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    if not names:
        raise ConstraintError(f"{toml_text(text)}, which names no input", _SHAPE)
    return Constraint(text, names)


def evaluate_formula(text: str, values: Mapping[str, Any]) -> Any:
    """Return the value of a formula of plain numbers and of named values, such as ``"a / 10"``.

    The values may be anything with arithmetic. ConstraintError if it is no such formula.
    """
    example = f'such as "2 * {next(iter(values))}"' if values else "such as 2"
    try:
        if len(text) > _LONGEST:
            raise ConstraintError(f"{len(text)} characters", f"at most {_LONGEST}")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            tree = ast.parse(text.strip(), mode="eval").body
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id not in values:
                raise ConstraintError(
                    f'"{node.id}"', f"a name before it; {choices(node.id, values)}"
                )
        constants = (each.value for each in ast.walk(tree) if isinstance(each, ast.Constant))
        if any(isinstance(each, str) for each in constants):
            raise ConstraintError(toml_text(text), "plain numbers, in the units of the values")
        _check_unit(tree, dict.fromkeys(values, DIMENSIONLESS))
        return _evaluate(tree, values)
    except ConstraintError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError, Warning):
        expected = f"a formula of {', '.join(values) or 'numbers'}, {example}"
        raise ConstraintError(toml_text(text), expected) from None


def _parse(text: str) -> ast.Compare:
    if len(text) > _LONGEST:
        raise ConstraintError(f"{len(text)} characters", f"at most {_LONGEST}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a text that Python warns of is no comparison
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ConstraintError(toml_text(text), _SHAPE) from None
    if not isinstance(tree, ast.Compare):
        raise ConstraintError(toml_text(text), _SHAPE)
    if not all(type(comparison) in _OPERATIONS for comparison in tree.ops):
        raise ConstraintError(toml_text(text), "one of <, <=, >, >= between its sides")
    return tree


def _evaluate(node: ast.expr, inputs: Mapping[str, Any]) -> Any:
    """Evaluate a side in SI units; `_check_unit` has checked the tree."""
    match node:
        case ast.Name(id=name):
            return inputs[name]
        case ast.Constant(value=value):
            return np.float64(_quantity(value).value)  # which divides by zero as arrays do
        case ast.UnaryOp(op=op, operand=operand):
            value = _evaluate(operand, inputs)
            return -value if isinstance(op, ast.USub) else value
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))):
            return _evaluate(left, inputs) ** power
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](_evaluate(left, inputs), _evaluate(right, inputs))
    raise AssertionError(ast.dump(node))


def _check_unit(node: ast.expr, units: Mapping[str, str]) -> str:
    """Return the SI unit of a side; anything but arithmetic of inputs is an error."""
    match node:
        case ast.Name(id=name):
            if name not in units:
                expected = f"an input of the model; {choices(name, units)}"
                raise ConstraintError(f'"{name}"', expected)
            return si_unit(units[name])
        case ast.Constant(value=value):
            return si_unit(_quantity(value).unit)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return _check_unit(operand, units)
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))) if (
            not isinstance(power, bool) and 1 <= power <= _HIGHEST_POWER
        ):
            unit = base = _check_unit(left, units)
            for _ in range(power - 1):
                unit = product(unit, base)
            return unit
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            one, other = _check_unit(left, units), _check_unit(right, units)
            _check_same_unit([one, other], ast.unparse(node))
            return one
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            combine = product if isinstance(op, ast.Mult) else ratio
            return combine(_check_unit(left, units), _check_unit(right, units))
    raise ConstraintError(
        f'"{ast.unparse(node)}"', "names of inputs, numbers, quoted quantities, + - * / and **"
    )


def _check_same_unit(units: list[str], text: str) -> None:
    for one, other in itertools.pairwise(units):
        if not are_convertible(one, other):
            found = f"{toml_text(text)}, which compares {one} with {other}"
            raise ConstraintError(found, "sides of the same dimension")


def _quantity(value: object) -> Quantity:
    """Read a number, or a quoted quantity of any dimension."""
    if isinstance(value, str):
        try:
            return parse_any_dimension(value)
        except QuantityError as error:
            raise ConstraintError(error.found, 'a quantity such as "16 cm"') from None
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300:
        return Quantity(float(value), DIMENSIONLESS)
    raise ConstraintError(repr(value), "a number or a quoted quantity")
