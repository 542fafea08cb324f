"""Points from a file: those of a table, and those of runs that a data file contains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import ColumnFile, read_columns
from uqpen.core.errors import Problem, TableError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import (
    AGREEMENT,
    CODED_INPUTS,
    CONTRADICTED_DISTRIBUTIONS,
    CONTRADICTION,
    DEPENDENCE,
    DISTANT_VALUES,
    DROPPED_ROWS,
    REPLICATE,
    WEIGHT,
)
from uqpen.core.lookup import choices
from uqpen.core.model import Results
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count, file, flag
from uqpen.core.streams import Stream
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.design import Design, Rounds
from uqpen.distributions.joint_distribution import (
    Agreement,
    JointDistribution,
    input_agreements,
    largest_correlation,
    points_dataset,
)
from uqpen.execution.batch import BatchResult
from uqpen.models.data.data_model import DataModel

# Given points, read from a file.


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


_INDEPENDENT = "monte-carlo"


@dataclass(frozen=True)
class DataDesign(Design):
    """Points of the runs in the data file that a study has in place of a model.

    Parameters
    ----------
    follows : str, optional
        The design that the points were drawn by: ``"monte-carlo"`` (independent draws from the
        joint distribution of interest), ``"latin-hypercube"``, ``"sobol-sequence"`` or
        ``"halton"``. A column ``replicate`` of the file numbers independent sets of them. If it is
        not known, no error can be estimated.
    independent : bool
        True for independent draws, as ``follows = "monte-carlo"``.
    first, last : int
        Numbers of the first and the last of its rows in the file, from 1; all of them by default.
    model : DataModel, optional
        The runs; a study gives them.
    """

    follows: str | None = choice(
        _INDEPENDENT, "latin-hypercube", "sobol-sequence", "halton", default=None
    )
    independent: bool = flag(default=False)
    first: int = count(default=1)
    last: int | None = count(default=None)
    model: DataModel | None = field(default=None, compare=False, repr=False)

    def check_settings(self) -> Iterator[Problem]:
        if self.independent and self.follows not in (None, _INDEPENDENT):
            found = f'independent = true with follows = "{self.follows}"'
            expected = f'independent = true or follows = "{self.follows}", not both'
            yield Problem(("independent",), found, expected)
        if self.last is not None and self.last < self.first:
            yield Problem(("last",), f"{self.last}", f"{self.first} or more, as first is")

    def check_model(self) -> Iterator[Problem]:
        """Yield the problems between its settings and the runs of the file."""
        runs, weighted = self._data.runs, WEIGHT in self._data.coordinates
        for key, row in (("first", self.first), ("last", self.last)):
            if row is not None and row > runs:
                yield Problem((key,), f"{row}", f"at most {runs}, the rows of {self._data.name}")
        if weighted and self.sampling is Sampling.STRATIFIED:
            found = f'"{self.follows}" with a column "{WEIGHT}" in {self._data.name}'
            yield Problem(
                ("follows",), found, f'"{_INDEPENDENT}": weights are of independent draws'
            )

    @property
    def sampling(self) -> Sampling:
        if self.independent or self.follows == _INDEPENDENT:
            return Sampling.INDEPENDENT
        return Sampling.STRATIFIED if self.follows else Sampling.GIVEN

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        columns = self.columns(joint)
        coordinates = {name: self._rows(each) for name, each in self._data.coordinates.items()}
        if self.sampling is not Sampling.STRATIFIED:
            coordinates.pop(REPLICATE, None)
        points = points_dataset(joint, columns, coordinates, runs=self.run_count(joint))
        if REPLICATE in coordinates:
            points[REPLICATE] = points[REPLICATE].astype(np.int64)
        stated = {
            DROPPED_ROWS: self._data.dropped,
            CODED_INPUTS: self._data.coded,
            DISTANT_VALUES: "; ".join(self._data.distant),
        }
        points.attrs |= {key: text for key, text in stated.items() if text}
        if WEIGHT not in coordinates:
            contradiction = self._contradiction_text(joint)
            agreements = list(input_agreements(joint, self.columns(joint)))
            texts = {
                AGREEMENT: self._agreement_text(joint, agreements),
                CONTRADICTED_DISTRIBUTIONS: self._other_inputs_text(agreements),
                CONTRADICTION: contradiction,
                # The statistics of these runs are those of inputs that depend on each other.
                DEPENDENCE: contradiction,
            }
            points.attrs |= {key: text for key, text in texts.items() if text}
        yield points

    def columns(self, joint: JointDistribution) -> dict[str, FloatArray]:
        """Return its points, an array of shape (run,) in SI units for each input."""
        return {name: self._rows(each) for name, each in self._data.points.items()}

    def samples_inputs(self, joint: JointDistribution) -> bool:
        random = {entry.variable.name for entry in joint.random}
        return self.sampling is not Sampling.GIVEN and set(self._data.points) <= random

    @property
    def replicate_count(self) -> int:
        replicates = self._data.coordinates.get(REPLICATE)
        if replicates is None or self.sampling is not Sampling.STRATIFIED:
            return 1
        return len(np.unique(self._rows(replicates)))

    def run_count(self, joint: JointDistribution) -> int:
        return (self.last or self._data.runs) - self.first + 1

    def files(self) -> tuple[FileSnapshot, ...]:
        return self._data.files()

    @property
    def results(self) -> Results:
        """Results of its runs."""
        whole = BatchResult(0, self._data.results)
        return whole.between(self.first - 1, self.last or self._data.runs).results

    @property
    def _data(self) -> DataModel:
        if self.model is None:
            raise TypeError("a DataDesign has points only in a study of a data file")
        return self.model

    def _rows(self, column: FloatArray) -> FloatArray:
        return column[self.first - 1 : self.last]

    def _agreement_text(self, joint: JointDistribution, agreements: Sequence[Agreement]) -> str:
        """Say how well its points follow the distributions that the study states."""
        is_drawn = self.sampling is Sampling.INDEPENDENT
        found = [_text(each, is_drawn=is_drawn) for each in agreements]
        texts = [f"Kolmogorov's distance from [inputs]: {', '.join(found)}"] if found else []
        if pair := largest_correlation(joint, self.columns(joint)):
            texts.append(f"largest rank correlation: {_text(pair, is_drawn=is_drawn)}")
        return "; ".join(texts)

    def _other_inputs_text(self, agreements: Sequence[Agreement]) -> str:
        """Say which distributions its points contradict, if they are claimed to be draws."""
        if self.sampling is not Sampling.INDEPENDENT:
            return ""
        return ", ".join(_text(each, is_drawn=True) for each in agreements if each.is_contradiction)

    def _contradiction_text(self, joint: JointDistribution) -> str:
        """Say how its points contradict a stated independence, if they are claimed to be draws."""
        if self.sampling is Sampling.GIVEN:
            return ""
        pair = largest_correlation(joint, self.columns(joint))
        if pair is None or not pair.is_contradiction:
            return ""
        return f"the rank correlation of {_text(pair, is_drawn=True)}"


def _text(found: Agreement, *, is_drawn: bool) -> str:
    """Return a comparison as text; it has a p value where the points are independent draws."""
    text = f"{' and '.join(found.inputs)} {found.value:.3f}".replace("-", "−")
    p_value = f"p = {found.p_value:.2g}" if found.p_value >= 1e-4 else "p < 0.0001"
    return f"{text} ({p_value})" if is_drawn else text
