"""Grid of a run's own, such as the steps of an adaptive solver, and the way to the declared one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.files import FileSnapshot
from uqpen.core.model import Dimension, Output
from uqpen.core.status import Status
from uqpen.core.units import scale

__all__ = ["INTERPOLATIONS", "NO_INTERPOLATION", "FieldSources", "RunGrid", "UnusableOutputError"]

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
    """Grid on which every run has an output in its own way.

    Parameters
    ----------
    names : mapping of str to str
        By dimension of the output, the name under which a run returns its own coordinates.
    units : mapping of str to str
        By dimension, the unit in which it does; else the one in which the dimension is declared.
    interpolation : str
        One of `INTERPOLATIONS`, or `NO_INTERPOLATION`: the run's grid has to be the declared one.
    """

    names: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    interpolation: str = "linear"

    def interpolate(
        self, output: Output, values: FloatArray, coordinates: Mapping[str, FloatArray]
    ) -> FloatArray:
        """Return an output of one run at the declared coordinates.

        Parameters
        ----------
        output : Output
            The output as it is declared.
        values : ndarray
            Its values in the run, an axis for each dimension.
        coordinates : mapping of str to ndarray, shape (step,)
            The run's own coordinates, by dimension, in their units.

        Returns
        -------
        ndarray, shape (*dims)
            NaN beyond the end of a curve that may end.

        Raises
        ------
        UnusableOutputError
            If the run's grid does not ascend or is too short, or a value on it is no number.
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
        self._check_shapes(values, own)
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

    def _check_shapes(self, values: FloatArray, own: FloatArray) -> None:
        if own.ndim != 1:
            text = f'returned a "{self.name}" of shape {own.shape}, not numbers along one dimension'
            raise UnusableOutputError(text)
        if len(values) != len(own):
            text = f'returned {len(values)} values of "{self.output.name}" at {len(own)} of'
            raise UnusableOutputError(f'{text} "{self.name}"')

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


def _previous(own: FloatArray, values: FloatArray, places: FloatArray) -> FloatArray:
    return values[_left(own, places)]


# The ways from a run's own grid to the declared one. Without interpolation, both must be the same.
INTERPOLATIONS: Mapping[str, Callable[[FloatArray, FloatArray, FloatArray], FloatArray]] = {
    "linear": _linear,
    "cubic": _cubic,
    "previous": _previous,
}
NO_INTERPOLATION = "none"


@dataclass(frozen=True)
class FieldSources:
    """Sources of the fields of a model, beside its runs.

    Parameters
    ----------
    grids : mapping of str to RunGrid
        By output, the grid on which every run has it.
    files : tuple of FileSnapshot
        The files with coordinates of dimensions.
    """

    grids: Mapping[str, RunGrid] = field(default_factory=dict)
    files: tuple[FileSnapshot, ...] = ()
