"""A figure that notebooks show, and that can be written to a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.transforms import Bbox

from uqpen.core.errors import FigureError
from uqpen.core.files import replace_file
from uqpen.figures.style import figure_bytes, figure_format

# Digits of a place on the page, as a part of its width or height.
_DIGITS = 9


class RoundedLayout(ConstrainedLayoutEngine):
    """Layout by constraints, in which places have no digits beyond those that can be seen.

    The solver adds in the order of addresses in memory, so the last digits differ from time to
    time. Identifiers in a file are made of all digits.
    """

    def execute(self, fig: Figure) -> None:
        """Lay out a figure, and round the place of each of its axes."""
        super().execute(fig)
        for axes in fig.axes:
            corners = axes.get_position(original=True).get_points()
            axes.set_position(Bbox(np.round(corners, _DIGITS)))
            # A place that is set by hand is left alone by the next layout.
            axes.set_in_layout(True)


class Drawing(Figure):
    """A figure of matplotlib's, outside of `pyplot`."""

    def save(self, path: str | Path) -> None:
        """Write it to a file that ends in .svg, .pdf or .png; the same bytes each time.

        A file of that name is replaced in one step, once the figure is complete.

        Raises
        ------
        FigureError
            If the name has another ending, or the file cannot be written.
        """
        path = Path(path)
        content = figure_bytes(self, figure_format(path))
        try:
            replace_file(path, content)
        except OSError as error:
            raise FigureError(f"{path}: cannot be written: {error.strerror}") from None

    def _repr_svg_(self) -> str:
        return figure_bytes(self, "svg").decode("utf-8")
