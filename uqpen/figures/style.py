"""The style of figures: the same on every machine, for all colour vision, and in grey."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from uqpen.core.errors import FigureError

__all__ = ["figure_style", "require_matplotlib"]

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


def require_matplotlib() -> Any:
    """Return matplotlib; a `FigureError` says that it is not installed."""
    try:
        import matplotlib.style
    except ModuleNotFoundError:
        raise FigureError(
            'figures take matplotlib, which is not installed; "pip install uqpen[figures]" does it'
        ) from None
    return matplotlib


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the style of these figures, and restore the outside settings afterwards."""
    with require_matplotlib().style.context(["default", _SETTINGS]), warnings.catch_warnings():
        # A character that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph", UserWarning)
        yield
