"""Outputs in what a function of the user returned, and grids of a run's own that they are on."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray, floats
from uqpen.core.errors import QuantityError
from uqpen.core.files import FileSnapshot
from uqpen.core.model import Dimension, Output
from uqpen.core.status import Status
from uqpen.core.units import are_convertible, scale

# Programs print their coordinates with a few digits. So a run's grid may end before the declared
# one, or differ from it, by this part of the whole length.
_ROUNDING = 1e-6


class UnusableOutputError(Exception):
    """Returned value that is no result; the message is a run's reason, `status` its status."""

    def __init__(self, reason: str, status: Status = Status.FAILED) -> None:
        super().__init__(reason)
        self.status = status


@dataclass(frozen=True)
class RunGrid:
    """Grid on which every run has an output in its own way."""

    # By dimension of the output, the name under which a run returns its own coordinates.
    names: Mapping[str, str]
    # By dimension, the unit in which it does; else the one in which the dimension is declared.
    units: Mapping[str, str] = field(default_factory=dict)
    # One of `INTERPOLATIONS`, or `NO_INTERPOLATION`: the run's grid has to be the declared one.
    interpolation: str = "linear"

    def interpolate(
        self, output: Output, values: FloatArray, coordinates: Mapping[str, FloatArray]
    ) -> FloatArray:
        """Return an output of one run at the declared coordinates, of shape (*dims).

        It has values along the run's own coordinates, by dimension, in their units. The result is
        NaN beyond the end of a curve that may end.

        UnusableOutputError if the run's grid does not ascend or is too short, or a value on it is
        no number.
        """
        for axis, dimension in enumerate(output.dims):
            if dimension.name not in self.names:
                continue
            line = _Line(output, dimension, self.names[dimension.name])
            measure = scale(self.units.get(dimension.name, dimension.preferred_unit))
            own = np.asarray(measure.array_to_si(coordinates[dimension.name]))
            found = line.at_coordinates(np.moveaxis(values, axis, 0), own, self.interpolation)
            values = np.moveaxis(found, 0, axis)
        return values


class _Line(NamedTuple):
    """Dimension of an output along which a run has a grid of its own, returned under a name."""

    output: Output
    dimension: Dimension
    name: str

    def at_coordinates(self, values: FloatArray, own: FloatArray, interpolation: str) -> FloatArray:
        """Return values along a first axis at the declared coordinates; `own` is in SI units."""
        if own.ndim != 1:
            text = f'returned a "{self.name}" of shape {own.shape}, not numbers along one dimension'
            raise UnusableOutputError(text)
        if len(values) != len(own):
            text = f'returned {len(values)} values of "{self.output.name}" at {len(own)} of'
            raise UnusableOutputError(f'{text} "{self.name}"')
        if self.output.may_end:
            steps = int(np.flatnonzero(~np.isnan(values)).max(initial=-1)) + 1
            values, own = values[:steps], own[:steps]
        self._check_numbers(values, own)
        # Of equal coordinates, as at a step of an input, the last one counts.
        is_last = np.append(own[1:] > own[:-1], True)
        values, own = values[is_last], own[is_last]
        wanted = np.array(self.dimension.values)
        margin = _ROUNDING * (wanted[-1] - wanted[0])
        found = np.full((len(wanted), *values.shape[1:]), np.nan)
        if interpolation == NO_INTERPOLATION:
            self._check_equal(own, wanted, margin)
            found[: len(own)] = values
            return found
        self._check_range(own, wanted, margin)
        is_there = wanted <= own[-1] + margin
        places = np.clip(wanted[is_there], own[0], own[-1])
        found[is_there] = INTERPOLATIONS[interpolation](own, values, places)
        return found

    def _check_numbers(self, values: FloatArray, own: FloatArray) -> None:
        """Refuse a grid without an entry, that descends, or with a value that is no number."""
        if not len(own):
            raise UnusableOutputError(f'returned no value of "{self.output.name}"')
        wrong = ~np.isfinite(own)
        wrong[1:] |= own[1:] < own[:-1]
        if wrong.any():
            step = int(wrong.argmax())
            before = f" after {self.dimension.place_text(own[step - 1])}" if step else ""
            place = f"{self.dimension.place_text(own[step])}{before}"
            raise UnusableOutputError(f'returned a "{self.name}" that does not ascend: {place}')
        invalid = ~np.isfinite(values).reshape(len(own), -1)
        if invalid.any():
            step = int(invalid.any(axis=1).argmax())
            value = values.reshape(len(own), -1)[step, int(invalid[step].argmax())]
            place = self.dimension.place_text(own[step])
            reason = f'{self.output.name} is {value} at {place} of its own "{self.name}"'
            raise UnusableOutputError(reason, Status.NOT_FINITE)

    def _check_range(self, own: FloatArray, wanted: FloatArray, margin: float) -> None:
        if wanted[0] < own[0] - margin:
            self._refuse(wanted[0], f'its own "{self.name}" begins', own[0])
        if wanted[-1] > own[-1] + margin and not self.output.may_end:
            first = wanted[wanted > own[-1] + margin][0]
            self._refuse(first, f'its own "{self.name}" ends', own[-1])

    def _check_equal(self, own: FloatArray, wanted: FloatArray, margin: float) -> None:
        if len(own) > len(wanted) or (len(own) < len(wanted) and not self.output.may_end):
            text = f'returned a "{self.name}" of {len(own)} coordinates, not {len(wanted)}'
            raise UnusableOutputError(text)
        differs = np.abs(own - wanted[: len(own)]) > margin
        if differs.any():
            position = int(differs.argmax())
            self._refuse(wanted[position], f'"{self.name}" has another place', own[position])

    def _refuse(self, wanted: float, found: str, own: float) -> None:
        there = self.dimension.place_text(wanted)
        text = f"{self.output.name} is not there at {there}: {found}"
        raise UnusableOutputError(f"{text} at {self.dimension.place_text(own)}")


