"""The tables of statistics in the documentation, as the records of the catalogue give them.

`python tests/catalogue_tables.py` writes them into docs/archive.md.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from pathlib import Path

from uqpen.core.catalogue import (
    BOUND_STATISTICS,
    CATALOGUE,
    DIMENSIONS,
    JOINT_STATISTICS,
    VALIDATION_STATISTICS,
)
from uqpen.core.statistic import Statistic

PAGE = Path(__file__).parents[1] / "docs" / "archive.md"
# Each table stands between two such lines, by the name of its records.
_MARK = "<!-- {name}: from the records of uqpen/core/catalogue.py -->\n"
TABLES = {
    "statistics": CATALOGUE,
    "joint statistics": JOINT_STATISTICS,
    "bound statistics": BOUND_STATISTICS,
    "validation statistics": VALIDATION_STATISTICS,
}


def statistics_table(statistics: Iterable[Statistic]) -> str:
    """Return a table with a row for neighbours along the same dimensions."""
    lines = ["| variables | along |", "|---|---|"]
    for (dims, _), group in itertools.groupby(statistics, lambda each: (each.dims, each.prefix)):
        named = "; ".join(f"`{each.name}`: {each.title}" for each in group)
        names = [[name, *DIMENSIONS[name].companions, *DIMENSIONS[name].optional] for name in dims]
        along = "; ".join(", ".join(f"`{each}`" for each in of) for of in names)
        lines.append(f"| {named} | {along} |".replace("|  |", "| |"))
    return "\n".join(lines) + "\n"


def with_tables(page: str) -> str:
    """Return the text of a page with the tables that the records give."""
    for name, records in TABLES.items():
        mark = _MARK.format(name=name)
        between = re.compile(f"(?<={re.escape(mark)})(?:\\|.*\n)*")
        assert len(between.findall(page)) == 1, name
        table = statistics_table(records.values())
        page = between.sub(lambda _, table=table: table, page)
    return page


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
