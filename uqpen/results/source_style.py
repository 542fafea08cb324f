"""Colour, marker and dashes of each source: the same in figures and on the page of a study."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from uqpen.core.errors import StudyError
from uqpen.study.document import parse_document

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

_SURROGATE, _PUBLICATION = "surrogate", "publication"

# The place of the first source of a kind, if no other source has it.
_PLACES = MappingProxyType(
    {
        "monte-carlo": 0,
        "latin-hypercube": 1,
        "sobol-sequence": 2,
        "saltelli": 3,
        "morris": 4,
        "one-at-a-time": 5,
        "halton": 6,
        "quadrature": 6,
        _SURROGATE: 7,
        _PUBLICATION: 8,
        "full-factorial": 9,
        "table": 9,
    }
)
# Places of further sources, in turn; first those of kinds that are rare.
_SPARE = (6, 9, 8, 7, 5, 4, 3, 2, 1, 0)


@dataclass(frozen=True)
class SourceStyle:
    """The style of one source in figures; a colour alone cannot be recognised in grey.

    The line is the pattern of its dashes.
    """

    colour: str
    marker: str
    line: Any


_STYLES = tuple(map(SourceStyle, _COLOURS, _MARKERS, _LINES))


def source_style(position: int) -> SourceStyle:
    """Return the style at a place, that of a source (`source_slots`) or another number."""
    return _STYLES[position % STYLES]


def source_slots(study_text: str, sources: Iterable[str]) -> dict[str, int]:
    """Return the place of each source of a study among colours and markers.

    The study's text decides, so a source looks the same on all pages and figures of its study, and
    the first design of a kind the same in all studies. A text that cannot be read names no source;
    `sources` need a place also if the text does not name them.
    """
    kinds = dict(_kind_by_source(study_text))
    kinds |= {source: "" for source in sources if source not in kinds}
    found: dict[str, int] = {}
    for source, kind in kinds.items():
        place = _PLACES.get(kind)
        if place is not None and place not in found.values():
            found[source] = place
    spare = [place for place in _SPARE if place not in found.values()]
    others = [source for source in kinds if source not in found]
    for number, source in enumerate(others):
        found[source] = spare[number] if number < len(spare) else number % STYLES
    return found


@lru_cache(maxsize=4)
def _kind_by_source(text: str) -> Mapping[str, str]:
    """Return the kind of each source that a study names, in its order."""
    found: dict[str, str] = {}
    try:
        content = parse_document(text, "study").content
    except StudyError:
        return found
    for section, kind in (("designs", ""), ("surrogates", _SURROGATE), ("published", _PUBLICATION)):
        tables = content.get(section)
        for name, table in tables.items() if isinstance(tables, dict) else ():
            if isinstance(table, dict):
                found[str(name)] = kind or str(table.get("kind", ""))
    return found
