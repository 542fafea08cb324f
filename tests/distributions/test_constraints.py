"""Constraints compare inputs, mind their units, and are never executed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uqpen.core.errors import ConstraintError
from uqpen.distributions.constraints import parse_constraint

UNITS = {"radius": "m", "depth": "m", "speed": "m s-1", "time": "s", "share": "1"}
POINTS = {
    "radius": np.array([1.0, 2.0, 3.0]),
    "depth": np.array([2.0, 2.0, 2.0]),
    "speed": np.array([1.0, 1.0, 2.0]),
    "time": np.array([1.0, 3.0, 1.0]),
    "share": np.array([0.1, 0.5, np.nan]),
}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("radius > depth", [False, False, True]),
        ("radius >= depth", [False, True, True]),
        ("depth < radius", [False, False, True]),
        ("radius < 2.5 * depth / 2", [True, True, False]),
        ("radius < '2500 mm'", [True, True, False]),
        ("speed * time <= depth", [True, False, True]),
        ("radius**2 < depth * radius", [True, False, False]),
        ("-radius > -depth", [True, False, False]),
        ("radius + depth - radius > 0.5 * depth", [True, True, True]),
        ("'1 m' < radius < '3 m'", [False, True, False]),
        ("share < 0.6", [True, True, False]),
        ("share < '60 %'", [True, True, False]),
        ("radius < '2500mm'", [True, True, False]),
        ("radius < depth * depth / (depth - depth)", [False, False, False]),
        ("radius < 1 / 0 * depth", [False, False, False]),
        ("sqrt(radius * depth) < '2.1 m'", [True, True, False]),
        ("max(radius, depth) > min(depth, '1.5 m', radius)", [True, True, True]),
        ("log10(time / '1 s') + exp(0) < 1.2", [True, False, True]),
        ("log((radius - depth) / '1 m') > -1", [False, False, True]),
    ],
)
def test_a_constraint_holds_where_its_comparison_does(text, holds):
    assert parse_constraint(text, UNITS).is_satisfied(POINTS).tolist() == holds


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("radius > speed", "compares m with m s-1"),
        ("radius + time > depth", "compares m with s"),
        ("radius > 3", "compares m with 1"),
        ("radios > depth", 'did you mean "radius"'),
        ("radius", "a comparison of inputs"),
        ("radius > ", "a comparison of inputs"),
        ("radius == depth", "one of <, <=, >, >="),
        ("radius > depth and depth > radius", "a comparison of inputs"),
        ("1 < 2", "names no input"),
        ("radius > '2 frob'", "a quantity"),
        ("radius > True * depth", "a number or a quoted quantity"),
        ("radius ** 99 > depth", "names of inputs"),
        ("radius ** True > depth", "names of inputs"),
        ("radius > " + "9" * 400 + " * depth", "a number or a quoted quantity"),
        ("radius ** share > depth", "names of inputs"),
        ("(" * 220 + "radius" + ")" * 220 + " > depth", "a comparison of inputs"),
        ("radius > " + "depth + " * 500 + "depth", "at most 500"),
    ],
)
def test_what_is_no_constraint_is_refused_in_words(text, complaint):
    with pytest.raises(ConstraintError) as caught:
        parse_constraint(text, UNITS)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true') > 0",
        "radius.__class__ > depth",
        "[radius][0] > depth",
        "(lambda: radius)() > depth",
        "radius if radius else depth > 0",
        "f'{radius}' > depth",
        "(radius := depth) > depth",
    ],
)
def test_nothing_but_arithmetic_is_accepted(text):
    with pytest.raises(ConstraintError):
        parse_constraint(text, UNITS)


@given(st.text(max_size=60))
def test_any_text_is_a_constraint_or_an_error(text):
    try:
        constraint = parse_constraint(text, UNITS)
    except ConstraintError:
        return
    constraint.is_satisfied(POINTS)
