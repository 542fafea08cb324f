"""Colour, marker and dashes of each source: the same in figures and on the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["BLACK", "BLUE", "GREY", "STYLES", "VERMILION", "SourceStyle", "source_style"]

# Distinct to every kind of colour vision (Okabe & Ito, 2008); without the yellow, which is too
# light for a line on white.
BLUE, VERMILION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#aa4499"
SKY, ORANGE, BLACK, GREY = "#56b4e9", "#e69f00", "#000000", "#666666"
WINE, OLIVE = "#882255", "#707010"

# Number of styles that differ.
STYLES = 10

_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, BLACK, WINE, ORANGE, OLIVE, SKY, GREY)
_MARKERS = ("o", "s", "^", "D", "v", "p", "P", "d", "<", ">")
_LINES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1, 1)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (3, 1)),
    (0, (6, 1, 1, 1, 1, 1)),
    (0, (2, 2)),
    (0, (8, 2, 2, 2)),
    (0, (1, 2.5)),
    (0, (4, 1, 1, 1)),
)


@dataclass(frozen=True)
class SourceStyle:
    """The style of one source in figures; a colour alone cannot be recognised in grey.

    The line is the pattern of its dashes.
    """

    colour: str
    marker: str
    line: Any


def source_style(position: int) -> SourceStyle:
    """Return the style at a place, that of a source (`source_slots`) or another number."""
    return SourceStyle(
        _COLOURS[position % len(_COLOURS)],
        _MARKERS[position % len(_MARKERS)],
        _LINES[position % len(_LINES)],
    )
