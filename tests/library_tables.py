"""The table of chaospy's distributions in the documentation, as chaospy has them.

`python tests/library_tables.py` writes it into docs/libraries.md.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from uqpen.distributions.frozen import frozen_families

PAGE = Path(__file__).parents[1] / "docs" / "libraries.md"
_MARK = "<!-- distributions: written by tests/library_tables.py -->\n"


def distributions_table() -> str:
    """Return a table with a row for each distribution, with its parameters and their defaults."""
    lines = ["| name | parameters, with their defaults |", "|---|---|"]
    for name, family in sorted(frozen_families("chaospy").items()):
        parameters = inspect.signature(family).parameters.values()
        shown = ", ".join(
            f"`{each.name}`" + ("" if each.default is each.empty else f" ({each.default:g})")
            for each in parameters
            if each.default is each.empty or isinstance(each.default, int | float)
        )
        lines.append(f"| `{name}` | {shown} |")
    return "\n" + "\n".join(lines) + "\n"


def with_table(page: str) -> str:
    """Return the text of the page with the table."""
    between = re.compile(f"(?<={re.escape(_MARK)})(?:\n\\|(?:.*\\|\n)*)?")
    assert len(between.findall(page)) == 1
    return between.sub(lambda _: distributions_table(), page)


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
