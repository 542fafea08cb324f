"""Columns of a table whose columns are separated by blanks, as gnuplot and many programs write."""

from __future__ import annotations

__all__ = ["blank_column"]

# Lines that begin so are comments; the first one may have the headings.
_COMMENT = ("#", "%", "!", "*")


def blank_column(content: str, column: str | int) -> list[str | None] | None:
    """Return a column of a table, which is given by its heading or its position.

    Only a table with headings has them in its first line, which may be a comment.

    Returns
    -------
    list of str or None
        The entries; None where a row is too short. None if there is no such heading.
    """
    lines = [line.strip() for line in content.splitlines() if line.strip()]
    position = column
    if isinstance(position, str):
        headings = lines[0].lstrip("".join(_COMMENT)).split() if lines else []
        if position not in headings:
            return None
        position, lines = headings.index(position), lines[1:]
    rows = [line.split() for line in lines if not line.startswith(_COMMENT)]
    return [row[position] if -len(row) <= position < len(row) else None for row in rows]
