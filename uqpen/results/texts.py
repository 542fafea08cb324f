"""Texts of an archive for figures and tables: plain, short, with typeset units."""

from __future__ import annotations

import re
from collections.abc import Sequence

from uqpen.core.units import DIMENSIONLESS
from uqpen.results.digits import typeset_unit

__all__ = [
    "capitalized",
    "join_names",
    "plain_text",
    "title_with_name",
    "title_with_unit",
    "typeset_quantity",
    "unit_suffix",
]

_LONGEST = 80

_WORD = re.compile(r"\w+")


def capitalized(text: str) -> str:
    """A text with a capital, as at the start of a sentence; a symbol stays as it is.

    >>> capitalized("depth of penetration, median"), capitalized("y, median")
    ('Depth of penetration, median', 'y, median')
    """
    first = _WORD.match(text)
    if first is None or len(first[0]) == 1 or not first[0].isalpha():
        return text
    return f"{text[0].upper()}{text[1:]}"


def join_names(names: Sequence[str]) -> str:
    """Names as a sentence lists them."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def plain_text(text: str, longest: int = _LONGEST) -> str:
    """A text in one line, its control characters spelled out, and cut where it is too long."""
    shown = "".join(
        character
        if character.isprintable()
        else character.encode("unicode_escape", "replace").decode("ascii")
        for character in text.replace("\u202f", " ")
    )
    return shown if len(shown) <= longest else f"{shown[: longest - 1]}…"


def typeset_quantity(text: str) -> str:
    """Return a quantity as written, with its unit typeset.

    >>> typeset_quantity("70 degC"), typeset_quantity("1e-3 m2"), typeset_quantity("10")
    ('70 °C', '1e-3 m²', '10')
    """
    number, space, unit = text.partition(" ")
    return f"{number}{space}{typeset_unit(unit)}"


def title_with_name(title: str, name: str) -> str:
    """A title and, in brackets, the name that a study gives it, unless that says the same.

    >>> title_with_name("wall heat flux", "wall_heat_flux"), title_with_name("depth", "h")
    ('wall heat flux', 'depth (h)')
    """
    return title if title.replace(" ", "_") == name else f"{title} ({name})"


def unit_suffix(unit: str) -> str:
    """Return the text behind a number: a space and its unit, if it has one.

    >>> unit_suffix("kg m-3"), unit_suffix("1")
    (' kg m⁻³', '')
    """
    return "" if unit == DIMENSIONLESS else f" {plain_text(typeset_unit(unit), 30)}"


def title_with_unit(title: str, unit: str) -> str:
    """Return the title of an axis: a quantity and, in brackets, its unit, if it has one."""
    head = plain_text(title, 50)
    return head if unit == DIMENSIONLESS else f"{head} [{plain_text(typeset_unit(unit), 30)}]"
