"""Machine code on disk is used as it was made, or not at all."""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uqpen.models.compiled import entry_point
from uqpen.models.machine_code import load_or_compile

TYPES = (ctypes.c_void_p, ctypes.c_int64)


def halve(values: Any, count: int) -> None:
    for i in range(count):
        values[i] *= 0.5


def take_sines(values: Any, count: int) -> None:
    for i in range(count):
        values[i] = math.sin(values[i])


class Compiler:
    """Compile a function, and count how often."""

    def __init__(self, function: Any) -> None:
        self.function, self.calls = function, 0

    def __call__(self, cache: bool) -> Any:
        self.calls += 1
        return entry_point(self.function, "void(CPointer(float64), int64)", cache=cache)

    def result(self, source: str = "source") -> list[float]:
        values = np.array([1.0, 2.0, 4.0])
        load_or_compile(source, self, TYPES)(values.ctypes.data, values.size)
        return [float(value) for value in values]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_a_function_is_compiled_once_for_each_source() -> None:
    halved = Compiler(halve)
    assert [halved.result() for _ in range(3)] == [[0.5, 1.0, 2.0]] * 3
    assert halved.calls == 1
    halved.result("another source")
    assert halved.calls == 2


def test_machine_code_that_is_not_whole_is_not_used(folder: Path) -> None:
    halved = Compiler(halve)
    halved.result()
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    for damaged in (whole[:-1], whole[:-1] + bytes([whole[-1] ^ 1]), b""):
        path.write_bytes(damaged)
        assert [halved.result() for _ in range(2)] == [[0.5, 1.0, 2.0]] * 2
    assert halved.calls == 4


def test_a_function_that_calls_others_is_left_to_numba() -> None:
    sines = Compiler(take_sines)
    for _ in range(2):
        assert sines.result() == pytest.approx(np.sin([1.0, 2.0, 4.0]))
    assert sines.calls == 2


def test_nothing_need_be_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder / "file"))
    assert Compiler(halve).result() == [0.5, 1.0, 2.0]


# Both ways that functions are compiled, as the rod's model and the statistics have theirs.
UNCACHED = """\
import ctypes
from functools import partial
import numpy as np
from uqpen.core.compiled import compiled
from uqpen.models.compiled import entry_point
from uqpen.models.machine_code import load_or_compile

def halve(values, count):
    for i in range(count):
        values[i] *= 0.5

values = np.array([1.0, 2.0, 4.0])
compile_function = partial(entry_point, halve, "void(CPointer(float64), int64)")
types = (ctypes.c_void_p, ctypes.c_int64)
load_or_compile("source", lambda cache: compile_function(cache=cache), types)(
    values.ctypes.data, values.size
)
compiled(halve)(values, values.size)
print(*values)
"""


@pytest.mark.slow
def test_works_where_nothing_can_be_cached(tmp_path: Path) -> None:
    """An installation that is read only, run by a user without a directory to write to."""
    (tmp_path / "uncached.py").write_text(UNCACHED)
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(sys.path),
        "NUMBA_CACHE_DIR": os.devnull,
        # The only place Numba may then try is that of notebooks, which a program is not.
        "NUMBA_CACHE_LOCATOR_CLASSES": "IPythonCacheLocator",
    }
    done = subprocess.run(
        [sys.executable, "uncached.py"],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "0.25 0.5 1.0\n"
    assert [path.name for path in tmp_path.iterdir()] == ["uncached.py"]
