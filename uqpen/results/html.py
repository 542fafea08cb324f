"""Short HTML of an archive, as a notebook shows it."""

from __future__ import annotations

from html import escape
from itertools import islice

import xarray as xr

from uqpen.archive.read import is_benchmark, model_trees
from uqpen.core.html import html_table
from uqpen.core.labels import RUNS
from uqpen.results.field_texts import field_lines
from uqpen.results.output_tables import statistics_tables

__all__ = ["archive_html"]

# More outputs than these are counted.
_MOST_OUTPUTS = 6


def archive_html(tree: xr.DataTree) -> str:
    """Return the title of an archive and a table for each of its first outputs.

    Nothing that the archive contains is taken as HTML.
    """
    title = f"<p><b>{escape(str(tree.attrs.get('title', '')))}</b></p>"
    if is_benchmark(tree) or not any(
        RUNS in model.children for model in model_trees(tree).values()
    ):
        groups = ", ".join(map(str, tree.children))
        return f"{title}<p>{escape(f'groups: {groups}')}</p>"
    tables = list(statistics_tables(tree))
    shown = [
        html_table(
            [table.title, *table.columns],
            ([label, *cells] for label, cells in table.rows),
            table.notes,
        )
        for table in islice(tables, _MOST_OUTPUTS)
    ]
    more = len(tables) - len(shown)
    lines = [*([f"and {more} more outputs"] if more else []), *map(escape, field_lines(tree))]
    return "\n".join([title, *shown, *(f"<p>{line}</p>" for line in lines)])
