"""Assets of a page: its style and scripts, and the symbols of its legends."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files

from uqpen.charts.marks import CROSS, END

__all__ = [
    "OUTLINES",
    "STROKES",
    "colour_name",
    "page_library",
    "page_script",
    "page_style",
    "script_hash",
]

# Style sheet and scripts of a page, which it carries along.

_ASSETS = files("uqpen.report") / "assets"
_LIBRARY = files("uqpen.report") / "vendored" / "plotly-basic.min.js"
_STYLES = ("page.css", "controls.css")
# In the order in which they need each other; together they are one function, which shares its names
# with nothing else.
_SCRIPTS = (
    "charts.js",
    "selection.js",
    "runs.js",
    "thresholds.js",
    "places.js",
    "address.js",
    "contents.js",
    "tables.js",
    "parallel.js",
    "explorer.js",
    "images.js",
    "page.js",
)


def page_style() -> str:
    """The style sheet."""
    return "".join((_ASSETS / name).read_text("utf-8") for name in _STYLES)


def page_script() -> str:
    """The page's own script, made of its parts."""
    parts = "\n".join((_ASSETS / name).read_text("utf-8") for name in _SCRIPTS)
    return f'"use strict";\n(() => {{\n{parts}}})();\n'


def page_library() -> str:
    """The library that draws charts."""
    return _LIBRARY.read_text("utf-8")


def script_hash(text: str) -> str:
    """Return the hash of a script, for the page's policy."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"


# Legend symbols of marks, as Plotly draws them.

# SVG paths of markers and dashes of lines, by Plotly's names.
OUTLINES = {
    "circle": "M-5,0a5,5 0 1,0 10,0a5,5 0 1,0 -10,0z",
    "square": "M-4.5,-4.5h9v9h-9z",
    "triangle-up": "M0,-5.5L5,4H-5z",
    "diamond": "M0,-6L6,0L0,6L-6,0z",
    "triangle-down": "M0,5.5L5,-4H-5z",
    "pentagon": "M0,-5.5L5.2,-1.7L3.2,4.5H-3.2L-5.2,-1.7z",
    "cross": "M-1.8,-5.4h3.6v3.6h3.6v3.6h-3.6v3.6h-3.6v-3.6h-3.6v-3.6h3.6z",
    "star-diamond": "M0,-6L1.8,-1.8L6,0L1.8,1.8L0,6L-1.8,1.8L-6,0L-1.8,-1.8z",
    "triangle-left": "M-5.5,0L4,-5V5z",
    "triangle-right": "M5.5,0L-4,-5V5z",
    CROSS: "M-4,-6L0,-2L4,-6L6,-4L2,0L6,4L4,6L0,2L-4,6L-6,4L-2,0L-6,-4z",
    END: "M-1,-6h2v12h-2z",
}
STROKES = {
    "solid": "none",
    "dash": "8 5",
    "dot": "2 3",
    "dashdot": "8 3 2 3",
    "6px,3px": "6 3",
    "longdashdot": "11 3 2 3",
    "4px,4px": "4 4",
    "longdash": "11 4",
    "2px,5px": "2 5",
    "8px,2px,2px,2px": "8 2 2 2",
}


def colour_name(series: int | str) -> str:
    """The name of a colour in the style sheet."""
    return f"s{series % 10}" if isinstance(series, int) else series
