"""How figures look: the same on every machine, to every kind of colour vision, and in grey."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from uqpen.core.errors import FigureError

__all__ = [
    "BLACK",
    "BLUE",
    "GREY",
    "VERMILION",
    "SourceStyle",
    "figure_style",
    "require_matplotlib",
    "source_style",
]

# Told apart by every kind of colour vision (Okabe & Ito, 2008); without the yellow, which is too
# light for a line on white.
BLUE, VERMILION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#aa4499"
SKY, ORANGE, BLACK, GREY = "#56b4e9", "#e69f00", "#000000", "#666666"
WINE, OLIVE = "#882255", "#707010"

_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, BLACK, WINE, ORANGE, OLIVE, SKY, GREY)
_MARKERS = ("o", "s", "^", "D", "v", "p", "h", "d", "<", ">")
_LINES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1, 1)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (3, 1)),
    (0, (6, 1, 1, 1, 1, 1)),
    (0, (2, 2)),
    (0, (8, 2, 2, 2)),
    (0, (1, 2.5)),
    (0, (4, 1, 1, 1)),
)

_SETTINGS: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.labelsize": 8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 8.5,
    "figure.dpi": 110,
    "figure.titlesize": 9,
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.title_fontsize": 7,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "path.simplify": True,
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
    "svg.fonttype": "path",
    "svg.hashsalt": "uqpen",
    # Titles are texts: a dollar is a dollar.
    "text.parse_math": False,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
}


@dataclass(frozen=True)
class SourceStyle:
    """How what belongs to one source is drawn; a colour alone tells nothing in grey.

    Attributes
    ----------
    colour, marker : str
    line : str or tuple
        The pattern of its dashes.
    """

    colour: str
    marker: str
    line: Any


def source_style(position: int) -> SourceStyle:
    """The look of the source at a position among those of an archive."""
    return SourceStyle(
        _COLOURS[position % len(_COLOURS)],
        _MARKERS[position % len(_MARKERS)],
        _LINES[position % len(_LINES)],
    )


def require_matplotlib() -> Any:
    """The package that draws.

    Raises
    ------
    FigureError
        If it is not installed.
    """
    try:
        import matplotlib.style
    except ModuleNotFoundError:
        raise FigureError(
            'figures take matplotlib, which is not installed; "pip install uqpen[figures]" does it'
        ) from None
    return matplotlib


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the style of these figures, whatever the settings are outside, which come back."""
    with require_matplotlib().style.context(["default", _SETTINGS]):
        yield
