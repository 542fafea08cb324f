"""Versions, platform and processor features that decide the last bits of a result.

Neither time, host, path nor process is among them.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import os
import platform
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

CONVENTIONS = "CF-1.11"

# The layout of the groups; raised whenever a reader has to know.
SCHEMA = 1

SCHEMA_ATTRIBUTE = "uqpen_schema"

# The packages whose versions can change a result's bits.
_PACKAGES = ("uqpen", "numpy", "scipy", "numba", "xarray", "netCDF4")

# Folders of wheels with a BLAS library of their own; a model may load further libraries.
_WHEELS = re.compile(r"[/\\](numpy|scipy)(\.libs|[/\\])")

_UNKNOWN = "not recorded"


def provenance() -> dict[str, str]:
    """Return the provenance that decides last bits of statistics and of built-in models' runs.

    These are versions of packages; operating system and processor family (``platform``); the
    processor features beyond NumPy's baseline for which NumPy uses code of its own
    (``cpu_features``); the BLAS library and its kernel (``blas``).
    """
    return {
        **{f"version_{name}": _version(name) for name in _PACKAGES},
        "version_python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "cpu_features": _cpu_features(),
        "blas": _blas()[0],
    }


def of_python_functions() -> dict[str, str]:
    """Return the further provenance that can decide last bits of a Python function.

    The statistics and the built-in models do not depend on it: they use one BLAS thread, and the
    compiled integrator gives the same bits for every target. These are the number of BLAS threads,
    and the processor that Numba compiles for.
    """
    target = os.environ.get("NUMBA_CPU_NAME") or "host"
    features = os.environ.get("NUMBA_CPU_FEATURES")
    return {
        "blas_threads": _blas()[1],
        "numba_target": f"{target} {features}" if features else target,
    }


def provenance_differences(
    first: Mapping[Any, Any], second: Mapping[Any, Any]
) -> Iterator[tuple[str, str, str]]:
    """Compare two provenances.

    Each is the attributes of an archive's root, or the result of `provenance`. Yields name and both
    values of a difference; of processor features only those that one of them lacks.
    """
    for name in [*provenance(), *of_python_functions()]:
        values = [str(each.get(name, _UNKNOWN)) for each in (first, second)]
        if values[0] == values[1]:
            continue
        label = name.removeprefix("version_").replace("_", " ")
        if name == "cpu_features" and _UNKNOWN not in values:
            one, other = (value.split() for value in values)
            values = [
                " ".join(feature for feature in these if feature not in those) or "none besides"
                for these, those in ((one, other), (other, one))
            ]
        yield label, values[0], values[1]


@functools.cache
def _version(package: str) -> str:
    """Return a package's version, which does not change; a look-up takes a millisecond."""
    return importlib.metadata.version(package)


@functools.cache
def _cpu_features() -> str:
    """Return the features for which NumPy chooses among its loops, as it names them."""
    # NumPy has no public way to ask, and earlier ones than 2 lack the first of these modules.
    name = "numpy._core" if np.lib.NumpyVersion(np.__version__) >= "2.0.0" else "numpy.core"
    core = importlib.import_module(f"{name}._multiarray_umath")

    found = (name for name in core.__cpu_dispatch__ if core.__cpu_features__.get(name))
    return " ".join(found) or "none"


@functools.cache
def _blas() -> tuple[str, str]:
    """Return the BLAS libraries of NumPy and SciPy with their kernels, and their threads."""
    from threadpoolctl import threadpool_info

    found = [library for library in threadpool_info() if library["user_api"] == "blas"]
    # A model may have loaded others, whose presence must not depend on when this is called.
    found = [each for each in found if _WHEELS.search(each["filepath"])] or found
    kernels = {f"{each['internal_api']} {each.get('architecture', '')}".strip() for each in found}
    threads = {str(each["num_threads"]) for each in found}
    return ", ".join(sorted(kernels)) or "unknown", ", ".join(sorted(threads)) or "unknown"
