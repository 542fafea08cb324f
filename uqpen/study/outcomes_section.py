"""``[model.outcomes]``: endings of a run that are results, checked before anything runs."""

from __future__ import annotations

import builtins
import contextlib
import functools
import inspect
import pkgutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from uqpen.core.errors import toml_text
from uqpen.core.labels import OUTCOME_OUTPUT
from uqpen.core.lookup import choices
from uqpen.core.units import DIMENSIONLESS
from uqpen.models.outcomes import COMPLETED, DeclaredOutcome, class_name, with_outcomes
from uqpen.study.table_reader import TableReader, is_variable_name
from uqpen.study.variables_section import Variables

# How an ending of each kind of model is known: by what key, with an example.
OF_PROGRAMS: Mapping[str, str] = {"exit": "7", "text": '"UNSTABLE"'}
OF_FUNCTIONS: Mapping[str, str] = {"exception": '"UnstableError"'}

# What other names stand for, in an archive or in an event.
_TAKEN = {
    COMPLETED: "it has all other runs",
    "lost": "it has the failed runs",
    **dict.fromkeys(("and", "or", "not"), "it joins the limits of an event"),
}
_LARGEST_EXIT_CODE = 255

# What ends a run at a limit, or on Ctrl-C: that depends on the machine and on the user.
_OF_LIMITS = (TimeoutError, MemoryError, KeyboardInterrupt)


def read_outcomes(
    table: TableReader, variables: Variables, ways: Mapping[str, str]
) -> tuple[DeclaredOutcome, ...]:
    """Read the endings of a model that are results; mistakes are noted.

    Parameters
    ----------
    table : TableReader
        That of the model.
    variables : Variables
        Its inputs and outputs.
    ways : mapping of str to str
        How an ending is known: `OF_PROGRAMS` or `OF_FUNCTIONS`.
    """
    section = table.table("outcomes")
    if not section.is_given:
        return ()
    if not section.content:
        section.add_problem((), "an empty table", "at least one outcome")
    named = {each.name: "input" for each in variables.inputs}
    named |= {each.name: "output" for each in variables.outputs}
    if OUTCOME_OUTPUT in named:
        found = f'an {named[OUTCOME_OUTPUT]} "{OUTCOME_OUTPUT}"'
        section.add_problem((), found, "another name of it: this one has the category of each run")
    if any(each.dims for each in variables.outputs):
        expected = "outputs that are numbers: a place of a curve has a value in every completed run"
        section.add_problem((), "outcomes of a model with curves or fields", expected)
    outcomes: dict[str, DeclaredOutcome] = {}
    for name in section:
        if not is_variable_name(section, name):
            continue
        own = section.table(name, _form(ways))
        if reason := _TAKEN.get(name) or (f"an {named[name]} has it" if name in named else ""):
            own.add_problem((), toml_text(name), f"another name: {reason}")
        if outcome := _read_outcome(own, name, ways):
            same = [each.name for each in outcomes.values() if replace(each, name=name) == outcome]
            if same and not outcome.exception:
                _note_same(own, same[0])
            outcomes[name] = outcome
    return tuple(outcomes.values())


def add_outcomes(variables: Variables, outcomes: Sequence[DeclaredOutcome]) -> Variables:
    """Return the variables of a model with the category of each run, if it has outcomes."""
    if not outcomes:
        return variables
    return variables._replace(
        outputs=with_outcomes(variables.outputs, [each.name for each in outcomes]),
        units={**variables.units, OUTCOME_OUTPUT: DIMENSIONLESS},
    )


def refuse_outcomes(table: TableReader, found: str) -> None:
    """Note outcomes of a model that cannot have any."""
    if table.table("outcomes").is_given:
        expected = "a program (exit, text) or a Python function (exception), whose endings differ"
        table.add_problem("outcomes", found, expected)


def _form(ways: Mapping[str, str]) -> str:
    return "how it is known, " + " or ".join(f"{{ {key} = {each} }}" for key, each in ways.items())


