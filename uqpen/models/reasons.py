"""Texts of failures of a model: the reason of a run, and files that changed meanwhile."""

from __future__ import annotations

from uqpen.core.errors import ModelError

__all__ = ["changed_file_error", "changed_variable_error", "one_line"]

_LONGEST = 200


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
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"
