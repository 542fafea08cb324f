"""Dimensions of outputs with their coordinates, in ``[model.dimensions]`` or in ``along``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ModelError, Problem, SettingsError, TableError
from uqpen.core.files import FileSnapshot
from uqpen.core.list_reading import as_float
from uqpen.core.model import Dimension
from uqpen.core.setting_fields import Context
from uqpen.core.settings import count, file, number, setting, text, validate
from uqpen.core.units import DIMENSIONLESS, scale, si_unit
from uqpen.core.variables import dimension_name_problem
from uqpen.study.coordinates_file import read_coordinates_file
from uqpen.study.document import inner_table
from uqpen.study.table_reader import TableReader

__all__ = ["DimensionsReader", "ModelCoordinates", "dimensions_from_model"]

# Returns the coordinates that a model's code has under a name, in the unit of the dimension; None
# where nobody knows. A ModelError says that it has none.
ModelCoordinates = Callable[[str], FloatArray | None]

_DIMENSIONS, _FROM_MODEL = "dimensions", "from_model"

# Coordinates of one dimension at most.
_MOST = 1_000_000

_SOURCES = (["from", "to", "size"], ["values"], ["file"], ["file", "column"], [_FROM_MODEL])
_COORDINATES = f"either from, to and size, or values, or file, or {_FROM_MODEL}"

_NO_CODE = "values or a file: only a Python function of a file or a module can be asked"


def _read_unit(written: object, context: Context) -> Any:
    if isinstance(written, str):
        si_unit(written)
    return written


def _read_numbers(written: object, context: Context) -> Any:
    return tuple(map(as_float, written)) if isinstance(written, list) else written


def _are_numbers(values: Any) -> bool:
    is_list = isinstance(values, tuple) and bool(values)
    return is_list and all(isinstance(value, float) for value in values)


def _is_column(value: object) -> bool:
    return type(value) is int or (isinstance(value, str) and bool(value.strip()))


@dataclass(frozen=True)
class _Coordinates:
    """Coordinates of a dimension as a study states them, in the unit that it names."""

    unit: str | None = setting(
        "unit", 'a unit such as "s"', lambda unit: isinstance(unit, str), _read_unit, default=None
    )
    first: float | None = number(key="from", default=None)
    last: float | None = number(key="to", default=None)
    size: int | None = count(minimum=2, maximum=_MOST, default=None)
    values: tuple[float, ...] | None = setting(
        "coordinates", "a list of numbers", _are_numbers, _read_numbers, default=None
    )
    file: Path | None = file(default=None)
    column: str | int | None = setting(
        "column", "the heading of a column, or its position from 0", _is_column, default=None
    )
    from_model: str | None = text(expected="a name in the model's file or module", default=None)
    long_name: str | None = text(expected="a name for display", default=None)

    def __post_init__(self) -> None:
        validate(self, self._problems())

    def _problems(self) -> Iterator[Problem]:
        given = [key for key, value in self._by_key().items() if value is not None]
        if given not in _SOURCES:
            yield Problem((), " and ".join(given) or "no coordinates", _COORDINATES)
        elif self.first is not None and self.last is not None and not self.first < self.last:
            yield Problem(("to",), f"{self.last:g}", f"a number above {self.first:g}")

    def _by_key(self) -> dict[str, Any]:
        ends = {"from": self.first, "to": self.last, "size": self.size}
        rest = (self.values, self.file, self.column, self.from_model)
        return ends | dict(zip(("values", "file", "column", _FROM_MODEL), rest, strict=True))

    def stated(self) -> FloatArray:
        """Return coordinates that the study states itself, in its unit."""
        if self.first is not None and self.last is not None and self.size is not None:
            return np.linspace(self.first, self.last, self.size)
        return np.array(self.values)


class _Found(NamedTuple):
    """Coordinates in SI units, the unit to show them in, and the key and place that they are of."""

    values: FloatArray
    unit: str
    key: str
    place: str = ""


@dataclass(eq=False)
class DimensionsReader:
    """Reader of the dimensions of a model's outputs.

    Parameters
    ----------
    from_model : callable or None
        Asks the model's code for coordinates; None for a model without such code.
    files : dict
        The files with coordinates, by path.
    shared : dict
        The dimensions of ``[model.dimensions]`` by name; None for one with a mistake.
    """

    from_model: ModelCoordinates | None
    files: dict[Path, FileSnapshot] = field(default_factory=dict)
    shared: dict[str, Dimension | None] = field(default_factory=dict)

    def read_shared(self, model: TableReader) -> None:
        """Read the dimensions that several outputs can have; mistakes are noted."""
        section = model.table(_DIMENSIONS)
        self.shared |= {name: self.read(section, name) for name in section}

    def read(self, table: TableReader, name: str) -> Dimension | None:
        """Read a dimension in a table of them; None where it is not known."""
        if expected := dimension_name_problem(name):
            table.add_wrong(name, name, expected)
            return None
        section = table.table(name, f"a table with a unit and {_COORDINATES}")
        settings = section.whole_settings(_Coordinates) if section.is_given else None
        if settings is None:
            return None
        archived = (section.document.objects or {}).get(section.path)
        if isinstance(archived, Dimension):
            return archived
        found = self._find(section, settings)
        if found is None:
            return None
        if len(found.values) > _MOST:
            size = f"{len(found.values):_} coordinates"
            section.add_problem(found.key, size, f"at most {_MOST:_}")
            return None
        unit, title = found.unit, settings.long_name or ""
        try:
            return Dimension(name, si_unit(unit), title, unit, tuple(found.values.tolist()))
        except SettingsError as error:
            _note_refused(section, found, error)
        return None

    def _find(self, section: TableReader, settings: _Coordinates) -> _Found | None:
        """Find the coordinates where the settings say; None where a mistake was noted."""
        unit = settings.unit or DIMENSIONLESS
        if settings.file is not None:
            return self._read_file(section, settings.file, settings.column, settings.unit)
        if settings.from_model is None:
            return _Found(_in_si(settings.stated(), unit), unit, "")
        if self.from_model is None:
            section.add_wrong(_FROM_MODEL, settings.from_model, _NO_CODE)
            return None
        try:
            values = self.from_model(settings.from_model)
        except ModelError as error:
            expected = "coordinates in the model's file or module, or a function that returns them"
            section.add_problem(_FROM_MODEL, str(error), expected)
            return None
        if values is None:
            return None
        return _Found(_in_si(values, unit), unit, _FROM_MODEL, f'"{settings.from_model}"')

    def _read_file(
        self, section: TableReader, path: Path, column: str | int | None, unit: str | None
    ) -> _Found | None:
        try:
            found = read_coordinates_file(path, column, unit)
        except TableError as error:
            expected = "a CSV, NetCDF or blank-separated file with a column of coordinates"
            section.add_problem("file", str(error), expected)
            return None
        self.files[path] = found.file
        return _Found(found.values, found.unit, "file", found.place)


def dimensions_from_model(model: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the paths, in the table of a model, of dimensions whose coordinates its code has."""
    for path in [
        (_DIMENSIONS,),
        *(("outputs", name, "along") for name in inner_table(model, "outputs")),
    ]:
        for name, declared in inner_table(model, *path).items():
            if isinstance(declared, dict) and _FROM_MODEL in declared:
                yield (*path, str(name))


def _in_si(values: FloatArray, unit: str) -> FloatArray:
    return np.asarray(scale(unit).array_to_si(values))


def _note_refused(section: TableReader, found: _Found, error: SettingsError) -> None:
    """Note coordinates that make no dimension: those that the study does not state by place."""
    if not found.place:
        section.add_refused(error.problems)
        return
    for problem in error.problems:
        place = problem.path[-1]
        shown = "no coordinate"
        if isinstance(place, int):
            shown = f"{scale(found.unit).from_si(found.values[place]):.10g} at position {place}"
        section.add_problem(found.key, f"{shown} of {found.place}", problem.expected)
