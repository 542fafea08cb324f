"""Convergence of estimates as runs are added."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile

from uqpen.charts.chart import Block
from uqpen.charts.convergence_history import convergence_charts
from uqpen.report.blocks import Heading, Remarks, Text
from uqpen.results.archive_view import ArchiveView, output_heading

__all__ = ["convergence"]

# Outputs that are drawn.
_MOST_OUTPUTS = 6


def convergence(view: ArchiveView) -> Iterator[Block]:
    """Estimates of the leading design from growing parts of its runs."""
    design = view.leading_design
    if design is None:
        return
    outputs = [*view.numeric_outputs, *view.categorical_outputs]
    shown = outputs[:_MOST_OUTPUTS]
    found = list(takewhile(lambda each: each.charts[0].of in shown, convergence_charts(view)))
    if not found:
        reason = view.design(design).reason_without_convergence
        reason = reason or "the archive has no estimates from parts of its runs"
        yield Text(
            f"Convergence cannot be shown for {design}, the design of the main results: {reason}."
        )
        return
    sentence, *remarks = found[0].notes
    yield Text(sentence)
    yield Remarks("How to read it", tuple(remarks))
    for each in found:
        yield Heading(output_heading(view, each.charts[0].of))
        yield replace(each, notes=())
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Left out, as there are many outputs: {', '.join(left)}.")
