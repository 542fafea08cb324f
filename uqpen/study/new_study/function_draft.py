"""Draft of a study of a Python function, from its source, which is parsed and not executed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from uqpen.core.errors import ModelError, QuantityError, UnknownNameError
from uqpen.core.lookup import choices
from uqpen.core.units import scale
from uqpen.study.new_study.draft import Draft, DraftInput, check_names

__all__ = ["function_draft"]

# Bounds around a larger number may not be finite.
_LARGEST = 1e300


def function_draft(path: Path, name: str, reference: str) -> Draft:
    """Return the draft of a study of a function in a file.

    Parameters
    ----------
    path : Path
        The Python file.
    name : str
        The function; empty for the only public one.
    reference : str
        The path of the file as the study names it.

    Raises
    ------
    ModelError
        If the file cannot be read, or the function cannot be a model.
    UnknownNameError
        If there is no such function.
    """
    function = _find(_parse(path), name, path)
    arguments = function.args
    if arguments.posonlyargs:
        raise ModelError(
            f"{path}: {function.name} takes {arguments.posonlyargs[0].arg} by position; "
            "expected arguments that can be given by name"
        )
    inputs, left = _inputs(arguments)
    if not inputs:
        raise ModelError(f"{path}: {function.name} has no argument that is a number")
    outputs = list(dict.fromkeys(_returned(function)))
    check_names([each.name for each in inputs], "argument")
    check_names(outputs, "output")
    remarks = [f"{', '.join(left)}: left at the default of the function"] if left else []
    remarks.append("it takes its inputs by name, and returns a dict with a number for each output")
    return Draft(
        title=_title(function),
        model=(
            f'python = "{reference}:{function.name}"',
            "# vectorized = true      # if it takes arrays with a value for each run",
            '# time_limit = "10 s"    # of one run',
        ),
        inputs=tuple(inputs),
        outputs=tuple(outputs) or ("result",),
        knows_outputs=bool(outputs),
        remarks=tuple(remarks),
    )


def _title(function: ast.FunctionDef) -> str:
    """Return the first line of the docstring of a function; its name where it has none."""
    first = (ast.get_docstring(function) or "").partition("\n")[0].strip().removesuffix(".")
    return first if first and first.isprintable() else function.name


def _parse(path: Path) -> ast.Module:
    try:
        return ast.parse(path.read_bytes(), str(path))
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
        reason = error.msg if isinstance(error, SyntaxError) else error
        raise ModelError(f"{path}{line}: is no Python: {reason}") from None


def _find(module: ast.Module, name: str, path: Path) -> ast.FunctionDef:
    """Return the function of a name, or the only public one."""
    found = {each.name: each for each in module.body if isinstance(each, ast.FunctionDef)}
    public = [each for each in found if not each.startswith("_")]
    if not name and len(public) == 1:
        return found[public[0]]
    if not name:
        known = ", ".join(f"{path}:{each}" for each in public) or "none is in it"
        raise UnknownNameError(f"{path}: expected the name of a function; {known}")
    if name not in found:
        raise UnknownNameError(f'{path} has no function "{name}"; {choices(name, public)}')
    return found[name]


def _inputs(arguments: ast.arguments) -> tuple[list[DraftInput], list[str]]:
    """Return the arguments that are numbers, and those that are left at their defaults."""
    plain, defaults = arguments.args, arguments.defaults
    missing: list[ast.expr | None] = [None] * (len(plain) - len(defaults))
    pairs = [
        *zip(plain, [*missing, *defaults], strict=True),
        *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
    ]
    inputs: list[DraftInput] = []
    left: list[str] = []
    for argument, default in pairs:
        nominal = None if default is None else _number(default)
        if default is not None and (nominal is None or _annotation(argument) in ("int", "bool")):
            left.append(argument.arg)
        else:
            inputs.append(DraftInput(argument.arg, nominal, _unit(argument)))
    return inputs, left


def _number(node: ast.expr) -> float | None:
    """Return the value of a default; None where it is no finite number."""
    try:
        value = ast.literal_eval(node)
        is_number = type(value) in (int, float) and abs(float(value)) < _LARGEST
    except (ValueError, TypeError, OverflowError, MemoryError, RecursionError):
        return None
    return float(value) if is_number else None


def _annotation(argument: ast.arg) -> str:
    return ast.unparse(argument.annotation) if argument.annotation else ""


def _unit(argument: ast.arg) -> str:
    """Return the unit that an annotation states, as ``"kN"`` or ``Annotated[float, "kN"]``."""
    nodes = ast.walk(argument.annotation) if argument.annotation else ()
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            try:
                scale(node.value)
            except QuantityError:
                continue
            return node.value
    return ""


def _returned(function: ast.FunctionDef) -> Iterator[str]:
    """Yield the keys of the mappings that a function returns, where they are written in it."""
    for node in _own_nodes(function):
        match node:
            case ast.Return(value=ast.Dict(keys=keys)):
                yield from (
                    key.value
                    for key in keys
                    if isinstance(key, ast.Constant) and isinstance(key.value, str)
                )
            case ast.Return(value=ast.Call(func=ast.Name(id="dict"), keywords=keywords)):
                yield from (keyword.arg for keyword in keywords if keyword.arg)


def _own_nodes(parent: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a function, but not those of functions inside."""
    for node in ast.iter_child_nodes(parent):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            yield node
            yield from _own_nodes(node)
