"""Formulas of named quantities, with units, as a study file has them.

Names, numbers, quoted quantities, ``+ - * /``, whole powers and a few functions may stand in one.
The text is parsed into a tree in which only these may stand, and the tree is walked by the
functions below: nothing that a file contains is ever executed.
"""

from __future__ import annotations

import ast
import functools
import itertools
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.errors import ConstraintError, QuantityError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.quantities import Quantity, parse_any_dimension
from uqpen.core.units import (
    DIMENSIONLESS,
    are_convertible,
    product,
    ratio,
    si_unit,
    square_root,
)

_LONGEST = 500
_HIGHEST_POWER = 9

_OPERATIONS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
# Functions of plain numbers, of one value, and of several values.
_OF_NUMBERS = {"log10": np.log10, "log": np.log, "exp": np.exp}
_OF_ONE = {**_OF_NUMBERS, "sqrt": np.sqrt, "abs": np.abs}
_OF_SEVERAL = {"min": np.minimum, "max": np.maximum}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {**_OF_ONE, **_OF_SEVERAL}

_FORMULA = 'a formula, such as "strength - load" or "log10(delay / \'1 s\')"'


@dataclass(frozen=True)
class Formula:
    """Number that follows from others: its text, their names, and its SI unit."""

    text: str
    names: frozenset[str]
    unit: str

    @property
    def may_fail(self) -> bool:
        """True if a root or logarithm may leave it without a value that its names all have.

        A divisor that is exactly 0, or a number beyond all doubles, is not expected.
        """
        nodes = ast.walk(parse_tree(self.text, _FORMULA))
        called = {ast.unparse(each.func) for each in nodes if isinstance(each, ast.Call)}
        return not called.isdisjoint(("log", "log10", "sqrt"))

    @property
    def is_computed(self) -> bool:
        """True if its value is a new number, not one of those that it names as in ``max(a, b)``."""
        nodes = ast.walk(parse_tree(self.text, _FORMULA))
        return any(isinstance(each, ast.BinOp | ast.UnaryOp) for each in nodes)

    def values(self, columns: Arrays) -> FloatArray:
        """Return its values in SI units, NaN where one is not finite.

        Parameters
        ----------
        columns : mapping of str to ndarray, shape (run,)
            SI values.
        """
        with np.errstate(all="ignore"):
            found = np.asarray(evaluate(parse_tree(self.text, _FORMULA), columns), np.float64)
        return np.where(np.isfinite(found), found, np.nan)


def parse_formula(text: str, units: Mapping[str, str], named: str, what: str = "output") -> Formula:
    """Read a formula of quantities, whose SI units are given; `named` and `what` are for messages.

    ConstraintError if something else stands in it, or its units do not agree.
    """
    tree = parse_tree(text, _FORMULA)
    try:
        unit = check_unit(tree, units, named)
    except RecursionError:
        raise ConstraintError(f"{toml_text(text)}, nested too deeply", _FORMULA) from None
    names = frozenset(
        each.id for each in ast.walk(tree) if isinstance(each, ast.Name) and each.id in units
    )
    if not names:
        raise ConstraintError(f"{toml_text(text)}, which names no {what}", _FORMULA)
    return Formula(ast.unparse(tree), names, unit)


def names_in(text: str) -> frozenset[str]:
    """Return the names in a text that is an expression; none of another text."""
    try:
        tree = parse_tree(text, "")
    except ConstraintError:
        return frozenset()
    functions = {each.func for each in ast.walk(tree) if isinstance(each, ast.Call)}
    names = (each for each in ast.walk(tree) if isinstance(each, ast.Name))
    return frozenset(each.id for each in names if each not in functions)


def parse_tree(text: str, expected: str) -> ast.expr:
    """Parse a text, which is not checked; ConstraintError where it is no expression."""
    if len(text) > _LONGEST:
        raise ConstraintError(f"{len(text)} characters", f"at most {_LONGEST}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a text that Python warns of is no expression
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ConstraintError(toml_text(text), expected) from None


def evaluate(node: ast.expr, inputs: Mapping[str, Any]) -> Any:
    """Evaluate an expression in SI units; `check_unit` has checked the tree."""
    match node:
        case ast.Name(id=name):
            return inputs[name]
        case ast.Constant(value=value):
            return np.float64(_quantity(value).value)  # which divides by zero as arrays do
        case ast.UnaryOp(op=op, operand=operand):
            value = evaluate(operand, inputs)
            return -value if isinstance(op, ast.USub) else value
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))):
            return evaluate(left, inputs) ** power
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](evaluate(left, inputs), evaluate(right, inputs))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            values = [evaluate(each, inputs) for each in arguments]
            return (
                functools.reduce(FUNCTIONS[name], values[1:], values[0])
                if (name in _OF_SEVERAL)
                else FUNCTIONS[name](*values)
            )
    raise AssertionError(ast.dump(node))


def check_unit(
    node: ast.expr, units: Mapping[str, str], named: str = "an input of the model"
) -> str:
    """Return the SI unit of an expression; ConstraintError where it has none.

    `named` says what a name may stand for, as messages do.
    """
    match node:
        case ast.Name(id=name):
            if name not in units:
                raise ConstraintError(f'"{name}"', f"{named}; {choices(name, units)}")
            return si_unit(units[name])
        case ast.Constant(value=value):
            return si_unit(_quantity(value).unit)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return check_unit(operand, units, named)
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))) if (
            not isinstance(power, bool) and 1 <= power <= _HIGHEST_POWER
        ):
            unit = base = check_unit(left, units, named)
            for _ in range(power - 1):
                unit = product(unit, base)
            return unit
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            one, other = check_unit(left, units, named), check_unit(right, units, named)
            check_same_unit([one, other], ast.unparse(node))
            return one
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            combine = product if isinstance(op, ast.Mult) else ratio
            return combine(check_unit(left, units, named), check_unit(right, units, named))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if (
            name in FUNCTIONS and (len(arguments) > 1) == (name in _OF_SEVERAL) and arguments
        ):
            return _unit_of_call(name, [check_unit(each, units, named) for each in arguments], node)
    raise ConstraintError(
        f'"{ast.unparse(node)}"',
        "names of inputs, numbers, quoted quantities, + - * / and **, "
        f"{', '.join(_OF_ONE)} of one value, {', '.join(_OF_SEVERAL)} of several",
    )


def _unit_of_call(name: str, units: Sequence[str], node: ast.Call) -> str:
    """Return the SI unit of a function of values in SI units."""
    text, (unit, *_) = ast.unparse(node), units
    if name in _OF_NUMBERS and not are_convertible(unit, DIMENSIONLESS):
        argument = ast.unparse(ast.BinOp(node.args[0], ast.Div(), ast.Constant(f"1 {unit}")))
        example = f"{name}({argument})"
        raise ConstraintError(
            f"{toml_text(text)}, of a value in {unit}", f"a plain number in it, such as {example}"
        )
    check_same_unit(units, text)
    if name == "sqrt":
        try:
            return square_root(unit)
        except QuantityError:
            found = f"{toml_text(text)}, of a value in {unit}"
            raise ConstraintError(found, "a unit that has a square root, such as m2") from None
    return DIMENSIONLESS if name in _OF_NUMBERS else unit


def check_same_unit(units: Sequence[str], text: str) -> None:
    """Raise ConstraintError unless all units have one dimension; the text is what they stand in."""
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
