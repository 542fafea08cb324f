"""User-defined analyses: functions in a study's files that yield statistics."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from uqpen.core.catalogue import CATALOGUE, NAMES_IN_USE
from uqpen.core.errors import Problem, StudyError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import NAME
from uqpen.core.statistic import RECORD_NUMBERS, RECORD_WORDS, Shown, Statistic, UnitRule
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_module import failure_text

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.statistics.quantity_of_interest import QuantityOfInterest
    from uqpen.statistics.sample import Sample

# The beginning of the names of what SALib does, which is built in.
SALIB = "salib:"

# The words of labels.
_ENTRY = ("{entry}",)

Analysis: TypeAlias = "Callable[[Sample, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]"


@dataclass(frozen=True)
class UserDefinedAnalysis:
    """User-defined function that yields statistics of an output."""

    # ``"file.py:function"`` or ``"package.module:function"``, as the study has it; of SALib
    # ``"salib:<name>"``.
    reference: str
    # Takes a `Sample` and a `QuantityOfInterest`, and yields names with estimate arrays.
    function: Analysis = field(compare=False)
    # The context in which the function must be called.
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)

    @property
    def is_built_in(self) -> bool:
        """True for an analysis of SALib, whose statistics are in the catalogue."""
        return self.reference.startswith(SALIB)

    @property
    def takes_weights(self) -> bool:
        """True if the function uses weights, as its attribute of this name states."""
        return bool(getattr(self.function, "takes_weights", False))

    @property
    def records(self) -> tuple[Any, ...]:
        """The records of its statistics that the function's attribute ``record`` has, unchecked."""
        found = getattr(self.function, "record", ())
        return tuple(found) if isinstance(found, tuple | list) else (found,)

    @property
    def record_fault(self) -> tuple[str, str] | None:
        """The first fault of its records, and what they can have; None without any."""
        names = [getattr(each, "name", "") for each in self.records]
        for record, name in zip(self.records, names, strict=True):
            if not isinstance(record, Statistic):
                kind = type(record).__name__
                return f"a record of type {kind}", "a uqpen.core.statistic.Statistic, or several"
            if not isinstance(name, str) or not NAME.match(name) or name in NAMES_IN_USE:
                return f"a record of {name!r}", "a name that archives do not use themselves"
            if name in CATALOGUE or names.count(name) > 1:
                return f"a record of {name!r}", "a name that no other statistic has"
            if fault := _record_fault(record):
                return f"the record of {name} with {fault[0]}", fault[1]
        return None

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return the files that it has been loaded from, as they were."""
        return self.surroundings.files() if self.surroundings else ()

    def __call__(self, sample: Sample, quantity: QuantityOfInterest) -> list[Any]:
        """Return everything that the function yields, unchecked.

        Raises
        ------
        StudyError
            If it raises anything.
        """
        place = self.surroundings.on_import_path() if self.surroundings else None
        try:
            with place or contextlib.nullcontext():
                return list(self.function(_read_only(sample), quantity))
        except (Exception, SystemExit) as error:  # a user's function can raise anything
            found = failure_text(error, self.function)
            raise self.error(quantity, found, "statistics") from None

    def error(self, quantity: QuantityOfInterest, found: str, expected: str) -> StudyError:
        """Return the error for invalid statistics of an output."""
        what = f"{self.reference} of {quantity.output.name}: {found}"
        problem = Problem(("analyses",), what, expected)
        return StudyError(str(problem), [problem])


def _record_fault(record: Statistic) -> tuple[str, str] | None:
    """Return the fault of what a record has, and what it can have; None without any."""
    shown = record.shown
    for name in RECORD_WORDS:
        if not isinstance(text := getattr(shown, name), str):
            return f"{name} {text!r}", "a text"
        known = ("{entry}", "{label}", "{output}", "{estimate}") if name == "sentence" else _ENTRY
        for word in re.findall(r"\{[^{}]*\}", text):
            if word not in known:
                return f"the word {word} in its {name}", f"the words {', '.join(known)}"
    if not shown.label or "{estimate}" not in shown.sentence:
        return "too few words", "a label, and a sentence with {estimate}"
    for name in RECORD_NUMBERS:
        if not isinstance(number := getattr(shown, name), int):
            return f"{name} {number!r}", "a whole number, or True"
    if not isinstance(record.unit, UnitRule) or len(record.dims) > 1:
        return "another unit or more dimensions", "a UnitRule, and one dimension at most"
    words = {name: getattr(shown, name) for name in (*RECORD_WORDS, *RECORD_NUMBERS)}
    plain = Statistic(record.name, record.title, record.dims, record.unit)
    if record != replace(plain, shown=replace(Shown(), **words)):
        allowed = f"name, title, dims, unit and, of what is shown, {', '.join(words)}"
        return "what built-in statistics alone have", allowed
    return None


def _read_only(sample: Sample) -> Sample:
    """Return a sample whose arrays an analysis cannot change; those of inputs never can be."""
    views = {
        name: getattr(sample, name).view() for name in ("values", "used", "missing", "replicates")
    }
    for view in views.values():
        view.flags.writeable = False
    return replace(sample, **views)
