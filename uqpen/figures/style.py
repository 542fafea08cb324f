"""Style of figures: the same on every machine, and the same bytes in a file each time."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqpen.core.errors import FigureError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The style of figures: the same on every machine, for all colour vision, and in grey.

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
            'figures take matplotlib, which is not installed; "pip install matplotlib" does it'
        ) from None
    return matplotlib


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the style of these figures, and restore the outside settings afterwards."""
    with require_matplotlib().style.context(["default", _SETTINGS]), warnings.catch_warnings():
        # A character that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph", UserWarning)
        yield


# A figure as the bytes of a file, the same each time.

# Metadata of a file: no time, no version.
FORMATS: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": "uqpen"},
    "pdf": {"CreationDate": None, "Creator": "uqpen", "Producer": None},
    "png": {"Software": None},
}


def figure_format(path: Path) -> str:
    """Return the format that a file's name ends in; a `FigureError` if it is none of `FORMATS`."""
    kind = path.suffix.removeprefix(".").lower()
    if kind not in FORMATS:
        known = ", ".join(f".{each}" for each in FORMATS)
        raise FigureError(f"{path}: found the ending {path.suffix or 'none'}; expected {known}")
    return kind


def figure_bytes(page: Figure, kind: str) -> bytes:
    """Return a figure as the bytes of a file of one of the `FORMATS`."""
    stream = io.BytesIO()
    with figure_style():
        page.savefig(stream, format=kind, metadata=FORMATS[kind])
    return stream.getvalue()
