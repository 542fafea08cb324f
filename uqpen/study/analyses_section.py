"""``analyses = […]``: user-defined functions that compute statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from uqpen.core.errors import ModelError, toml_text
from uqpen.core.lookup import choices, installed_members, load_installed
from uqpen.models.user_code import check_signature
from uqpen.models.user_module import load_function
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis
from uqpen.study.table_reader import TableReader

__all__ = ["ANALYSES_KEY", "read_analyses"]

ANALYSES_KEY = "analyses"

# The entry points with which installed packages add analyses.
_GROUP = "uqpen.analyses"

# Stand-ins of its arguments, a sample and a quantity of interest.
_ARGUMENTS = (None, None)


def read_analyses(root: TableReader) -> tuple[UserDefinedAnalysis, ...]:
    """Read the user-defined analyses, without those for which a mistake was noted."""
    analyses: dict[str, UserDefinedAnalysis] = {}
    for position, reference in enumerate(root.entries(ANALYSES_KEY)):
        place = (ANALYSES_KEY, position)
        if not isinstance(reference, str) or not reference.strip():
            expected = 'a function such as "spread.py:interquartile_range"'
            root.add_wrong(place, reference, expected)
        elif reference in analyses:
            root.add_problem(place, f"{toml_text(reference)} again", "each function once")
        else:
            try:
                analysis = analyses[reference] = _load_analysis(root, reference)
                if fault := analysis.record_fault:
                    root.add_problem(place, f"{reference}: {fault[0]}", fault[1])
            except ModelError as error:
                expected = "a function that can be called with a sample and a quantity of interest"
                root.add_problem(place, str(error), expected)
    return tuple(analyses.values())


def _load_analysis(root: TableReader, reference: str) -> UserDefinedAnalysis:
    """Return the analysis behind a reference; one that is not trusted is not loaded.

    An analysis of an installed package has a name without a colon, and needs no trust.
    """
    if ":" not in reference:
        return UserDefinedAnalysis(reference, _installed_function(reference))
    if not root.trust:
        return UserDefinedAnalysis(reference, _refuse)
    function, surroundings = load_function(reference, root.folder)
    check_signature(function, "", _ARGUMENTS)
    return UserDefinedAnalysis(reference, function, surroundings)


def _installed_function(name: str) -> Callable[..., Any]:
    installed = installed_members(_GROUP)
    if name not in installed:
        found = f'"{name}" is not of the form "my_analysis.py:function", nor installed'
        raise ModelError(f"{found}; {choices(name, installed)}")
    function: Callable[..., Any] = load_installed(_GROUP, name)
    if not callable(function):
        raise ModelError(f'"{name}" is an object of class {type(function).__name__}')
    check_signature(function, "", _ARGUMENTS)
    return function


def _refuse(*arguments: object) -> Iterator[Any]:
    raise ModelError("user-defined analyses are not executed without --trust")