def _read_outcome(table: TableReader, name: str, ways: Mapping[str, str]) -> DeclaredOutcome | None:
    """Read how an ending is known; None where a mistake was noted."""
    if not table.is_given:
        return None
    noted = len(table.problems)
    given = [key for key in ways if key in table]
    others = [key for key in {**OF_PROGRAMS, **OF_FUNCTIONS} if key in table and key not in ways]
    if len(given) != 1 or others:
        found = " and ".join((*given, *others)) or f"neither {' nor '.join(ways)}"
        table.add_problem((), found if len(ways) > 1 or given or others else "nothing", _form(ways))
    values = {key: table.take(key) for key in (*ways, *others)}
    code, text, exception = (values.get(key) for key in ("exit", "text", "exception"))
    if "exit" in given and not (type(code) is int and 0 < code <= _LARGEST_EXIT_CODE):
        table.add_wrong("exit", code, f"an exit code from 1 to {_LARGEST_EXIT_CODE}")
    is_line = isinstance(text, str) and bool(text.strip()) and len(text.splitlines()) == 1
    if "text" in given and not is_line:
        table.add_wrong("text", text, "a text in a line that the program prints")
    if "exception" in given and not (isinstance(exception, str) and exception.strip()):
        expected = "the class of an exception that the function raises"
        table.add_wrong("exception", exception, expected)
    table.check_unknown_keys()
    if len(table.problems) > noted:
        return None
    return DeclaredOutcome(name, code, text or "", exception or "")


def _note_same(table: TableReader, other: str) -> None:
    """Note an ending that an outcome before it has, so that no run would have this one."""
    expected = f'an ending of its own: all these runs have the outcome "{other}"'
    table.add_problem((), f"the ending of {other}", expected)


# Classes of exceptions, found by their names.


def find_exceptions(
    table: TableReader,
    outcomes: Sequence[DeclaredOutcome],
    function: Callable[..., Any],
    context: contextlib.AbstractContextManager[object],
) -> tuple[DeclaredOutcome, ...]:
    """Return outcomes with the full names of their classes; note names that are none.

    Parameters
    ----------
    table : TableReader
        That of the model.
    outcomes : sequence of DeclaredOutcome
        With names as the function's module has them, such as ``"UnstableError"`` or
        ``"pybamm.SolverError"``. A class that is an object is among those of the document.
    function : callable
        The function that raises them.
    context : context manager
        In which its module can import others.
    """
    section, known = table.table("outcomes"), _names_of_module(function)
    found: dict[str, type] = {}
    with context:
        for outcome in outcomes:
            own = section.inside({}, outcome.name)
            cls = (table.document.objects or {}).get(own.path)
            cls = _find_class(outcome.exception, known) if cls is None else cls
            if fault := _fault(outcome.exception, cls, known):
                own.add_problem("exception", *fault)
                continue
            if other := next((name for name, each in found.items() if issubclass(cls, each)), ""):
                _note_same(own, other)
            found[outcome.name] = cls
    return tuple(DeclaredOutcome(name, exception=class_name(cls)) for name, cls in found.items())


def _names_of_module(function: Callable[..., Any]) -> Mapping[str, Any]:
    """Return what the module of a function has, by name."""
    while isinstance(function, functools.partial):
        function = function.func
    function = inspect.unwrap(function)
    own = getattr(function, "__globals__", None)
    return own or vars(sys.modules.get(type(function).__module__, builtins))


def _find_class(name: str, known: Mapping[str, Any]) -> Any:
    """Return what a name with or without dots stands for in a module; None for nothing."""
    first, *further = name.split(".")
    value = known.get(first, getattr(builtins, first, None))
    if value is None and further:
        # A module that the function imports when it is called.
        with contextlib.suppress(Exception):  # another's module can raise anything
            return pkgutil.resolve_name(name)
    return functools.reduce(lambda found, part: getattr(found, part, None), further, value)


def _fault(name: str, cls: Any, known: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return what is wrong with the class of an exception, and what is expected."""
    if not (isinstance(cls, type) and issubclass(cls, BaseException)):
        own = [
            key
            for key, value in known.items()
            if isinstance(value, type) and issubclass(value, Exception)
        ]
        expected = "the class of an exception that the module of the function defines or imports"
        return toml_text(name), f"{expected}; {choices(name, own)}" if own else expected
    if limit := next((each for each in _OF_LIMITS if issubclass(cls, each)), None):
        return toml_text(name), f"another exception: {limit.__name__} depends on the machine"
    if wider := next((each for each in _OF_LIMITS if issubclass(each, cls)), None):
        return toml_text(name), f"a narrower class: {wider.__name__} is one of these, too"
    return None
