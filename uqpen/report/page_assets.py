"""Style sheet and scripts of a page, which it carries along."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files

__all__ = ["page_library", "page_script", "page_style", "script_hash"]

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
