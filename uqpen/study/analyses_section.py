"""``analyses = […]``: user-supplied functions that compute statistics."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

from uqpen.core.errors import ModelError, toml_text
from uqpen.core.lookup import choices, installed_members, load_installed
from uqpen.models.user_module import load_function
from uqpen.statistics.outside_analysis import OutsideAnalysis
from uqpen.study.table_reader import TableReader

__all__ = ["ANALYSES_KEY", "read_analyses"]

ANALYSES_KEY = "analyses"

# The entry points with which installed packages add analyses.
_GROUP = "uqpen.analyses"


def read_analyses(root: TableReader) -> tuple[OutsideAnalysis, ...]:
    """Read the user-supplied analyses, without those for which a mistake was noted."""
    analyses: dict[str, OutsideAnalysis] = {}
    for position, reference in enumerate(root.entries(ANALYSES_KEY)):
        place = (ANALYSES_KEY, position)
        if not isinstance(reference, str) or not reference.strip():
            expected = 'a function such as "spread.py:interquartile_range"'
            root.add_wrong(place, reference, expected)
        elif reference in analyses:
            root.add_problem(place, f"{toml_text(reference)} again", "each function once")
        else:
            try:
                analyses[reference] = _load_analysis(root, reference)
            except ModelError as error:
                expected = "a function that can be called with a sample and a quantity of interest"
                root.add_problem(place, str(error), expected)
    return tuple(analyses.values())


def _load_analysis(root: TableReader, reference: str) -> OutsideAnalysis:
    """Return the analysis behind a reference; one that is not trusted is not loaded.

    An analysis of an installed package has a name without a colon, and needs no trust.
    """
    if ":" not in reference:
        return OutsideAnalysis(reference, _installed_function(reference))
    if not root.trust:
        return OutsideAnalysis(reference, _refuse)
    function, surroundings = load_function(reference, root.folder)
    _check_call(function)
    return OutsideAnalysis(reference, function, surroundings)


def _installed_function(name: str) -> Callable[..., Any]:
    installed = installed_members(_GROUP)
    if name not in installed:
        found = f'"{name}" is not of the form "my_analysis.py:function", nor installed'
        raise ModelError(f"{found}; {choices(name, installed)}")
    function: Callable[..., Any] = load_installed(_GROUP, name)
    if not callable(function):
        raise ModelError(f'"{name}" is an object of class {type(function).__name__}')
    _check_call(function)
    return function


def _refuse(*arguments: object) -> Iterator[Any]:
    raise ModelError("analyses of the user's own are not executed without --trust")


def _check_call(function: Callable[..., Any]) -> None:
    """Refuse a function that does not take a sample and a quantity."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # some compiled functions have none; the first call will tell
        return
    try:
        signature.bind(None, None)
    except TypeError as error:
        label = getattr(function, "__name__", "the function")
        raise ModelError(f"{label}{signature}: {error}") from None
