"""Points of runs that a data file contains."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import AGREEMENT, CONTRADICTION, DEPENDENCE, REPLICATE, WEIGHT
from uqpen.core.model import Results
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count, flag
from uqpen.core.streams import Stream
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
        if WEIGHT not in coordinates:
            contradiction = self._contradiction_text(joint)
            texts = {
                AGREEMENT: self._agreement_text(joint),
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

    def _agreement_text(self, joint: JointDistribution) -> str:
        """Say how well its points follow the distributions that the study states."""
        points, is_drawn = self.columns(joint), self.sampling is Sampling.INDEPENDENT
        found = [_text(each, is_drawn=is_drawn) for each in input_agreements(joint, points)]
        texts = [f"Kolmogorov's distance from [inputs]: {', '.join(found)}"] if found else []
        if pair := largest_correlation(joint, points):
            texts.append(f"largest rank correlation: {_text(pair, is_drawn=is_drawn)}")
        return "; ".join(texts)

    def _contradiction_text(self, joint: JointDistribution) -> str:
        """Say how its points contradict a stated independence, if they are claimed to be draws."""
        if self.sampling is Sampling.GIVEN:
            return ""
        pair = largest_correlation(joint, self.columns(joint))
        if pair is None or not pair.contradicts_independence:
            return ""
        return f"the rank correlation of {_text(pair, is_drawn=True)}"


def _text(found: Agreement, *, is_drawn: bool) -> str:
    """Return a comparison as text; it has a p value where the points are independent draws."""
    text = f"{' and '.join(found.inputs)} {found.value:.3f}".replace("-", "−")
    p_value = f"p = {found.p_value:.2g}" if found.p_value >= 1e-4 else "p < 0.0001"
    return f"{text} ({p_value})" if is_drawn else text
