"""A figure as a file: whole, under its own name, or not at all; the same bytes each time."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqpen.errors import FigureError
from uqpen.figures.style import style
from uqpen.files import replace_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["KINDS", "format_of", "save", "written"]

# What a file says of itself; no time, no version.
KINDS: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": "uqpen"},
    "pdf": {"CreationDate": None, "Creator": "uqpen", "Producer": None},
    "png": {"Software": None},
}


def format_of(path: Path) -> str:
    """What the end of a file's name says it is.

    Raises
    ------
    FigureError
        If it is none of `KINDS`.
    """
    kind = path.suffix.removeprefix(".").lower()
    if kind not in KINDS:
        known = ", ".join(f".{each}" for each in KINDS)
        raise FigureError(f"{path}: found the ending {path.suffix or 'none'}; expected {known}")
    return kind


def written(page: Figure, kind: str) -> bytes:
    """A figure as the bytes of a file.

    Parameters
    ----------
    page : Figure
    kind : str
        One of `KINDS`.
    """
    stream = io.BytesIO()
    with style(), warnings.catch_warnings():
        # A character that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph", UserWarning)
        page.savefig(stream, format=kind, metadata=KINDS[kind])
    return stream.getvalue()


def save(page: Figure, path: str | Path) -> None:
    """Write a figure to a file, in the format that its name ends in: .svg, .pdf or .png.

    What stood there is replaced in one step, once the figure is complete.

    Raises
    ------
    FigureError
        If the name has another ending, or the file cannot be written.
    """
    path = Path(path)
    content = written(page, format_of(path))
    try:
        replace_file(path, content)
    except OSError as error:
        raise FigureError(f"{path}: cannot be written: {error.strerror}") from None
