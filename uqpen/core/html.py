"""Tables as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def html_table(
    head: Sequence[str], rows: Iterable[Sequence[str]], notes: Sequence[str] = ()
) -> str:
    """Return a table with numbered notes below it; every text is escaped."""
    cells = "".join(f"<th>{escape(text)}</th>" for text in head)
    body = "\n".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows
    )
    listed = "".join(f"<li>{escape(note)}</li>" for note in notes)
    below = f"<ol>{listed}</ol>" if listed else ""
    return f"<table><thead><tr>{cells}</tr></thead>\n<tbody>\n{body}\n</tbody></table>{below}"
