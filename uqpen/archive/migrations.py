"""Archives of earlier schemas as this uqpen would have written them."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import xarray as xr

from uqpen.archive.provenance import SCHEMA, SCHEMA_ATTRIBUTE
from uqpen.core.labels import BENCHMARK, COMPARISON, INPUT, KIND, SENSITIVITY

__all__ = ["MIGRATIONS", "migrate"]


def migrate(tree: xr.DataTree) -> xr.DataTree:
    """Return a copy of a tree of any schema up to this uqpen's in this uqpen's schema.

    The hashes remain those of the original tree, so they can be checked with that tree only.
    """
    for schema in range(int(tree.attrs[SCHEMA_ATTRIBUTE]), SCHEMA):
        tree = MIGRATIONS[schema](tree)
        tree.attrs[SCHEMA_ATTRIBUTE] = schema + 1
    return tree


def _migrate_from_1(tree: xr.DataTree) -> xr.DataTree:
    """Set one long name of the dimension of sensitivity measures, which some of them lack.

    The archive has no files that the study names, and they cannot be added.
    """
    tree = tree.copy()
    for node in tree.subtree:
        parts = node.path.split("/")
        if (SENSITIVITY in parts or COMPARISON in parts) and INPUT in node.coords:
            named = node.coords[INPUT].variable.copy()
            named.attrs = {**named.attrs, "long_name": "input"}
            node.coords[INPUT] = named
    return tree


def _migrate_from_2(tree: xr.DataTree) -> xr.DataTree:
    if tree.attrs.get(KIND) == BENCHMARK:
        from uqpen.archive.benchmark_schema_2 import migrate_benchmark

        return migrate_benchmark(tree)
    from uqpen.archive.schema_2 import migrate_from_2

    return migrate_from_2(tree)


# From a schema to the next, for every schema there has been.
MIGRATIONS: MappingProxyType[int, Callable[[xr.DataTree], xr.DataTree]] = MappingProxyType(
    {1: _migrate_from_1, 2: _migrate_from_2}
)
