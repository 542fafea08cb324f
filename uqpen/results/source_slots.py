"""Place of each source among colours and markers: by its kind, the same for all of a study."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from uqpen.core.errors import StudyError
from uqpen.results.source_style import STYLES
from uqpen.study.document import parse_document

__all__ = ["source_slots"]

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


def source_slots(study_text: str, sources: Iterable[str]) -> dict[str, int]:
    """Return the place of each source of a study among colours and markers.

    The study's text decides, so a source looks the same on all pages and figures of its study, and
    the first design of a kind the same in all studies.

    Parameters
    ----------
    study_text : str
        Of an archive. A text that cannot be read names no source.
    sources : iterable of str
        Those that need a place, also if the text does not name them.
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
    try:
        content = parse_document(text, "study").content
    except StudyError:
        return {}
    return dict(_source_and_kind(content))


def _source_and_kind(content: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name, design in _tables(content, "designs"):
        yield name, str(design.get("kind", ""))
    for section, kind in (("surrogates", _SURROGATE), ("published", _PUBLICATION)):
        for name, _ in _tables(content, section):
            yield name, kind


def _tables(content: Mapping[str, Any], section: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    found = content.get(section)
    for name, table in found.items() if isinstance(found, dict) else ():
        if isinstance(table, dict):
            yield str(name), table