def _left(own: FloatArray, places: FloatArray) -> IntArray:
    """Return the last step at or before each place."""
    return np.searchsorted(own, places, side="right") - 1


def _linear(own: FloatArray, values: FloatArray, places: FloatArray) -> FloatArray:
    left = _left(own, places)
    right = np.minimum(left + 1, len(own) - 1)
    length = np.where(right > left, own[right] - own[left], 1.0)
    weight = ((places - own[left]) / length).reshape(-1, *[1] * (values.ndim - 1))
    return values[left] * (1 - weight) + values[right] * weight


def _cubic(own: FloatArray, values: FloatArray, places: FloatArray) -> FloatArray:
    from scipy.interpolate import PchipInterpolator

    left = _left(own, places)
    if len(own) < 2:
        return values[left]
    found = PchipInterpolator(own, values, axis=0)(places)
    is_step = own[left] == places  # where a polynomial would round
    found[is_step] = values[left[is_step]]
    return np.asarray(found)


# The ways from a run's own grid to the declared one. Without interpolation, both must be the same.
INTERPOLATIONS: Mapping[str, Callable[[FloatArray, FloatArray, FloatArray], FloatArray]] = {
    "linear": _linear,
    "cubic": _cubic,
    "previous": lambda own, values, places: values[_left(own, places)],
}
NO_INTERPOLATION = "none"


@dataclass(frozen=True)
class FieldSources:
    """Sources of the fields of a model, beside its runs."""

    # By output, the grid on which every run has it.
    grids: Mapping[str, RunGrid] = field(default_factory=dict)
    files: tuple[FileSnapshot, ...] = ()  # the files with coordinates of dimensions


# Labelled arrays that a model returns, put into the declared order by their labels.

# Coordinates are the same if they differ by this part of the whole length, as after a change of
# units.
_SAME_PLACE = 1e-9


def in_declared_order(value: Any, output: Output, own: Collection[str] = ()) -> Any:
    """Return a labelled array in the order of an output's dimensions and of their coordinates.

    Anything else stays as it is. Further dimensions come before those of the output. Along some
    dimensions, the run may have a grid of its `own`.

    UnusableOutputError if the array has coordinates along a declared dimension, and these are
    others than declared.
    """
    declared = [dimension.name for dimension in output.dims]
    names = getattr(value, "dims", ())
    is_labelled = hasattr(value, "transpose") and isinstance(names, tuple)
    if not declared or not is_labelled or not set(declared) <= set(names):
        return value
    for dimension in output.dims:
        if dimension.name in own or dimension.name not in getattr(value, "coords", ()):
            continue
        coordinates = value.coords[dimension.name]
        if coordinates.dtype.kind not in "iuf":
            continue  # names of places, which only their order can mean
        found = _in_si(coordinates, dimension, output)
        if len(found) == len(dimension.values):  # otherwise the shape is refused
            value = value.isel({dimension.name: _declared_positions(found, dimension, output)})
    return value.transpose(..., *declared)


