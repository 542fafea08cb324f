"""Blocks of code on the pages of the documentation.

A block that is not run has `<!-- not run: reason -->` before it. A block that is a file has
`<!-- file: name -->` before it, or starts with its name in a comment. Commands that end with
another exit code than 0 have `<!-- exit code: 3 -->` before them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]


class Block(NamedTuple):
    """A block of a page."""

    page: Path
    line: int
    language: str
    text: str
    reason: str
    """Why it is not run; empty if it is."""
    file: str
    """The name of the file that it is, if it is one."""
    exit_code: int
    """That of its commands."""

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks_of(page: Path, section: str | None = None) -> Iterator[Block]:
    """Yield the blocks of a page, or those of a section of it, whose text is given."""
    text = page.read_text(encoding="utf-8") if section is None else section
    pattern = r"(?:^<!-- (not run|file|exit code): ([^>]+?) -->\n\n)?^( *)```(\w+)\n(.*?)^ *```$"
    for match in re.finditer(pattern, text, re.MULTILINE | re.DOTALL):
        mark, words, indent, language, body = match.groups(default="")
        body = "".join(line.removeprefix(indent) for line in body.splitlines(keepends=True))
        reason = words if mark == "not run" else ""
        title = re.match(r"# (\w+\.py)\n", body)
        file = words if mark == "file" else title[1] if title else ""
        line = text.count("\n", 0, match.start(4)) + 1
        exit_code = int(words) if mark == "exit code" else 0
        yield Block(page, line, language, body, reason, file, exit_code)
