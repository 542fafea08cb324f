"""Short HTML of an archive, as a notebook shows it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import islice

import xarray as xr

from uqpen.archive.read import model_trees
from uqpen.core.labels import KIND, RUNS
from uqpen.results.output_tables import statistics_table
from uqpen.results.table import OutputTable, first_runs, output_names

__all__ = ["archive_html", "table_html"]

# More outputs than these are counted.
_MOST_OUTPUTS = 6


def archive_html(tree: xr.DataTree) -> str:
    """Return the title of an archive and a table for each of its first outputs.

    Nothing that the archive contains is taken as HTML.
    """
    title = f"<p><b>{escape(str(tree.attrs.get('title', '')))}</b></p>"
    if KIND in tree.attrs or not any(
        RUNS in model.children for model in model_trees(tree).values()
    ):
        groups = ", ".join(map(str, tree.children))
        return f"{title}<p>{escape(f'groups: {groups}')}</p>"
    tables = list(_statistics_tables(tree))
    shown = [
        table_html(table.title, table.columns, table.rows, table.notes)
        for table in islice(tables, _MOST_OUTPUTS)
    ]
    more = len(tables) - len(shown)
    return "\n".join([title, *shown, *([f"<p>and {more} more outputs</p>"] if more else [])])


def table_html(
    title: str,
    columns: Sequence[str],
    rows: Sequence[tuple[str, Sequence[str]]],
    notes: Sequence[str] = (),
) -> str:
    """Return a table with a heading for each column, and its numbered notes below it."""
    head = "".join(f"<th>{escape(text)}</th>" for text in [title, *columns])
    body = "\n".join(
        f"<tr><th>{escape(label)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for label, cells in rows
    )
    listed = "".join(f"<li>{escape(note)}</li>" for note in notes)
    below = f"<ol>{listed}</ol>" if listed else ""
    return f"<table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>{below}"


def _statistics_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        first = first_runs(model)
        for output in output_names(first):
            table = statistics_table(model, output, first[output].attrs)
            if table is not None:
                table.title = head + table.title
                yield table
