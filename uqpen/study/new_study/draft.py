"""Draft of a study file: what is known of a model, and the text that is made of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from uqpen.core.errors import ModelError, toml_text
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.units import DIMENSIONLESS

__all__ = [
    "FILL_IN",
    "Draft",
    "DraftInput",
    "check_names",
    "head_lines",
    "line",
    "surrogate_lines",
]

FILL_IN = "FILL IN"
# Width of an input that nothing is known of, relative to its nominal value.
_SPREAD = 0.1
_COLUMN = 30


@dataclass(frozen=True)
class DraftInput:
    """Input of a model, as far as its source states it.

    Parameters
    ----------
    name : str
        Its name.
    nominal : float or None
        Its default, in `unit`.
    unit : str
        Its unit; empty if nothing states it.
    """

    name: str
    nominal: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class Draft:
    """Draft of a study.

    Parameters
    ----------
    title : str
        What is studied.
    model : tuple of str
        Lines of the table ``[model]`` and of tables in it, without inputs and outputs.
    inputs : tuple of DraftInput
        The inputs of the model.
    outputs : tuple of str
        The names of its outputs; the first is a stand-in where `knows_outputs` is false.
    knows_outputs : bool
        Whether the source of the model names its outputs.
    readings : tuple of str
        Lines of the table ``[model.read]`` of a program.
    remarks : tuple of str
        What the reader should know of the model.
    """

    title: str
    model: tuple[str, ...]
    inputs: tuple[DraftInput, ...]
    outputs: tuple[str, ...]
    knows_outputs: bool = True
    readings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    def text(self, file: str) -> str:
        """Return the text of a study file of this name; `uqpen check` accepts it as it is."""
        head = head_lines(file, self.title, "units, how uncertain inputs are")
        return "\n".join([*head, *self._model(), *self._inputs(), *self._rest()]) + "\n"

    def _model(self) -> Iterator[str]:
        yield "[model]"
        yield from (f"# {remark}" for remark in self.remarks)
        yield from self.model
        yield ""
        yield line("[model.inputs]", "the units that the model takes")
        for each in self.inputs:
            unit = toml_text(each.unit or DIMENSIONLESS)
            yield line(f"{each.name} = {unit}", "" if each.unit else f"{FILL_IN}: its unit")
        yield ""
        yield line("[model.outputs]", "the units that the model returns")
        for name in self.outputs:
            missing = "its unit" if self.knows_outputs else "the names of the outputs, their units"
            yield line(f'{name} = "{DIMENSIONLESS}"', f"{FILL_IN}: {missing}")
        if self.readings:
            yield "\n[model.read]"
            yield from self.readings
        yield ""

    def _inputs(self) -> Iterator[str]:
        yield "[inputs]"
        yield '# One value: "2 m". Mean and standard deviation: "(2 ± 0.1) m". Others, for example:'
        yield '# { uniform = { lower = "1 m", upper = "3 m" } }, { discrete = { values = [1, 2] } }'
        for each in self.inputs:
            known = "10 % around the default" if each.nominal is not None else "its value"
            yield f"{each.name} = {_distribution(each)}  # {FILL_IN}: {known}"
        yield ""

    def _rest(self) -> Iterator[str]:
        for name in self.outputs:
            yield f"[outputs.{name}]"
            yield '# exceeds = ["3 mm"]     # the probability that it exceeds a limit'
            yield "# quantiles = [0.05, 0.5, 0.95]"
            yield ""
        yield "[designs.sample]"
        yield line(
            'kind = "latin-hypercube"', "also: monte-carlo, sobol-sequence, saltelli, morris"
        )
        yield "runs = 200"
        yield ""
        yield from surrogate_lines("sample")


def check_names(names: list[str], what: str) -> None:
    """Refuse names that no study can have; a ModelError states the expected form."""
    for name in names:
        if not NAME.match(name):
            expected = "a letter first, then letters, digits and _, at most 100"
            raise ModelError(f'the {what} "{name}" cannot be named in a study; expected {expected}')
        if name in RESERVED:
            raise ModelError(f'the {what} "{name}" has a name that archives use themselves')


def _distribution(variable: DraftInput) -> str:
    """Return a uniform distribution around the nominal value of an input, or around 1."""
    nominal = 1.0 if variable.nominal is None else variable.nominal
    width = _SPREAD * (abs(nominal) or 1.0)
    ends = {"lower": nominal - width, "upper": nominal + width}
    known = variable.unit not in ("", DIMENSIONLESS)
    texts = {
        key: f'"{end:.6g} {variable.unit}"' if known else f"{end:.6g}" for key, end in ends.items()
    }
    return f"{{ uniform = {{ lower = {texts['lower']}, upper = {texts['upper']} }} }}"


def head_lines(file: str, title: str, unknown: str) -> Iterator[str]:
    """Yield the first lines of a study file: what to fill in and to call, its title, its seed."""
    yield f"# Lines with {FILL_IN} need what only you know: {unknown}."
    yield f"# Then:  uqpen check {file}   and   uqpen study {file}"
    yield ""
    yield f"title = {toml_text(title)}"
    yield line("seed = 1", "of all random numbers")
    yield ""


def surrogate_lines(design: str) -> Iterator[str]:
    """Yield the lines of a surrogate that is fitted to the runs of a design, as a comment."""
    yield line("# [surrogates.cheap]", "a cheap model, fitted to these runs")
    yield '# kind = "polynomial-chaos"'
    yield f"# design = {toml_text(design)}"


def line(text: str, comment: str) -> str:
    """Return a line with a comment behind it, which stands below those of other lines."""
    return f"{text:<{_COLUMN}}  # {comment}" if comment else text
