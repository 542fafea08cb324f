"""User-defined sections: functions that yield blocks, beside those of the package."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from uqpen.charts.chart import Block
from uqpen.core.errors import ReportError
from uqpen.models.user_module import FunctionFamily, UserDefinedFunction
from uqpen.report import SECTIONS, ReportSection
from uqpen.results.archive_view import ArchiveView

__all__ = ["SectionFunction", "UserDefinedSection", "find_sections"]

SectionFunction = Callable[[ArchiveView], Iterable[Block]]

_SECTION = FunctionFamily(
    {name: section.function for name, section in SECTIONS.items()},
    "uqpen.sections",
    "section",
    "my_section.py:my_section",
    ReportError,
)


class UserDefinedSection(NamedTuple):
    """User-defined section.

    Attributes
    ----------
    name : str
        The name that links have.
    function : UserDefinedFunction
        Takes an `ArchiveView`, and yields blocks.
    """

    name: str
    function: UserDefinedFunction

    @property
    def section(self) -> ReportSection:
        """Entry of the page's contents, from the function's docstring."""
        function = self.function
        title = function.title.removesuffix(".")
        return ReportSection(title, function.introduction, function.reference)

    def blocks(self, view: ArchiveView) -> list[Block]:
        """Return its blocks for a part of an archive.

        Raises
        ------
        ReportError
            If the function fails, or yields something else.
        """
        with self.function.in_context():
            found = list(self.function.function(view))
        for block in found:
            if not isinstance(block, Block):
                text = f"it yields an object of class {type(block).__name__}, not a Block"
                raise self.function.failure(text)
        return found


def find_sections(named: Sequence[str | SectionFunction]) -> list[UserDefinedSection]:
    """Return the sections with names or references, in their order.

    Parameters
    ----------
    named : sequence of str or callable
        Each is the name of an installed section; or a reference to a function, relative to the
        current folder; or the function itself.

    Raises
    ------
    UnknownNameError
        If there is no such section.
    ReportError
        If a function cannot be loaded, or a section of the page is asked for again.
    """
    for each in named:
        if isinstance(each, str) and each in SECTIONS:
            raise ReportError(f'the section "{each}" is on every page already')
    functions = [_SECTION.find(each, Path.cwd()) for each in named]
    return [
        UserDefinedSection(f"own-{number}", function)
        for number, function in enumerate(functions, 1)
    ]
