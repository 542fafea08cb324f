"""The outputs that a page is about, and which of its parts are open."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from uqpen.charts.chart import Block
from uqpen.report.blocks import Fold, Heading
from uqpen.report.sections.quoted_statistics import requested_statistics
from uqpen.results.archive_view import ArchiveView, output_heading, output_title
from uqpen.results.texts import plain_text

__all__ = ["main_outputs", "ordered_outputs", "output_blocks"]

# Outputs whose parts are open, at the most.
_MOST = 3


def ordered_outputs(view: ArchiveView, design: str) -> list[str]:
    """All outputs, those with requested statistics first, and categorical ones last."""
    numbers = sorted(
        view.numeric_outputs, key=lambda output: not requested_statistics(view, output, design)
    )
    return [*numbers, *view.categorical_outputs]


def main_outputs(view: ArchiveView) -> list[str]:
    """Return the outputs that the study asks about; if it asks about none, the first."""
    every = [*view.numeric_outputs, *view.categorical_outputs]
    design = view.leading_design
    if design is None:
        return every[:1]
    asked = [each for each in view.numeric_outputs if requested_statistics(view, each, design)]
    return asked[:_MOST] or every[:1]


def output_blocks(
    view: ArchiveView, blocks: Mapping[str, Iterable[Block]], most: int = _MOST
) -> Iterator[Block]:
    """Yield the blocks of each output under its heading; those of all but the main ones folded.

    Parameters
    ----------
    blocks : mapping
        By output; one without blocks is left out.
    most : int
        Outputs that are open, at the most.
    """
    filled = {output: found for output, each in blocks.items() if (found := tuple(each))}
    main = [output for output in main_outputs(view) if output in filled][:most]
    for output in main:
        yield from (Heading(output_heading(view, output)), *filled[output])
    others = {output: found for output, found in filled.items() if output not in main}
    if not others:
        return
    titles = ", ".join(output_title(view, output) for output in others)
    yield Fold(
        f"Other outputs: {plain_text(titles, 120)}",
        tuple(
            block
            for output, found in others.items()
            for block in (Heading(output_heading(view, output)), *found)
        ),
    )