def _in_si(coordinates: Any, dimension: Dimension, output: Output) -> FloatArray:
    """Return coordinates in SI units, from their attribute ``units`` or the declared unit."""
    declared = dimension.preferred_unit
    unit = str(coordinates.attrs.get("units", declared))
    try:
        if not are_convertible(unit, declared):
            raise QuantityError(f"the unit {unit}", f"one that converts to {declared}")
        return np.asarray(scale(unit).array_to_si(np.asarray(coordinates.values, dtype=np.float64)))
    except QuantityError as error:
        text = f'returned a "{output.name}" whose {dimension.name} is refused: {error}'
        raise UnusableOutputError(text) from None


def _declared_positions(found: FloatArray, dimension: Dimension, output: Output) -> IntArray:
    """Return where the array has each of the declared coordinates."""
    wanted = np.array(dimension.values)
    order = np.argsort(found, kind="stable")
    margin = _SAME_PLACE * (wanted[-1] - wanted[0] or abs(wanted[0]))
    is_same = np.abs(found[order] - wanted) <= margin
    if not is_same.all():
        position = int(is_same.argmin())
        place, other = (dimension.place_text(each[position]) for each in (wanted, found[order]))
        text = f"{output.name} is not there at {place}: its own coordinates have {other}"
        raise UnusableOutputError(text)
    return order


# Names in a message; a study may have hundreds of outputs.
_MOST_NAMED = 4

_NO_GRIDS: Mapping[str, RunGrid] = {}


def extract_outputs(
    returned: object,
    outputs: Sequence[Output],
    runs: int | None,
    grids: Mapping[str, RunGrid] = _NO_GRIDS,
) -> dict[str, FloatArray]:
    """Return the declared outputs in the value that a function returned, in its units.

    The `runs` are those of a vectorised call, None for a call that makes one run.

    UnusableOutputError if an output is missing, is not of numbers, or has another shape than
    declared.
    """
    if not isinstance(returned, Mapping):
        text = f"returned {type(returned).__name__}, not a mapping of outputs"
        raise UnusableOutputError(f"{text}; expected {_example(outputs, runs)}")
    found = {}
    for output in outputs:
        grid = grids.get(output.name)
        values = _numbers(returned, output.name, output, grid.names if grid else ())
        if grid:
            own = {name: _numbers(returned, key) for name, key in grid.names.items()}
            shape = tuple(
                values.shape[axis] if dim.name in own and axis < values.ndim else len(dim.values)
                for axis, dim in enumerate(output.dims)
            )
            _check_shape(output, values, shape, runs)
            found[output.name] = grid.interpolate(output, values, own)
        else:
            shape = output.shape if runs is None else (runs, *output.shape)
            _check_shape(output, values, shape, runs)
            found[output.name] = values
    return found


def _numbers(
    returned: Mapping[Any, Any], name: str, output: Output | None = None, own: Collection[str] = ()
) -> FloatArray:
    if name not in returned:
        others = [f'"{key}"' for key in returned]
        listing = ", ".join([*others[:_MOST_NAMED], *["…"] * (len(others) > _MOST_NAMED)])
        raise UnusableOutputError(f'returned no "{name}"{f", but {listing}" * bool(others)}')
    value = returned[name]
    try:
        return floats(value if output is None else in_declared_order(value, output, own))
    except ValueError as error:
        raise UnusableOutputError(f'returned a "{name}" of {error}') from None


def _check_shape(
    output: Output, values: FloatArray, shape: tuple[int, ...], runs: int | None
) -> None:
    if values.shape != shape:
        names = ["run"] * (runs is not None) * bool(output.dims)
        expected = f"{shape}{dimension_names(output, *names)}"
        text = f'returned a "{output.name}" of shape {values.shape}, not {expected}'
        # The expected form of a number; that of a field is in its dimensions.
        hint = "; expected one number; an output with several is declared with along"
        if output.dims:
            hint = ""
        elif runs is not None:
            hint = "; expected an array with a number for each run"
        elif values.size == 1:
            hint = f"; expected one number, such as {output.name}.item()"
        raise UnusableOutputError(text + hint)


def _example(outputs: Sequence[Output], runs: int | None) -> str:
    """Return an example of what a function returns, in Python."""
    pairs = [f'"{output.name}": {output.name}' for output in outputs[:_MOST_NAMED]]
    pairs += ["…"] * (len(outputs) > _MOST_NAMED)
    of_each = " with arrays along the runs" if runs is not None else ""
    return f"return {{{', '.join(pairs)}}}{of_each}"


def dimension_names(output: Output, *before: str) -> str:
    """Return the names of the dimensions of a field, in brackets; empty for a number."""
    if not output.dims:
        return ""
    return f" along ({', '.join([*before, *(dimension.name for dimension in output.dims)])})"
