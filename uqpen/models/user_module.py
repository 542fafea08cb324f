"""User-defined modules, and the functions and values in them."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.errors import ModelError
from uqpen.core.files import is_file, is_folder
from uqpen.models.failed_line import line_in_folder
from uqpen.models.surroundings import MODEL_MODULE, ModelFolder
from uqpen.models.user_code import error_text, one_line

__all__ = ["find_function", "load_function", "load_module", "module_coordinates"]


def load_function(reference: str, folder: Path) -> tuple[Callable[..., Any], ModelFolder]:
    """Load the function of ``"file.py:function"`` or ``"package.module:function"``.

    Parameters
    ----------
    reference : str
        A path ends in ``.py`` and is relative to `folder`; anything else is an importable module.
    folder : Path
        Folder of the study file; modules beside it can be imported.

    Returns
    -------
    function, surroundings
        The function, and the folder that it must be called in.

    Raises
    ------
    ModelError
        If there is no such function, or importing it fails.
    """
    module, name, surroundings = load_module(reference, folder)
    return find_function(module, name, reference), surroundings


def find_function(module: ModuleType, name: str, reference: str) -> Callable[..., Any]:
    """Return the function of a module with a name; ModelError if there is none."""
    function = getattr(module, name, None)
    if not callable(function):
        known = [key for key, value in vars(module).items() if inspect.isfunction(value)]
        listing = f"; it defines {', '.join(known)}" if known else ""
        where = reference.rpartition(":")[0]
        raise ModelError(f'"{where}" has no function "{name}"{listing}')
    return function


def load_module(
    reference: str, folder: Path, form: str = "my_model.py:function"
) -> tuple[ModuleType, str, ModelFolder]:
    """Load the module of a reference such as those of `load_function`.

    Returns
    -------
    module, name, surroundings
        The module, the name after the colon, and the folder that the module belongs to.

    Raises
    ------
    ModelError
        If the reference is not of the form, there is no such module, or importing it fails.
    """
    where, _, name = reference.rpartition(":")
    if not where or not name:
        raise ModelError(f'"{reference}" is not of the form "{form}"')
    surroundings = ModelFolder(folder)
    with surroundings.loading():
        module = _import_module(where, surroundings)
        if where.endswith(".py"):
            # It may lie outside the folder.
            surroundings.read(str(folder / where))
    return module, name, surroundings


def module_coordinates(module: ModuleType, name: str, surroundings: ModelFolder) -> FloatArray:
    """Return the coordinates that a module has under a name.

    Parameters
    ----------
    module : module
        The module of a model's function.
    name : str
        The name of a list, an array, or a function without arguments that returns one.
    surroundings : ModelFolder
        The folder that the module belongs to.

    Raises
    ------
    ModelError
        If there is no such name, the function fails, or what it has are no numbers along one
        dimension.
    """
    if not hasattr(module, name):
        raise ModelError(f'"{name}", which is not there')
    value = getattr(module, name)
    try:
        with surroundings.on_import_path():
            values = floats(value() if callable(value) else value)
    except (Exception, SystemExit) as error:  # a user's function can raise anything
        raise ModelError(one_line(f'"{name}": {error_text(error)}')) from None
    if values.ndim != 1:
        raise ModelError(f'"{name}" of shape {values.shape}')
    return values


def _import_module(where: str, surroundings: ModelFolder) -> Any:
    try:
        if where.endswith(".py"):
            return _load_file(surroundings.folder / where, where)
        return importlib.import_module(where)
    except ModelError:
        raise
    except ModuleNotFoundError as error:
        raise ModelError(f'"{where}": {error}') from None
    except (Exception, SystemExit) as error:  # a user's module can raise anything when imported
        if where.endswith(".py"):
            surroundings.read(str(surroundings.folder / where))
        # An error of syntax has its place in its text.
        place = "" if isinstance(error, SyntaxError) else line_in_folder(error, surroundings)
        raise ModelError(f'importing "{where}" failed: {error_text(error)}{place}') from None


def _load_file(path: Path, where: str) -> Any:
    if is_folder(path):
        raise ModelError(f'"{where}" is a folder, not a Python file')
    if not is_file(path):
        raise ModelError(f'there is no file "{where}" beside the study')
    # Under a name of our own: a model in "random.py" must not stand in for Python's module.
    specification = importlib.util.spec_from_file_location(f"{MODEL_MODULE}{path.stem}", path)
    if specification is None or specification.loader is None:
        raise ModelError(f'"{where}" is not a Python file')
    module = importlib.util.module_from_spec(specification)
    sys.modules[module.__name__] = module
    specification.loader.exec_module(module)
    return module
