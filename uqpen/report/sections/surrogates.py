"""Accuracy of surrogates in independent runs."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.archive.read import group_names
from uqpen.charts.chart import Block
from uqpen.charts.surrogate import prediction_charts
from uqpen.core.labels import SURROGATES
from uqpen.report.blocks import Heading, Table, Text
from uqpen.results.archive_view import ArchiveView
from uqpen.results.surrogate_tables import correction_tables, fit_table, missing_run_tables
from uqpen.surrogates.archived_surrogate import is_restorable

__all__ = ["surrogates"]


def surrogates(view: ArchiveView) -> Iterator[Block]:
    """Yield the accuracy of surrogates in independent runs."""
    for name in group_names(view.tree, SURROGATES):
        made = view.tree.children[SURROGATES].children[name]
        yield Heading(name)
        yield Table(fit_table(name, made))
        if not is_restorable(made):
            yield Text(f"{made.attrs['kind']} is not executed here, so no predictions are shown.")
        elif charts := prediction_charts(view, name):
            yield charts
        for tables in (correction_tables, missing_run_tables):
            for table in tables(view.tree, name):
                yield Table(table)
