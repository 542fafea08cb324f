"""What made an archive, so far as it decides the numbers: no time, host, path or process."""

from __future__ import annotations

import functools
import importlib.metadata
import platform

__all__ = ["CONVENTIONS", "SCHEMA", "SCHEMA_ATTRIBUTE", "provenance"]

CONVENTIONS = "CF-1.11"

# The layout of the groups; raised whenever a reader has to know, with a migration from the last.
SCHEMA = 2

SCHEMA_ATTRIBUTE = "uqpen_schema"

# The packages whose versions can change a result's bits.
_PACKAGES = ("uqpen", "numpy", "scipy", "numba", "xarray", "netCDF4")


def provenance() -> dict[str, str]:
    """Versions of what computes, and the kind of machine."""
    versions = {f"version_{name}": _version(name) for name in _PACKAGES}
    return {
        **versions,
        "version_python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }


@functools.cache
def _version(package: str) -> str:
    """That of a package, which does not change while it runs; to look it up takes a millisecond."""
    return importlib.metadata.version(package)
