"""Machine code of a compiled function, kept on disk for processes that then need no Numba.

Numba keeps machine code, too, but has to be loaded to use it, with all that it could compile: ten
times as long as a study's own runs take. What stands here is LLVM's object code of one function
that calls no other, as the processor runs it. Another version, processor or source has a file of
its own, and a file that is not whole is not used.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from llvmlite import binding

from uqpen.core.files import replace_file

__all__ = ["load_or_compile"]

# Where Numba keeps its own, if a user says so; otherwise where Python keeps compiled modules.
_FOLDER_SETTING = "NUMBA_CACHE_DIR"
_FOLDER = Path(__file__).parent / "__pycache__"
_NAME = "entry_point"
_DIGEST = hashlib.sha256().digest_size

# Operations that LLVM writes as functions, and that processors have as instructions.
_INSTRUCTIONS = ("llvm.assume", "llvm.fabs.", "llvm.masked.", "llvm.smin.", "llvm.sqrt.")

# Modules of LLVM whose code is in use.
_ENGINES: list[Any] = []


def load_or_compile(
    source: str, compile_function: Callable[[bool], Any], types: Sequence[Any]
) -> Callable[..., None]:
    """Return a function of C; compile it if its machine code is not on disk.

    Parameters
    ----------
    source : str
        Hash of the source of the function and all that is compiled into it.
    compile_function : callable
        Returns the function as `numba.cfunc` does; its argument says whether Numba keeps it on
        disk, and then need not show its code.
    types : sequence
        Types of its arguments, of `ctypes`; it returns nothing.
    """
    prototype = ctypes.CFUNCTYPE(None, *types)
    folder = Path(os.environ.get(_FOLDER_SETTING) or _FOLDER)
    path = folder / f"machine_code.{_key(source)}.o"
    code = _read(path)
    if code:
        return prototype(_address(code))
    # Numba has further places where an installation is read only.
    is_kept_here = code is None and _is_writable(folder)
    function = compile_function(not is_kept_here)
    if is_kept_here:
        made = _object_code(function)
        with contextlib.suppress(OSError):
            replace_file(path, hashlib.sha256(made).digest() + made)
    return prototype(function.address)


def _read(path: Path) -> bytes | None:
    """Return machine code from disk, empty where there can be none; None if it is not whole."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    code = stored[_DIGEST:]
    return code if hashlib.sha256(code).digest() == stored[:_DIGEST] else None


def _is_writable(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return folder.is_dir() and os.access(folder, os.W_OK)


def _key(source: str) -> str:
    """Return the hash of all that the machine code follows from."""
    settings = [
        (name, value)
        for name, value in sorted(os.environ.items())
        if name.startswith("NUMBA_") and name != _FOLDER_SETTING
    ]
    parts = (source, version("numba"), version("llvmlite"), _triple(), *_processor(), settings)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _processor() -> tuple[str, str]:
    return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()


def _triple() -> str:
    # On Windows LLVM loads code in the form of other systems only, as Numba has it.
    return str(binding.get_process_triple()) + ("-elf" if os.name == "nt" else "")


def _object_code(function: Any) -> bytes:
    """Return the machine code of a compiled function; empty if it calls others."""
    module = _parse(function.inspect_llvm())
    called = [each.name for each in module.functions if each.is_declaration]
    if not all(name.startswith(_INSTRUCTIONS) for name in called):
        return b""
    module.get_function(function.native_name).name = _NAME
    return bytes(_target_machine().emit_object(module))


def _address(code: bytes) -> int:
    engine = binding.create_mcjit_compiler(
        _parse(f'target triple = "{_triple()}"'), _target_machine()
    )
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _ENGINES.append(engine)
    return int(engine.get_function_address(_NAME))


def _parse(assembly: str) -> Any:
    with contextlib.suppress(RuntimeError):  # later versions need no initialisation
        binding.initialize()
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.parse_assembly(assembly)


def _target_machine() -> Any:
    name, features = _processor()
    target = binding.Target.from_triple(_triple())
    return target.create_target_machine(
        cpu=name, features=features, opt=3, codemodel="jitdefault", jit=True
    )
