"""Reference to an archive, which goes along with what is copied from its page."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import xarray as xr

from uqpen.core.labels import CONTENT
from uqpen.report.masthead import page_heading
from uqpen.results.texts import plain_text

__all__ = ["page_reference"]

# Digits of a hash: enough to tell archives apart.
_DIGITS = 16


def page_reference(tree: xr.DataTree) -> str:
    """Title, study, hash of the archive, and version of uqpen.

    The hash is the SHA-256 of the record ``content_sha256``, which has the hash of every group.
    """
    return plain_text("; ".join(_parts(tree)), 400)


def _parts(tree: xr.DataTree) -> Iterator[str]:
    yield page_heading(tree)
    if name := str(tree.attrs.get("study_name", "")):
        yield f"study {name}"
    if record := tree.attrs.get(CONTENT):
        yield f"archive sha256 {hashlib.sha256(str(record).encode()).hexdigest()[:_DIGITS]}"
    if version := str(tree.attrs.get("version_uqpen", "")):
        yield f"uqpen {version}"
