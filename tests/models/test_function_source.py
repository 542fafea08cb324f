"""A function is known by its source, by what it calls and by the values that it takes."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from uqpen.models.function_source import function_source

FACTOR = 2.0


def scaled(x: float) -> float:
    return FACTOR * x


def recursive(x: float) -> float:
    return recursive(x - 1) if x > 1 else math.sqrt(x)


class Solver:
    def __call__(self, x: float) -> float:
        return x


def closure(value: Any) -> Callable[[float], Any]:
    def model(x: float) -> Any:
        return scaled(x), value, np.sqrt(x)

    return model


def defaulted(x: float, *, y: float = 1.0) -> float:
    return x + y


def evaluated(x: float) -> Any:
    return eval("FACTOR * x")


def sha256(function: Any) -> str:
    source = function_source(function)
    assert source.is_known, source.unknown
    return source.sha256


@pytest.mark.parametrize(
    "value", [1, 1.5, "a", None, (1, 2), {"a": 1.0}, np.arange(3.0), math, recursive, np.float64(2)]
)
def test_values_from_outside_are_part_of_it(value: object) -> None:
    assert sha256(closure(value)) == sha256(closure(value))
    assert sha256(closure(value)) != sha256(closure("another"))


def test_a_global_value_of_a_function_that_it_calls_is_part_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = sha256(closure(1))
    monkeypatch.setitem(globals(), "FACTOR", 3.0)
    assert sha256(closure(1)) != before


def test_default_values_are_part_of_it() -> None:
    before = sha256(defaulted)
    assert sha256(functools.partial(defaulted, y=2.0)) != before


def test_its_text_is_its_source() -> None:
    source = function_source(defaulted)
    assert source.name == "defaulted"
    assert source.text == "def defaulted(x: float, *, y: float = 1.0) -> float:\n    return x + y\n"


@pytest.mark.parametrize(
    ("function", "unknown"),
    [
        (Solver(), '"Solver" is an object of class Solver'),
        (closure(Solver()), '"value" is an object of class Solver'),
        (closure(Solver), '"value" is a class of your own'),
        (evaluated, 'it calls "eval", which may read anything'),
    ],
)
def test_what_cannot_be_hashed_is_named(function: Any, unknown: str) -> None:
    source = function_source(function)
    assert not source.is_known
    assert source.sha256 == ""
    assert source.unknown == unknown


class Odd:
    def __getattr__(self, name: str) -> Any:
        raise KeyError(name)

    def __call__(self, x: float) -> float:
        return x


def test_an_object_that_raises_for_an_attribute_is_unknown() -> None:
    assert function_source(closure(Odd())).unknown == '"value" is an object of class Odd'


def test_nested_code_and_imports_in_it_are_part_of_it() -> None:
    def numbers(x: float) -> Any:
        def inner() -> Any:
            from statistics import mean

            return mean([x])

        return inner()

    assert sha256(numbers)
