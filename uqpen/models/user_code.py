"""User-defined code, which may raise anything, or fork."""

from __future__ import annotations

import contextlib
import inspect
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from uqpen.core.errors import ModelError
from uqpen.core.interrupts import is_user_interrupt

# Texts of failures of a model: the reason of a run, and files that changed meanwhile.

_LONGEST_REASON = 200


def changed_file_error(name: str) -> ModelError:
    """Return the error of a file whose versions differ between runs of a study."""
    return ModelError(
        f'"{name}" was changed while the study ran: its runs were made with different versions of '
        "it, so nothing can be told of them; change it back, or start over with --fresh"
    )


def changed_variable_error(name: str) -> ModelError:
    """Return the error of a variable of the environment that differs between runs of a study."""
    return ModelError(
        f'the environment variable "{name}" had another value when runs were made, here or in '
        "another process, so nothing can be told of them; set it back, or start over with --fresh"
    )


def one_line(text: str) -> str:
    """Convert a text to a reason: one line, not too long, and no unpaired surrogates."""
    line = " ".join(text.encode("utf-8", "replace").decode("utf-8").split())
    return line if len(line) <= _LONGEST_REASON else line[: _LONGEST_REASON - 1] + "…"


@contextlib.contextmanager
def ending_forks() -> Iterator[None]:
    """End, at the end of this context, a process that code within it has forked from this one.

    A forked child that returns or raises would go on with the study beside its parent.
    """
    process = os.getpid()
    code: object = 0
    try:
        yield
    except BaseException as error:
        code = getattr(error, "code", 1) if isinstance(error, SystemExit) else 1
        raise
    finally:
        if os.getpid() != process:
            os._exit(code if isinstance(code, int) else int(code is not None))


def error_text(error: BaseException) -> str:
    """Format an exception in one line, even if its own text raises an error."""
    # The class of an exception may have a name of its own making.
    name = type.__dict__["__name__"].__get__(type(error))
    try:
        return one_line(f"{name}: {error}").removesuffix(":")
    except BaseException as another:  # an exception of its own whose text raises another
        if is_user_interrupt(another):
            raise
        return str(name)


@contextlib.contextmanager
def restore_streams() -> Iterator[None]:
    """Restore the standard output and error afterwards, as a model may replace them."""
    streams = sys.stdout, sys.stderr
    try:
        yield
    finally:
        sys.stdout, sys.stderr = streams


def check_signature(
    function: Callable[..., Any],
    refusal: str,
    positional: Sequence[object] = (),
    keywords: Mapping[str, object] | None = None,
) -> None:
    """Check that a function takes these arguments; nothing is called.

    ModelError if it does not: its signature, the refusal, and what is wrong with the arguments.
    """
    try:
        signature = inspect.signature(function)
    except ValueError:  # some compiled functions have none; the first call will show it
        return
    try:
        signature.bind(*positional, **(keywords or {}))
    except TypeError as error:
        label = getattr(function, "__name__", "the function")
        raise ModelError(f"{label}{signature}{refusal}: {error}") from None


def pickle_by_value(value: object) -> bytes:
    """Pickle a function or model that may be defined in a notebook or inside another function.

    Only processes that this one has started read it, from the pipe to them.

    ModelError if it refers to something that exists in this process only.
    """
    import cloudpickle

    try:
        return bytes(cloudpickle.dumps(value))
    except Exception as error:  # an object can raise anything while it is pickled
        message = f"the model cannot be sent to another process: {error_text(error)}"
        raise ModelError(message) from None
