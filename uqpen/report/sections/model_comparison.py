"""Differences of several models at the same points."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.charts.chart import Block
from uqpen.charts.distributions import model_chart
from uqpen.report.blocks import Heading, Table
from uqpen.report.sections.fields import further_curves
from uqpen.report.sections.main_outputs import main_outputs
from uqpen.results.archive_view import ArchiveView, output_heading
from uqpen.results.output_tables import difference_tables

__all__ = ["model_comparison"]


def model_comparison(view: ArchiveView) -> Iterator[Block]:
    """Curves and distribution functions by each of several models, and the models' differences.

    The first curves and the first main output are on the page already, with the main results.
    """
    if not view.model:
        return
    yield from further_curves(view)
    design = view.leading_design
    first = main_outputs(view)[:1] if design else []
    for output in view.numeric_outputs if design else ():
        chart = model_chart(view, output, design or "")
        if chart is not None and output not in first:
            yield Heading(output_heading(view, output))
            yield chart
    for table in difference_tables(view.archive):
        yield Table(table, is_folded=True)
