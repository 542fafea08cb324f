"""A figure that knows how it is shown in a notebook, and how it is kept."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from uqpen.figures.figure_file import figure_bytes, save_figure

__all__ = ["Drawing"]


class Drawing(Figure):
    """A figure of matplotlib's, outside of `pyplot`."""

    def save(self, path: str | Path) -> None:
        """Write it to a file that ends in .svg, .pdf or .png; the same bytes each time.

        Raises
        ------
        FigureError
            If the name has another ending, or the file cannot be written.
        """
        save_figure(self, path)

    def _repr_svg_(self) -> str:
        return figure_bytes(self, "svg").decode("utf-8")
