"""Placeholders in a text: ``{rod_length}``, ``{rod_length:.6e}``, and ``{{`` for a brace."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping

from uqpen.core.lookup import choices

__all__ = ["fill", "find_mistakes", "names_in"]

_TOKEN = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}:\n]*)(?::(?P<format>[^{}\n]*))?\}|[{}]")

# Python's formats of floating-point numbers, but for those that depend on the place on Earth, and
# no width that fills a disk.
_FORMAT = re.compile(r"(?:.?[<>=^])?[+\- ]?#?0?[0-9]{0,3}[,_]?(?:\.[0-9]{1,3})?[eEfFgG%]?")

_BRACE = "{name} or {name:.6e}, and {{ or }} for a brace"


def fill(text: str, values: Mapping[str, float | str]) -> str:
    """Replace the placeholders of a text.

    Parameters
    ----------
    text : str
        In which `find_mistakes` finds none.
    values : mapping of str to float or str
        Numbers are written so that reading them gives the same number again, unless the
        placeholder has a format.

    >>> fill("a = {a}; b = {b:.2e}; {{}}", {"a": 0.1, "b": 1234.5})
    'a = 0.1; b = 1.23e+03; {}'
    """

    def replaced(token: re.Match[str]) -> str:
        if token["name"] is None:
            return token[0][0]
        value = values[token["name"]]
        if isinstance(value, str):
            return value
        return format(value, token["format"]) if token["format"] else repr(value)

    return _TOKEN.sub(replaced, text)


def names_in(text: str) -> set[str]:
    """Return the names of a text's placeholders."""
    return {token["name"] for token in _TOKEN.finditer(text) if token["name"] is not None}


def find_mistakes(
    text: str, numbers: Collection[str], paths: Collection[str]
) -> Iterator[tuple[int, str, str]]:
    """Yield the mistakes in the placeholders of a text.

    Parameters
    ----------
    text : str
        Any text.
    numbers, paths : collection of str
        Names of placeholders; those of paths have no format.

    Yields
    ------
    line, found, expected
        Number of the line, from 1; the text there, and the expected one.
    """
    for token in _TOKEN.finditer(text):
        if expected := _expected(token, numbers, paths):
            found = token[0] if len(token[0]) > 1 else f"a single {token[0]}"
            yield text.count("\n", 0, token.start()) + 1, found, expected


def _expected(token: re.Match[str], numbers: Collection[str], paths: Collection[str]) -> str:
    """Return the expected text in place of a placeholder or brace; empty if it is correct."""
    name, form = token["name"], token["format"]
    if name is None:
        return _BRACE if token[0] in "{}" else ""
    if name not in numbers and name not in paths:
        known = choices(name, [*numbers, *paths])
        return f"an input of the model; {known}; {{{{ and }}}} stand for braces"
    if form is not None and name in paths:
        return f"{{{name}}}: a path has no format"
    if form is not None and not _is_format(form):
        return f"a format such as {{{name}:.6e}}"
    return ""


def _is_format(form: str) -> bool:
    try:
        return bool(form and _FORMAT.fullmatch(form) and format(1.5, form))
    except ValueError:
        return False
