"""Points of the user's own, read from a file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from uqpen.columns import Sheet, read_columns
from uqpen.designs.design import Design, Rounds
from uqpen.errors import TableError
from uqpen.files import FileRead
from uqpen.inputs.law import InputLaw, points_dataset
from uqpen.labels import Sampling
from uqpen.lookup import choices
from uqpen.settings import file, flag
from uqpen.streams import Stream

__all__ = ["Table"]


@dataclass(frozen=True)
class Table(Design):
    """Points from a CSV or NetCDF file, a column (or variable) for each input they vary.

    A column is headed ``name [unit]``, without brackets where the input has no unit; in NetCDF the
    variable's ``units`` say it. A column wins over the study's own value of that input.

    Parameters
    ----------
    file : Path
        Ends in ``.nc`` for NetCDF; anything else is read as CSV.
    independent : bool
        Whether the points are independent draws from the law of interest, which gives statistics
        an interval; of other points no error can be told.
    """

    file: Path = file()
    independent: bool = flag(default=False)

    @property
    def sampling(self) -> Sampling:
        return Sampling.INDEPENDENT if self.independent else Sampling.GIVEN

    def rounds(self, law: InputLaw, stream: Stream) -> Rounds:
        columns = self.columns(law)
        yield points_dataset(law, columns, {}, runs=len(next(iter(columns.values()))))

    def follows(self, law: InputLaw) -> bool:
        random = {entry.variable.name for entry in law.random}
        return self.independent and set(self.columns(law)) <= random

    def size(self, law: InputLaw) -> int:
        return len(next(iter(self.columns(law).values())))

    def columns(self, law: InputLaw) -> dict[str, npt.NDArray[np.float64]]:
        """The table's columns in SI units.

        Raises
        ------
        TableError
            If it cannot be read, or a column is no input, has the wrong unit or no number.
        """
        known = {variable.name: variable for variable in law.variables}
        columns: dict[str, npt.NDArray[np.float64]] = {}
        for column in self._read.columns:
            name = column.name
            if name not in known:
                raise TableError(f'column "{name}" is no input; {choices(name, known)}')
            if name in columns:
                raise TableError(f'column "{name}" stands twice')
            columns[name] = column.values(known[name].unit)
            if len({len(values) for values in columns.values()}) > 1:
                raise TableError(f'column "{name}" differs in length from those before')
        if not columns or not len(next(iter(columns.values()))):
            raise TableError(f'"{self.file.name}" has no rows of points')
        for entry in law.random:
            if entry.variable.name not in columns:
                raise TableError(f'no column "{entry.variable.name}", an input that is random')
        return columns

    def files(self) -> tuple[FileRead, ...]:
        return (self._read.file,)

    @cached_property
    def _read(self) -> Sheet:
        """The table as it stands in the file; read once, so that it cannot change in mid-study."""
        return read_columns(self.file)
