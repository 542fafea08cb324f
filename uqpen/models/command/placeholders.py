"""Placeholders in a text: ``{rod_length}``, ``{rod_length:.6e}``, and ``{{`` for a brace.

With other delimiters, ``<<rod_length>>``, nothing stands for a delimiter: what is no name between
two of them is a part of the text.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from uqpen.core.lookup import choices

__all__ = ["BRACES", "Delimiters", "NotWholeError", "fill", "find_mistakes", "names_in"]

_IN_BRACES = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}:\n]*)(?::(?P<format>[^{}\n]*))?\}|[{}]")

# Python's formats of floating-point numbers, but for those that depend on the place on Earth, and
# no width that fills a disk; and of whole numbers.
_FORMAT = re.compile(r"(?:.?[<>=^])?[+\- ]?#?0?[0-9]{0,3}[,_]?(?:(?:\.[0-9]{1,3})?[eEfFgG%]?|d)")

_BRACE = "{name} or {name:.6e}, and {{ or }} for a brace"


class NotWholeError(ValueError):
    """A number with a format of whole numbers is none; the message is the reason of the run."""


@dataclass(frozen=True)
class Delimiters:
    """Delimiters of placeholders; braces within the text are only doubled where they are them."""

    opening: str = "{"
    closing: str = "}"

    @property
    def tokens(self) -> re.Pattern[str]:
        """Pattern of a placeholder, and of braces where they are the delimiters."""
        if self == BRACES:
            return _IN_BRACES
        opening, closing = re.escape(self.opening), re.escape(self.closing)
        return re.compile(rf"{opening}(?P<name>[^\W\d]\w*)(?::(?P<format>[^\n]*?))?{closing}")

    def around(self, placeholder: str) -> str:
        """Return a placeholder as it is written."""
        return f"{self.opening}{placeholder}{self.closing}"


BRACES = Delimiters()


def fill(text: str, values: Mapping[str, float | str], delimiters: Delimiters = BRACES) -> str:
    """Replace the placeholders of a text.

    Parameters
    ----------
    text : str
        In which `find_mistakes` finds none.
    values : mapping of str to float or str
        Numbers are written so that reading them gives the same number again, unless the
        placeholder has a format.
    delimiters : Delimiters
        Those of its placeholders.

    Raises
    ------
    NotWholeError
        If a number has a format of whole numbers, and is none.

    >>> fill("a = {a}; b = {b:.2e}; {{}}", {"a": 0.1, "b": 1234.5})
    'a = 0.1; b = 1.23e+03; {}'
    """

    def replaced(token: re.Match[str]) -> str:
        if token["name"] is None:
            return token[0][0]
        value = values[token["name"]]
        if isinstance(value, str):
            return value
        form = token["format"] or ""
        if not form.endswith("d"):
            return format(value, form) if form else repr(value)
        if not value.is_integer():
            raise NotWholeError(f"{token[0]} is {value!r}, which is no whole number")
        return format(int(value), form)

    return delimiters.tokens.sub(replaced, text)


def names_in(text: str, delimiters: Delimiters = BRACES) -> set[str]:
    """Return the names of a text's placeholders."""
    tokens = delimiters.tokens.finditer(text)
    return {token["name"] for token in tokens if token["name"] is not None}


def find_mistakes(
    text: str,
    numbers: Collection[str],
    paths: Collection[str],
    delimiters: Delimiters = BRACES,
) -> Iterator[tuple[int, str, str]]:
    """Yield the mistakes in the placeholders of a text.

    Parameters
    ----------
    text : str
        Any text.
    numbers, paths : collection of str
        Names of placeholders; those of paths have no format.
    delimiters : Delimiters
        Those of its placeholders.

    Yields
    ------
    line, found, expected
        Number of the line, from 1; the text there, and the expected one.
    """
    for token in delimiters.tokens.finditer(text):
        if expected := _expected(token, numbers, paths, delimiters):
            found = token[0] if len(token[0]) > 1 else f"a single {token[0]}"
            yield text.count("\n", 0, token.start()) + 1, found, expected


def _expected(
    token: re.Match[str], numbers: Collection[str], paths: Collection[str], delimiters: Delimiters
) -> str:
    """Return the expected text in place of a placeholder or brace; empty if it is correct."""
    name, form = token["name"], token["format"]
    if name is None:
        return _BRACE if token[0] in "{}" else ""
    if name not in numbers and name not in paths:
        known = choices(name, [*numbers, *paths])
        braces = "; {{ and }} stand for braces" if delimiters == BRACES else ""
        return f"an input of the model; {known}{braces}"
    if form is not None and name in paths:
        return f"{delimiters.around(name)}: a path has no format"
    if form is not None and not _is_format(form):
        return f"a format such as {delimiters.around(f'{name}:.6e')}"
    return ""


def _is_format(form: str) -> bool:
    try:
        return bool(
            form and _FORMAT.fullmatch(form) and format(1 if form[-1] == "d" else 1.5, form)
        )
    except ValueError:
        return False
