"""How functions of models are compiled."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt
import pytest
from llvmlite import binding

from uqpen.models.compiled import entry_point, use_widest_vectors
from uqpen.models.rod_kernel import SIGNATURE, erode


def halve(values: npt.NDArray[np.float64]) -> None:
    for i in range(values.size):
        values[i] *= 0.5


def halve_widely(values: npt.NDArray[np.float64]) -> None:
    use_widest_vectors()
    for i in range(values.size):
        values[i] *= 0.5


def machine_code(function: object, values: npt.NDArray[np.float64]) -> str:
    compiled = numba.njit(function)
    compiled(values)
    (code,) = compiled.inspect_asm().values()
    return str(code)


def test_loops_use_vectors_of_512_bits_where_there_are_any() -> None:
    if not binding.get_host_cpu_features().get("avx512f") or numba.config.CPU_NAME:
        pytest.skip("the processor that is compiled for has no vectors of 512 bits")
    assert "zmm" in machine_code(halve_widely, np.ones(64))


@pytest.mark.slow
def test_rods_are_integrated_by_vectors() -> None:
    """A loop that LLVM leaves scalar has the same results, and takes five times as long."""
    if not binding.get_host_cpu_features().get("avx2") or numba.config.CPU_NAME:
        pytest.skip("the processor that is compiled for has no vectors of 256 bits")
    code = entry_point(erode, SIGNATURE, cache=False).inspect_llvm()
    assert code.count("fdiv <") > 5 * code.count("fdiv double")


@pytest.mark.processor
def test_the_width_changes_no_result() -> None:
    values = np.linspace(1.0, 2.0, 37)
    wide = values.copy()
    for function, each in ((halve, values), (halve_widely, wide)):
        numba.njit(function)(each)
    np.testing.assert_array_equal(wide, values)
