"""A figure as a file: whole, under its own name, or not at all; the same bytes each time."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqpen.core.errors import FigureError
from uqpen.core.files import replace_file
from uqpen.figures.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FORMATS", "figure_bytes", "figure_format", "save_figure"]

# What a file says of itself; no time, no version.
FORMATS: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": "uqpen"},
    "pdf": {"CreationDate": None, "Creator": "uqpen", "Producer": None},
    "png": {"Software": None},
}


def figure_format(path: Path) -> str:
    """Return the format that the end of a file's name states.

    Raises
    ------
    FigureError
        If it is none of `FORMATS`.
    """
    kind = path.suffix.removeprefix(".").lower()
    if kind not in FORMATS:
        known = ", ".join(f".{each}" for each in FORMATS)
        raise FigureError(f"{path}: found the ending {path.suffix or 'none'}; expected {known}")
    return kind


def figure_bytes(page: Figure, kind: str) -> bytes:
    """A figure as the bytes of a file.

    Parameters
    ----------
    page : Figure
    kind : str
        One of `FORMATS`.
    """
    stream = io.BytesIO()
    with figure_style(), warnings.catch_warnings():
        # A character that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph", UserWarning)
        page.savefig(stream, format=kind, metadata=FORMATS[kind])
    return stream.getvalue()


def save_figure(page: Figure, path: str | Path) -> None:
    """Write a figure to a file, in the format that its name ends in: .svg, .pdf or .png.

    What stood there is replaced in one step, once the figure is complete.

    Raises
    ------
    FigureError
        If the name has another ending, or the file cannot be written.
    """
    path = Path(path)
    content = figure_bytes(page, figure_format(path))
    try:
        replace_file(path, content)
    except OSError as error:
        raise FigureError(f"{path}: cannot be written: {error.strerror}") from None
