"""A figure as the bytes of a file, the same each time."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqpen.core.errors import FigureError
from uqpen.figures.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FORMATS", "figure_bytes", "figure_format"]

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
