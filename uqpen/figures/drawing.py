"""A figure that notebooks show, and that can be written to a file."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from uqpen.core.errors import FigureError
from uqpen.core.files import replace_file
from uqpen.figures.figure_file import figure_bytes, figure_format

__all__ = ["Drawing"]


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
