"""Names of the headings and charts of a page, for links to them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from uqpen.charts.chart import Block, Chart
from uqpen.report.blocks import Fold, Heading, RunExplorer, flattened

__all__ = ["block_anchors"]

_LONGEST = 60


def block_anchors(sections: Iterable[tuple[str, Iterable[Block]]]) -> dict[int, str]:
    """Return a name for each heading and chart, by the identity of its block.

    A name is made of the section, the headings above, and the title, so it stays the same while the
    page around it changes.

    Parameters
    ----------
    sections : iterable of tuple
        The name of each section, and its blocks.
    """
    found: dict[int, str] = {}
    taken: set[str] = set()
    for section, blocks in sections:
        # Also the name of the section's own heading.
        taken |= {section, f"{section}-title"}
        for block, path in _titled_blocks(blocks):
            name = _unused_name("-".join(filter(None, map(_slug, (section, *path)))), taken)
            taken |= {name, f"{name}-pair"}
            found[id(block)] = name
    return found


def _titled_blocks(blocks: Iterable[Block]) -> Iterator[tuple[Block, tuple[str, ...]]]:
    """Yield headings and charts, each with the headings that it stands below and its own title."""
    above: dict[int, str] = {}
    for block in flattened(blocks):
        if heading := _heading(block):
            level, text = heading
            above = {higher: each for higher, each in above.items() if higher < level}
            above[level] = text
            yield block, tuple(above.values())
        elif isinstance(block, Chart | RunExplorer):
            yield block, (*above.values(), block.title)


def _heading(block: Block) -> tuple[int, str] | None:
    """Return the level and the text of a heading; None of another block."""
    if isinstance(block, Heading):
        return block.level, block.text
    return (block.level, block.title) if isinstance(block, Fold) and block.level else None


def _unused_name(name: str, taken: set[str]) -> str:
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name}-{number}"
    return found


def _slug(text: str) -> str:
    """Return a text in lower case with hyphens, which needs no escape in an address."""
    return "-".join(re.findall(r"[a-z0-9]+", text.lower()))[:_LONGEST].strip("-")
