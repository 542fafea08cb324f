"""How functions of models are compiled."""

from __future__ import annotations

import re

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


@pytest.fixture(scope="module")
def rods_in_llvm() -> str:
    if not binding.get_host_cpu_features().get("avx2") or numba.config.CPU_NAME:
        pytest.skip("the processor that is compiled for has no vectors of 256 bits")
    return str(entry_point(erode, SIGNATURE, cache=False).inspect_llvm())


@pytest.mark.slow
def test_rods_are_integrated_by_vectors(rods_in_llvm: str) -> None:
    """A loop that LLVM leaves scalar has the same results, and takes five times as long."""
    assert rods_in_llvm.count("fdiv <") > 5 * rods_in_llvm.count("fdiv double")


@pytest.mark.slow
def test_rods_have_a_stack_that_is_aligned_to_their_vectors(rods_in_llvm: str) -> None:
    """A vector that lies in two cache lines has the same value, and takes longer to read."""
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten()
    )
    code = target.emit_assembly(binding.parse_assembly(rods_in_llvm))
    size = 64 if "zmm" in code else 32
    assert re.search(rf"andq\s+\$-{size}, %rsp", code)


@pytest.mark.processor
def test_the_width_changes_no_result() -> None:
    values = np.linspace(1.0, 2.0, 37)
    wide = values.copy()
    for function, each in ((halve, values), (halve_widely, wide)):
        numba.njit(function)(each)
    np.testing.assert_array_equal(wide, values)
