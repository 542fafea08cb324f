"""Draft of a study of runs that exist already, from the columns of their data file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uqpen.core.errors import ModelError, QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME, REPLICATE, RESERVED, WEIGHT
from uqpen.core.units import DIMENSIONLESS, si_unit
from uqpen.models.data.data_file import DataColumn, DataFile, read_data_file
from uqpen.models.data.data_model import REASON, STATUS, data_coordinates, data_results
from uqpen.study.data_section import OTHER_COLUMNS
from uqpen.study.new_study.draft import FILL_IN, head_lines, line, surrogate_lines

__all__ = ["DataDraft", "data_draft"]

# What uqpen does with columns that are neither input nor output.
_MEANINGS = {
    STATUS: "what became of each run",
    REASON: "why a run failed",
    REPLICATE: "numbers independent sets of points, of a design that follows one",
    WEIGHT: "of draws from another distribution; if it is an input, list all inputs",
}


@dataclass(frozen=True)
class DataDraft:
    """Draft of a study of a data file.

    Parameters
    ----------
    reference : str
        The path of the file as the study names it.
    rows : int
        Number of its runs.
    inputs, outputs : tuple of DataColumn
        The columns that are inputs, and those that are taken for outputs.
    guess : str
        Why these are taken for outputs.
    others : tuple of str
        The columns with a meaning of their own.
    ignored : dict of str to str
        Why a column can be neither input nor output, by name.
    """

    reference: str
    rows: int
    inputs: tuple[DataColumn, ...]
    outputs: tuple[DataColumn, ...]
    guess: str
    others: tuple[str, ...]
    ignored: dict[str, str]

    def text(self, file: str) -> str:
        """Return the text of a study file of this name; `uqpen check` accepts it as it is."""
        head = head_lines(file, Path(self.reference).stem, "which columns are outputs, units")
        parts = [*self._model(), *self._inputs(), *self._outputs(), *self._design()]
        return "\n".join([*head, *parts, *surrogate_lines("runs")]) + "\n"

    def _model(self) -> Iterator[str]:
        yield "[model]"
        yield line(f"data = {toml_text(self.reference)}", f"runs: {self.rows}")
        yield f"# {FILL_IN}: which columns are outputs. This is a guess: {self.guess}."
        yield f"outputs = {_list(each.name for each in self.outputs)}"
        yield "# All other columns are inputs, as if this stood here:"
        yield f"# inputs = {_list(each.name for each in self.inputs)}"
        if self.ignored:
            yield from (f"# {toml_text(name)} {why}" for name, why in self.ignored.items())
            yield f"ignore = {_list(self.ignored)}"
        yield from (f"# The column {name}: {_MEANINGS[name]}." for name in self.others)
        yield ""
        if bare := [each.name for each in (*self.inputs, *self.outputs) if not each.unit]:
            yield line("[model.units]", "of columns without a unit in their heading")
            yield from (
                line(f'{name} = "{DIMENSIONLESS}"', f"{FILL_IN}: its unit") for name in bare
            )
            yield ""

    def _inputs(self) -> Iterator[str]:
        yield "# How the inputs are distributed, if it is known: a surrogate needs it; the points"
        yield "# are compared with it. The ends are those of the points."
        yield "# [inputs]"
        yield from (f"# {each.name} = {_range(each)}" for each in self.inputs)
        yield ""

    def _outputs(self) -> Iterator[str]:
        for each in self.outputs:
            yield f"[outputs.{each.name}]"
            limit = toml_text(f"3 {each.unit or DIMENSIONLESS}")
            yield line(f"# exceeds = [{limit}]", "the probability that it exceeds a limit")
            yield "# quantiles = [0.05, 0.5, 0.95]"
            yield ""

    def _design(self) -> Iterator[str]:
        yield "[designs.runs]"
        yield 'kind = "data"'
        yield "# The next line claims that the points are independent draws from the distribution"
        yield "# of interest. Intervals rest on that, so there are none without it. Points of an"
        yield "# optimisation, a parameter study or a Markov chain are not such draws."
        yield "# independent = true"
        yield line('# follows = "latin-hypercube"', "or, in its place, the design that drew them")
        yield ""


def data_draft(path: Path, reference: str) -> DataDraft:
    """Return the draft of a study of a data file, which may be of any format that uqpen reads.

    Parameters
    ----------
    path : Path
        The data file.
    reference : str
        Its path as the study names it.

    Raises
    ------
    ModelError
        If it cannot be read, or has no two columns that can be an input and an output.
    """
    try:
        file = read_data_file(path)
        # Refuses a status, a replicate or a weight that no study could take.
        data_results(file, (), {})
        data_coordinates(file, ())
    except SettingsError as error:
        raise ModelError(f"{path}: {_described(error)}") from None
    ignored = dict(_ignored(file))
    variables = [
        each for each in file.columns if each.name not in ignored and each.name not in OTHER_COLUMNS
    ]
    outputs = _outputs(variables)
    inputs = tuple(each for each in variables if each not in outputs)
    if not inputs or not outputs:
        no_variables = "".join(f'; "{name}" {why}' for name, why in ignored.items())
        names = ", ".join(each.name for each in variables) or "none"
        found = f"found columns of numbers: {names}{no_variables}"
        expected = "one without a blank for an input, and one for an output"
        raise ModelError(f"{path}: {found}; expected {expected}")
    return DataDraft(
        reference=reference,
        rows=file.rows,
        inputs=inputs,
        outputs=outputs,
        guess="the last column" if _is_whole(outputs[0]) else "columns with gaps, and the last",
        others=tuple(each.name for each in file.columns if each.name in OTHER_COLUMNS),
        ignored=ignored,
    )


def _outputs(variables: list[DataColumn]) -> tuple[DataColumn, ...]:
    """Return the columns with a blank, which no input has, and the last one if one is left."""
    blank = [each for each in variables if not _is_whole(each)]
    wanted = {each.name for each in (*blank, *variables[-1:])}
    if len(wanted) == len(variables):
        wanted = {each.name for each in blank}
    return tuple(each for each in variables if each.name in wanted)


def _ignored(file: DataFile) -> Iterator[tuple[str, str]]:
    """Yield the columns that can be no variable of a study, with the reason."""
    for column in file.columns:
        if column.name in OTHER_COLUMNS:
            continue
        if not NAME.match(column.name) or column.name in RESERVED:
            yield column.name, "is no name that a variable can have"
        elif reason := _fault(column):
            yield column.name, reason


def _fault(column: DataColumn) -> str:
    """Return why the entries of a column are no values of a variable; empty if they are."""
    try:
        si_unit(column.unit or DIMENSIONLESS)
        numbers = column.numbers()
    except QuantityError:
        return f"has no unit that is known: {toml_text(column.unit)}"
    except SettingsError:
        return "has texts"
    return "" if np.isfinite(numbers).any() else "has no number"


def _is_whole(column: DataColumn) -> bool:
    return bool(np.isfinite(column.numbers()).all())


def _range(column: DataColumn) -> str:
    """Return the uniform distribution between the smallest and the largest value of a column."""
    unit = "" if column.unit in ("", DIMENSIONLESS) else f" {column.unit}"
    lower, upper = (
        toml_text(f"{end:.6g}{unit}") if unit else f"{end:.6g}"
        for end in (column.numbers().min(), column.numbers().max())
    )
    return f"{{ uniform = {{ lower = {lower}, upper = {upper} }} }}"


def _list(names: Iterable[str]) -> str:
    return f"[{', '.join(map(toml_text, names))}]"


def _described(error: SettingsError) -> str:
    return "; ".join(f"found {each.found}; expected {each.expected}" for each in error.problems)
