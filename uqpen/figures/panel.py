"""A panel of a figure: a title, and a function that draws the rest onto axes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from uqpen.figures.style import figure_style
from uqpen.results.texts import plain_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:  # matplotlib is only there where figures are drawn
    Axes = Any

__all__ = ["LONGEST_ROW", "Axes", "Panel"]

# Characters of a row's name that are shown.
LONGEST_ROW = 28


@dataclass(frozen=True)
class Panel:
    """A part of a figure that can be drawn onto axes.

    Parameters
    ----------
    title : str
        Plain text, above the axes.
    draw : callable
        Draws onto axes, and returns notes for the reader.
    height : float
        In inches.
    rows : tuple of str
        Names along the vertical axis, in place of numbers.
    group : str
        Panels of another group begin a row of their own, if any group has several.
    """

    title: str
    draw: Callable[[Axes], Iterable[str]]
    height: float = 2.5
    rows: tuple[str, ...] = ()
    group: str = ""

    def draw_on_axes(self, axes: Axes) -> tuple[str, ...]:
        """Draw onto axes of the caller's own, and return the notes below the figure."""
        from matplotlib.text import Text

        with figure_style():
            axes.set_title(plain_text(self.title))
            if self.rows:
                names = [plain_text(row, LONGEST_ROW) for row in self.rows]
                axes.set_yticks(range(len(names)), names)
                axes.set_ylim(len(self.rows) - 0.5, -0.5)
                axes.tick_params(axis="y", length=0)
                axes.grid(visible=False, axis="y")
            notes = tuple(self.draw(axes))
            for text in axes.findobj(Text):
                text.set_parse_math(False)
        return notes
