"""Experiments that a model is compared with: their conditions, and the rows measured in them."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import MEASURED_CONDITION, MEASURED_ROW
from uqpen.measurements.errors import MeasuredOutput, RowErrors
from uqpen.measurements.likelihood import Likelihood

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class MeasuredOutputs:
    """A section ``[measured.<name>]``: experiments, and what was measured in each.

    Rows of equal conditions are one experiment. Its values are in SI units.
    """

    name: str
    unknown: tuple[str, ...]  # inputs that have one value, which the measurements teach
    varies: tuple[str, ...]  # inputs that have another value in each experiment
    fixed: tuple[str, ...]  # random inputs that are held at their medians
    conditions: Mapping[str, FloatArray]  # (experiment,): inputs that are known for each
    condition_std: Mapping[str, FloatArray]  # (experiment,): of those that have an error
    outputs: tuple[MeasuredOutput, ...]
    experiments: int
    source: str = ""  # where they were published
    file: FileSnapshot | None = None
    # Experiments of the rows in which nothing was measured, or that are held out: their values are
    # NaN, and their errors have the numbers that are not known, nothing else.
    blank: MeasuredOutputs | None = None
    # The rows that are held out, in the experiments of those; and all rows. None for none held out.
    left_out: MeasuredOutputs | None = None
    whole: MeasuredOutputs | None = None

    def without_discrepancy(self) -> MeasuredOutputs:
        """Return the same experiments, in which the model has no error of its own."""
        outputs = (
            replace(each, errors=replace(each.errors, discrepancy=None)) for each in self.outputs
        )
        blank = self.blank and self.blank.without_discrepancy()
        return replace(self, outputs=tuple(outputs), blank=blank)

    @property
    def row_hashes(self) -> list[str]:
        """Hashes of its rows by value, so that the same data are known in another file or order."""
        found = []
        for each in self.outputs:
            for row, value in enumerate(each.values):
                at = each.experiment[row]
                numbers = {name: values[at] for name, values in self.conditions.items()}
                numbers |= {name: values[row] for name, values in each.places.items()}
                parts = [f"{name}={numbers[name]:.5e}" for name in sorted(numbers)]
                text = ";".join([each.output.name, *parts, f"{each.censoring[row]}{value:.5e}"])
                found.append(hashlib.sha256(text.encode()).hexdigest()[:16])
        return found


@dataclass(frozen=True)
class ValidationSettings:
    """A section ``[validation.<name>]``: what is accepted, and what is known beside the runs."""

    accept: Mapping[str, float] = field(default_factory=dict)  # by output, in SI units
    numerical_std: Mapping[str, float] = field(default_factory=dict)  # by output, in SI units
    fitted: MeasuredOutputs | None = None  # the rows that inputs were fitted to, if any
    fitted_inputs: int = 0  # number of these inputs


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments of one or several sections, one after the other.

    Experiments are numbered through all sections, and so are rows: by section, by output, in the
    order of the file.
    """

    sections: tuple[MeasuredOutputs, ...]

    @property
    def name(self) -> str:
        """Names of the sections."""
        return ", ".join(each.name for each in self.sections)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Inputs that they teach."""
        return tuple(dict.fromkeys(name for each in self.sections for name in each.unknown))

    @property
    def moved(self) -> tuple[str, ...]:
        """Inputs with a value of their own in each experiment that is not known exactly."""
        names = ((*each.varies, *each.condition_std) for each in self.sections)
        return tuple(dict.fromkeys(name for of_section in names for name in of_section))

    @property
    def count(self) -> int:
        """Number of experiments."""
        return sum(each.experiments for each in self.sections)

    @cached_property
    def numbered(self) -> tuple[tuple[MeasuredOutputs, slice], ...]:
        """The sections, each with the numbers of its experiments."""
        ends = np.cumsum([0, *(each.experiments for each in self.sections)]).tolist()
        return tuple(zip(self.sections, map(slice, ends[:-1], ends[1:]), strict=True))

    @cached_property
    def rows(self) -> tuple[tuple[MeasuredOutput, slice], ...]:
        """The measured outputs, each with its rows."""
        outputs = [each for section in self.sections for each in section.outputs]
        ends = np.cumsum([0, *(len(each.values) for each in outputs)]).tolist()
        return tuple(zip(outputs, map(slice, ends[:-1], ends[1:]), strict=True))

    @cached_property
    def values(self) -> FloatArray:
        """Measured values, shape (row,)."""
        return np.concatenate([each.values for each, _ in self.rows])

    @cached_property
    def censoring(self) -> IntArray:
        """Censoring of each row: `AT_LEAST`, `EXACTLY` or `AT_MOST`; shape (row,)."""
        return np.concatenate([each.censoring for each, _ in self.rows])

    @cached_property
    def experiment(self) -> IntArray:
        """Number of the experiment of each row, shape (row,)."""
        found = (own.start + each.experiment for of, own in self.numbered for each in of.outputs)
        return np.concatenate([np.empty(0, dtype=np.int64), *found])

    def without_discrepancy(self) -> Experiments:
        """Return the same experiments, in which the model has no error of its own."""
        if not self.errors.has_discrepancy:
            return self
        return Experiments(tuple(each.without_discrepancy() for each in self.sections))

    @cached_property
    def blank(self) -> Experiments:
        """Experiments of the rows in which nothing was measured, or that are held out."""
        return Experiments(tuple(each.blank for each in self.sections if each.blank is not None))

    @cached_property
    def left_out(self) -> Experiments:
        """Measured rows that no fit learns from, in the experiments of `blank`."""
        found = (each.left_out for each in self.sections)
        return Experiments(tuple(each for each in found if each is not None))

    def measured_rows(self, **statistics: FloatArray) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield all measured values, what is known of them, and statistics of each by name.

        The names are those of the catalogue, each of shape (row,).
        """
        import xarray as xr

        yield from self.described_rows(slice(None))
        names = [each.output.name for each, own in self.rows for _ in self.values[own]]
        along = {MEASURED_ROW: np.arange(1, len(names) + 1)}
        yield "measured_output", xr.DataArray(np.array(names, dtype=object), along, (MEASURED_ROW,))
        for name, values in {"measured": self.values, **statistics}.items():
            yield name, xr.DataArray(values, along, (MEASURED_ROW,))

    def described_rows(self, own: slice) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield what is known of some rows, by the names of the catalogue."""
        import xarray as xr

        rows = len(self.values)
        conditions: dict[str, FloatArray] = {}
        lines = np.concatenate([each.lines for each, _ in self.rows])
        for section, of in self.numbered:
            inside = (self.experiment >= of.start) & (self.experiment < of.stop)
            for name, values in section.conditions.items():
                column = conditions.setdefault(name, np.full(rows, np.nan))
                column[inside] = values[self.experiment[inside] - of.start]
        for each, of_output in self.rows:
            for name, values in each.places.items():
                conditions.setdefault(name, np.full(rows, np.nan))[of_output] = values
        along = {MEASURED_ROW: np.arange(1, len(lines[own]) + 1)}
        for name, numbers in (
            ("experiment_number", self.experiment + 1),
            ("file_row", lines),
            ("bound_side", self.censoring),
            ("row_hash", np.array(self.row_hashes, dtype=object)),
        ):
            yield name, xr.DataArray(numbers[own], along, (MEASURED_ROW,))
        if conditions:
            whole = np.stack([*conditions.values()], axis=-1)[own]
            both = along | {MEASURED_CONDITION: [*conditions]}
            yield "condition", xr.DataArray(whole, both, (MEASURED_ROW, MEASURED_CONDITION))

    @property
    def row_hashes(self) -> list[str]:
        """Hashes of all rows by value; see `MeasuredOutputs.row_hashes`."""
        return [each for section in self.sections for each in section.row_hashes]

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        """Snapshots of their files."""
        return tuple(each.file for each in self.sections if each.file is not None)

    def inputs(self, draws: Arrays, others: Mapping[str, float]) -> dict[str, FloatArray]:
        """Return the inputs of runs: one of each experiment for each draw.

        Parameters
        ----------
        draws : mapping of str to ndarray, shape (draw,) or (draw, experiment)
            Values of unknown inputs, and of others that are not at their medians.
        others : mapping of str to float
            Values of all random inputs that are neither drawn nor conditions.

        Returns
        -------
        mapping of str to ndarray, shape (draw * experiment,)
            All experiments of the first draw come first.
        """
        size = len(next(iter(draws.values())))
        names = dict.fromkeys([*others, *draws])
        names |= dict.fromkeys(name for each in self.sections for name in each.conditions)
        found = {}
        for name in names:
            drawn = draws.get(name)
            parts = []
            for section, own in self.numbered:
                if drawn is not None:
                    part = drawn[:, own] if drawn.ndim == 2 else drawn[:, np.newaxis]
                elif name in section.conditions:
                    part = section.conditions[name]
                else:
                    part = np.array(others[name])
                parts.append(np.broadcast_to(part, (size, section.experiments)))
            found[name] = np.concatenate(parts, axis=1).ravel()
        return found

    def moved_inputs(
        self, name: str, others: Mapping[str, float], std: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the middle and the standard deviation of an input in each experiment.

        Parameters
        ----------
        name : str
            One of `moved`.
        others : mapping of str to float
            As in `inputs`.
        std : float
            Standard deviation of an input that varies.
        """
        middle, spread = [], []
        for section in self.sections:
            same, varies = others.get(name, math.nan), std if name in section.varies else 0.0
            middle.append(section.conditions.get(name, np.full(section.experiments, same)))
            spread.append(section.condition_std.get(name, np.full(section.experiments, varies)))
        return np.concatenate(middle), np.concatenate(spread)

    def drawn(self, runs: xr.Dataset, name: str) -> FloatArray:
        """Return the values of an unknown input in the runs of `inputs`, shape (draw,)."""
        first = next(own.start for section, own in self.numbered if name in section.unknown)
        found: FloatArray = runs[name].values[first :: self.count]
        return found

    def predicted(self, runs: xr.Dataset) -> FloatArray:
        """Return the results of runs, in the order of `inputs`, at the rows, shape (draw, row)."""
        parts = []
        for section, own in self.numbered:
            for each in section.outputs:
                values = runs[each.output.name].values
                at = values.reshape(-1, self.count, *each.output.shape)
                parts.append(each.predicted(at[:, own]))
        return np.concatenate(parts, axis=1)

    @cached_property
    def errors(self) -> RowErrors:
        """Errors of all rows."""
        return RowErrors(self.rows, self.experiment, self.moved)

    @cached_property
    def likelihood(self) -> Likelihood:
        """Likelihood of results at all rows."""
        return Likelihood(self.values, self.censoring, self.errors)
