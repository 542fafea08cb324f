"""Archives of earlier schemas as this uqpen would have written them."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import xarray as xr

from uqpen.archive.provenance import SCHEMA, SCHEMA_ATTRIBUTE
from uqpen.core.labels import COMPARISON, INPUT, SENSITIVITY

__all__ = ["MIGRATIONS", "migrate"]


def migrate(tree: xr.DataTree) -> xr.DataTree:
    """A tree of any schema up to this uqpen's, in this uqpen's.

    Its hashes stay those of what was written: whoever checks them needs the tree as it was.

    Parameters
    ----------
    tree : DataTree
        It is not touched.
    """
    for schema in range(int(tree.attrs[SCHEMA_ATTRIBUTE]), SCHEMA):
        tree = MIGRATIONS[schema](tree)
        tree.attrs[SCHEMA_ATTRIBUTE] = schema + 1
    return tree


def _migrate_from_1(tree: xr.DataTree) -> xr.DataTree:
    """One name for what measures of sensitivity lie along, which some of them left without.

    The files that the study names are not there, and nobody can add them.
    """
    tree = tree.copy()
    for node in tree.subtree:
        parts = node.path.split("/")
        if (SENSITIVITY in parts or COMPARISON in parts) and INPUT in node.coords:
            named = node.coords[INPUT].variable.copy()
            named.attrs = {**named.attrs, "long_name": "input"}
            node.coords[INPUT] = named
    return tree


# From a schema to the next, for every schema there has been.
MIGRATIONS: MappingProxyType[int, Callable[[xr.DataTree], xr.DataTree]] = MappingProxyType(
    {1: _migrate_from_1}
)
