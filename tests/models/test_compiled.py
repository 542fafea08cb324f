"""How functions are compiled, and kept for other processes."""

import importlib
import re
import resource
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numba
import numpy as np
import pytest
from llvmlite import binding

from uqpen.models.compiled import use_widest_vectors
from uqpen.models.rod_kernel import erode


def halve(values):
    for i in range(values.size):
        values[i] *= 0.5


def halve_widely(values):
    use_widest_vectors()
    for i in range(values.size):
        values[i] *= 0.5


def machine_code(function, values):
    compiled = numba.njit(function)
    compiled(values)
    (code,) = compiled.inspect_asm().values()
    return str(code)


def test_loops_use_vectors_of_512_bits_where_there_are_any():
    if not binding.get_host_cpu_features().get("avx512f") or numba.config.CPU_NAME:
        pytest.skip("the processor that is compiled for has no vectors of 512 bits")
    assert "zmm" in machine_code(halve_widely, np.ones(64))


@pytest.fixture(scope="module")
def rods():
    """The machine code of the integrator as it is kept on disk, which takes no compilation."""
    if not binding.get_host_cpu_features().get("avx2") or numba.config.CPU_NAME:
        pytest.skip("the processor that is compiled for has no vectors of 256 bits")
    processor = erode.targetctx.codegen().magic_tuple()
    kept = erode._cache._cache_file._load_index()
    (name,) = (name for (_, made_for, _), name in kept.items() if made_for == processor)
    return (Path(erode.stats.cache_path) / name).read_bytes()


def test_rods_are_integrated_by_vectors(rods):
    """A loop that LLVM leaves scalar has the same results, and takes five times as long."""
    # A division has the code 5e behind a VEX or EVEX prefix, whose low bits are 01 for packed
    # doubles and 11 for a single one.
    prefixes = rb"\xc5(.)\x5e|\xc4[\x41\x61\xc1\xe1](.)\x5e|\x62.([\x80-\xff]).\x5e"
    found = re.findall(prefixes, rods, re.DOTALL)
    divisions = Counter(b"".join(groups)[0] & 3 for groups in found)
    assert divisions[1] > 5 * divisions[3]


def test_rods_have_a_stack_that_is_aligned_to_their_vectors(rods):
    """A vector that lies in two cache lines has the same value, and takes longer to read."""
    size = 64 if binding.get_host_cpu_features().get("avx512f") else 32
    assert b"\x48\x83\xe4" + (-size).to_bytes(1, signed=True) in rods, "and rsp with -size"


@pytest.mark.processor
def test_the_width_changes_no_result():
    values = np.linspace(1.0, 2.0, 37)
    wide = values.copy()
    for function, each in ((halve, values), (halve_widely, wide)):
        numba.njit(function)(each)
    np.testing.assert_array_equal(wide, values)


HALVED = """\
from uqpen.models.compiled import compiled

@compiled("float64(float64)")
def halve(value):
    return value / 2
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Loads a module with a compiled function, as each process does."""
    (tmp_path / "halved.py").write_text(HALVED)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kept"))

    def once():
        monkeypatch.delitem(sys.modules, "halved", raising=False)
        module = importlib.import_module("halved")
        assert module.halve(3.0) == 1.5
        return module.halve

    return once


@pytest.mark.processor
def test_a_function_is_compiled_once(load):
    assert [bool(load().stats.cache_hits) for _ in range(3)] == [False, True, True]


def test_code_that_was_cut_off_is_not_used(load, tmp_path):
    load()
    index, data = sorted((tmp_path / "kept").rglob("*.nb?"), key=lambda path: path.suffix)[::-1]
    for path in (index, data):
        whole = path.read_bytes()
        for rest in (0, len(whole) // 2, len(whole) - 1):
            path.write_bytes(whole[:rest])
            load()
        path.write_bytes(whole)
    assert load().stats.cache_hits


def test_a_full_disk_keeps_nothing(load, tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        load()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not [*tmp_path.rglob("*.nb?")]


def test_no_folder_to_write_to_keeps_nothing(load, tmp_path, monkeypatch):
    """An installation that is read only, run by a user without a directory to write to."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "/dev/null")
    # The only place Numba may then try is that of notebooks, which a program is not.
    monkeypatch.setattr(numba.config, "CACHE_LOCATOR_CLASSES", "IPythonCacheLocator", raising=False)
    load()
    assert not [*tmp_path.rglob("*.nb?")]


@pytest.mark.slow
def test_processes_that_compile_at_the_same_time_keep_whole_code(load, tmp_path):
    program = f"import numba; numba.config.CACHE_DIR = {str(tmp_path / 'kept')!r}\n"
    program += "from halved import halve; print(halve(3.0))"
    started = [
        subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    assert [process.communicate()[0] for process in started] == [b"1.5\n"] * 2
    assert load().stats.cache_hits


def test_a_compiled_function_takes_arguments_of_one_type():
    """So processes that compile at the same time never keep two codes under one name."""
    assert len(erode.signatures) == 1
    with pytest.raises(TypeError, match="No matching definition"):
        erode(*["text"] * len(erode.signatures[0]))
