"""Findings about archives as a person reads them, on a screen of any width."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from uqpen.cli.console import standard_output
from uqpen.cli.printable import screen_text
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.diff import DiffSection

__all__ = ["show_check", "show_section"]

_COLUMN = 13
_INDENT = "  "

_STYLES = {
    CheckOutcome.DIFFERENT: "bold red",
    CheckOutcome.IMPOSSIBLE: "bold red",
    CheckOutcome.CLOSE: "yellow",
}


def show_check(result: CheckResult) -> None:
    """Show a check with its result, and the differences below."""
    console = standard_output()
    head = f"{result.name:<{_COLUMN}}{result.text}"
    _show(console, head, " " * _COLUMN, _STYLES.get(result.verdict, ""))
    _show_lines(console, result.details)


def show_section(section: DiffSection) -> None:
    """Show the differences of one kind, under its name."""
    console = standard_output()
    console.print(Text(section.name, style="bold"))
    if not section.verbatim:
        _show_lines(console, section.lines)
        return
    for line in section.lines:
        text = Text(f"{_INDENT}{screen_text(line)}")
        text.truncate(console.width - 1, overflow="ellipsis")
        console.print(text, soft_wrap=True)


def _show_lines(console: Console, lines: Sequence[str]) -> None:
    for line in lines:
        # A message of several lines has an indentation of its own, which is kept.
        text = line.lstrip(" ")
        margin = _INDENT + line[: len(line) - len(text)]
        _show(console, f"{margin}{text}", f"{margin}{_INDENT}", "")


def _show(console: Console, text: str, indent: str, style: str) -> None:
    wrapped = textwrap.wrap(screen_text(text), console.width - 1, subsequent_indent=indent)
    for line in wrapped or [""]:
        console.print(Text(line, style=style), soft_wrap=True)
