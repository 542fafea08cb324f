"""``along`` of ``[model.outputs]``: the dimensions of an output, with their coordinates."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqpen.core.errors import Problem, SettingsError
from uqpen.core.model import Dimension, Output
from uqpen.core.settings import Context, as_float, count, flag, number, setting, text, validate
from uqpen.core.units import DIMENSIONLESS, scale, si_unit
from uqpen.core.variables import dimension_name_problem
from uqpen.study.table_reader import TableReader

__all__ = ["check_dimensions", "read_field"]

_ALONG = "along"

# Coordinates of one dimension, and values of one run, at most.
_MOST, _MOST_VALUES = 1_000_000, 10_000_000

_COORDINATES = "either from, to and size, or values"


def _read_unit(written: object, context: Context) -> Any:
    if isinstance(written, str):
        si_unit(written)
    return written


def _read_numbers(written: object, context: Context) -> Any:
    return tuple(map(as_float, written)) if isinstance(written, list) else written


def _are_numbers(values: object) -> bool:
    return (
        isinstance(values, tuple)
        and bool(values)
        and all(isinstance(value, float) for value in values)
    )


@dataclass(frozen=True)
class _Coordinates:
    """Coordinates of a dimension as a study states them, in the unit that it names."""

    unit: str = setting(
        "unit",
        'a unit such as "s"',
        lambda unit: isinstance(unit, str),
        read=_read_unit,
        default=DIMENSIONLESS,
    )
    first: float | None = number(key="from", default=None)
    last: float | None = number(key="to", default=None)
    size: int | None = count(minimum=2, maximum=_MOST, default=None)
    values: tuple[float, ...] | None = setting(
        "coordinates", "a list of numbers", _are_numbers, read=_read_numbers, default=None
    )
    long_name: str | None = text(expected="a name for display", default=None)

    def __post_init__(self) -> None:
        validate(self, self._problems())

    def _problems(self) -> Iterator[Problem]:
        by_key = {"from": self.first, "to": self.last, "size": self.size, "values": self.values}
        given = [key for key, value in by_key.items() if value is not None]
        if given not in (["from", "to", "size"], ["values"]):
            yield Problem((), " and ".join(given) or "no coordinates", _COORDINATES)
        elif self.first is not None and self.last is not None and not self.first < self.last:
            yield Problem(("to",), f"{self.last:g}", f"a number above {self.first:g}")

    def dimension(self, name: str) -> Dimension:
        """Return the dimension, in SI units."""
        if self.first is not None and self.last is not None and self.size is not None:
            values = np.linspace(self.first, self.last, self.size)
        else:
            values = np.array(self.values)
        coordinates = scale(self.unit).array_to_si(values).tolist()
        unit = si_unit(self.unit)
        return Dimension(name, unit, self.long_name or "", self.unit, tuple(coordinates))


@dataclass(frozen=True)
class _Field:
    """Settings of an output beside its unit and its dimensions."""

    may_end: bool = flag(default=False)


def read_field(table: TableReader, output: Output, *, takes_fields: bool) -> Output:
    """Return an output with the dimensions that its table declares; mistakes are noted.

    An output with a mistake has no dimensions.
    """
    table.take("unit")
    dims = _read_dimensions(table, takes_fields=takes_fields)
    settings = table.settings(_Field) or _Field()
    table.check_unknown_keys()
    if dims is None:
        return output
    try:
        return replace(output, dims=dims, may_end=settings.may_end)
    except SettingsError as error:
        keys = {"dims": _ALONG, "may_end": "may_end"}
        for problem in error.problems:
            table.add_problem(keys[str(problem.path[0])], problem.found, problem.expected)
    return output


def _read_dimensions(table: TableReader, *, takes_fields: bool) -> tuple[Dimension, ...] | None:
    """Read the dimensions of an output, often none; None where a mistake was noted."""
    along = table.table(_ALONG)
    if not along.is_given:
        return ()
    if not takes_fields:
        expected = "none: only Python models can have such outputs"
        table.add_problem(_ALONG, "dimensions of an output", expected)
        return None
    if not along.content:
        along.add_problem((), "an empty table", "a dimension, such as time")
    found = [_read_dimension(along, name) for name in along]
    dims = tuple(dimension for dimension in found if dimension is not None)
    if (values := math.prod(len(dimension.values) for dimension in dims)) > _MOST_VALUES:
        along.add_problem((), f"{values:_} values", f"at most {_MOST_VALUES:_} in one run")
        return None
    return dims if len(dims) == len(found) else None


def _read_dimension(along: TableReader, name: str) -> Dimension | None:
    """Read a dimension; None where a mistake was noted."""
    if expected := dimension_name_problem(name):
        along.add_wrong(name, name, expected)
        return None
    section = along.table(name, f"a table with a unit and {_COORDINATES}")
    settings = section.whole_settings(_Coordinates) if section.is_given else None
    if settings is None:
        return None
    try:
        return settings.dimension(name)
    except SettingsError as error:
        section.add_refused(error.problems)
    return None


def check_dimensions(
    section: TableReader, outputs: Sequence[Output], variables: Collection[str]
) -> None:
    """Note dimensions with the name of a variable, or with other coordinates than before."""
    known: dict[str, Dimension] = {}
    for output in outputs:
        for dimension in output.dims:
            name, path = dimension.name, (output.name, _ALONG, dimension.name)
            if name in variables:
                found = f'a dimension with the name of the variable "{name}"'
                section.add_problem(path, found, "names that differ")
            elif known.setdefault(name, dimension) != dimension:
                found = f'other coordinates of "{name}" than above'
                section.add_problem(path, found, "the same in all outputs along it")
