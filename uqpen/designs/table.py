"""Given points, read from a file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import ColumnFile, read_columns
from uqpen.core.errors import TableError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import WEIGHT
from uqpen.core.lookup import choices
from uqpen.core.sampling import Sampling
from uqpen.core.settings import file, flag
from uqpen.core.streams import Stream
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.design import Design, Rounds
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset


@dataclass(frozen=True)
class TableDesign(Design):
    """Points from a CSV or NetCDF file, a column (or variable) for each input they vary.

    A column is headed ``name [unit]``, without brackets where the input has no unit; in NetCDF the
    variable's ``units`` say it. A column wins over the study's own value of that input. A column
    ``weight``, where no input has this name, gives the relative weights of the points: the ratio
    of the density of the study's inputs to the density that the points were drawn from.

    Parameters
    ----------
    file : Path
        Ends in ``.nc`` for NetCDF; anything else is read as CSV.
    independent : bool
        Whether the points are independent draws from the joint distribution of interest, so that
        statistics have an interval; for other points no error can be estimated.
    """

    file: Path = file()
    independent: bool = flag(default=False)

    @property
    def sampling(self) -> Sampling:
        return Sampling.INDEPENDENT if self.independent else Sampling.GIVEN

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        columns = self.columns(joint)
        weights = self._weights(joint)
        coordinates = {} if weights is None else {WEIGHT: weights}
        yield points_dataset(joint, columns, coordinates, runs=len(next(iter(columns.values()))))

    def samples_inputs(self, joint: JointDistribution) -> bool:
        random = {entry.variable.name for entry in joint.random}
        return self.independent and set(self.columns(joint)) <= random

    def run_count(self, joint: JointDistribution) -> int:
        return len(next(iter(self.columns(joint).values())))

    def columns(self, joint: JointDistribution) -> dict[str, FloatArray]:
        """Return the columns of the table in SI units.

        Raises
        ------
        TableError
            If it cannot be read, or a column is no input, has the wrong unit or no number, or a
            weight is below 0.
        """
        known = {variable.name: variable for variable in joint.variables}
        columns: dict[str, FloatArray] = {}
        self._weights(joint)
        for column in self._file.columns:
            name = column.name
            if name == WEIGHT and name not in known:
                continue
            if name not in known:
                raise TableError(f'column "{name}" is no input; {choices(name, known)}')
            if name in columns:
                raise TableError(f'column "{name}" stands twice')
            columns[name] = column.values(known[name].unit)
            if len({len(values) for values in columns.values()}) > 1:
                raise TableError(f'column "{name}" differs in length from those before')
        if not columns or not len(next(iter(columns.values()))):
            raise TableError(f'"{self.file.name}" has no rows of points')
        for entry in joint.random:
            if entry.variable.name not in columns:
                raise TableError(f'no column "{entry.variable.name}", an input that is random')
        return columns

    def _weights(self, joint: JointDistribution) -> FloatArray | None:
        """Return the relative weight of each point; None where the table has none."""
        columns = [column for column in self._file.columns if column.name == WEIGHT]
        if not columns or any(variable.name == WEIGHT for variable in joint.variables):
            return None
        if len(columns) > 1:
            raise TableError(f'column "{WEIGHT}" stands twice')
        weights = columns[0].values(DIMENSIONLESS)
        if weights.min(initial=0.0) < 0:
            found = f"{weights.min():g}"
            raise TableError(f'column "{WEIGHT}": found {found}, expected weights of 0 or more')
        if weights.size and not weights.max() > 0:
            raise TableError(f'column "{WEIGHT}": found 0 everywhere, expected some weight above 0')
        return weights

    def files(self) -> tuple[FileSnapshot, ...]:
        return (self._file.file,)

    @cached_property
    def _file(self) -> ColumnFile:
        """Table in the file; read once, so that it cannot change during a study."""
        return read_columns(self.file)
