"""The machine's limit, compiled from ``limit.cpp`` and called in this process."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.models import rod_kernel

Erode = Callable[[FloatArray, float], FloatArray]

_SOURCE = Path(__file__).with_name("limit.cpp")
_OPTIONS = ("-std=c++17", "-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
_WEIGHTS = {f"A{stage}": f"STAGE_{stage}" for stage in range(2, 7)}
_DOUBLES = np.ctypeslib.ndpointer(np.float64, ndim=2, flags="C_CONTIGUOUS")


def find_compiler() -> str | None:
    """Return the path of a compiler of C++, if there is one."""
    return shutil.which("g++") or shutil.which("clang++")


def compile_limit(compiler: str, folder: Path) -> Erode:
    """Compile the program in a folder; return it as a function like `walker_anderson.erode`.

    Its result has a sixth row: the number of evaluations of the slopes.
    """
    names = _WEIGHTS | {name: name for name in ("SOLUTION", "ERROR")}
    lines = [
        f"static constexpr double {name}[] = {{{', '.join(map(repr, getattr(rod_kernel, each)))}}};"
        for name, each in names.items()
    ]
    (folder / "weights.h").write_text("\n".join([*lines, ""]))
    library = folder / "limit.so"
    line = [compiler, *_OPTIONS, "-Wno-psabi", f"-I{folder}", str(_SOURCE), "-o", str(library)]
    subprocess.run(line, check=True)
    function = ctypes.CDLL(str(library)).erode
    function.argtypes = [_DOUBLES, ctypes.c_long, ctypes.c_double, _DOUBLES]
    function.restype = None

    def erode(rods: FloatArray, tolerance: float) -> FloatArray:
        ends = np.empty((6, rods.shape[1]))
        function(rods, rods.shape[1], tolerance, ends)
        ends[5] = 1 + 6 * ends[5] + 7  # the start, the steps, the event
        return ends

    return erode
