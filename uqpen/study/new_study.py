"""Text of a first study of a user-defined model, with comments on what is left to fill in."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy

from uqpen.core.errors import ModelError, QuantityError, SettingsError, UnknownNameError, toml_text
from uqpen.core.labels import NAME, REPLICATE, RESERVED, WEIGHT
from uqpen.core.lookup import choices
from uqpen.core.units import DIMENSIONLESS, scale, si_unit
from uqpen.models.command.program import names_in
from uqpen.models.data.data_file import DataColumn, is_nines, read_data_file
from uqpen.models.data.data_model import (
    BLANK_INPUTS,
    REASON,
    STATUS,
    data_coordinates,
    data_results,
)
from uqpen.study.data_section import OTHER_COLUMNS, variable_name

FILL_IN = "FILL IN"
# Width of an input that nothing is known of, relative to its nominal value.
_SPREAD = 0.1
_COLUMN = 30


@dataclass(frozen=True)
class DraftInput:
    """Input of a model, as far as its source states it."""

    name: str  # its name
    nominal: float | None = None  # its default, in `unit`
    unit: str = ""  # its unit; empty if nothing states it
    labels: tuple[str, ...] = ()  # the texts that it is one of


@dataclass(frozen=True)
class Draft:
    """Draft of a study."""

    title: str  # what is studied
    # Lines of the table ``[model]`` and of tables in it, without inputs and outputs.
    model: tuple[str, ...]
    inputs: tuple[DraftInput, ...]  # the inputs of the model
    # The names of its outputs; the first is a stand-in where `knows_outputs` is false.
    outputs: tuple[str, ...]
    knows_outputs: bool = True  # whether the source of the model names its outputs
    readings: tuple[str, ...] = ()  # lines of the table ``[model.read]`` of a program
    remarks: tuple[str, ...] = ()  # what the reader should know of the model

    def text(self, file: str) -> str:
        """Return the text of a study file of this name; `uqpen check` accepts it as it is."""
        head = head_lines(file, self.title, "units, how uncertain inputs are")
        return "\n".join([*head, *self._model(), *self._inputs(), *self._rest()]) + "\n"

    def _model(self) -> Iterator[str]:
        yield "[model]"
        yield from (f"# {remark}" for remark in self.remarks)
        yield from self.model
        yield ""
        labelled = [each for each in self.inputs if each.labels]
        if labelled:
            yield line("[model.labels]", "the texts that the model takes, in its own order")
            yield from (f"{each.name} = {_list(each.labels)}" for each in labelled)
            yield ""
        if len(labelled) < len(self.inputs):
            yield line("[model.inputs]", "the units that the model takes")
        for each in self.inputs:
            if each.labels:
                continue
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
            known = "how often each" if each.labels else known
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
    if variable.labels:
        return f"{{ choice = {{ labels = {_list(variable.labels)} }} }}"
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
    yield f"title = {toml_text(title)}" if title else line('# title = "…"', "else the file's name")
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


# Bounds around a larger number may not be finite.
_LARGEST = 1e300


def function_draft(path: Path, name: str, reference: str) -> Draft:
    """Return the draft of a study of a function in a file.

    Parameters
    ----------
    name : str
        The function; empty for the only public one.
    reference : str
        The path of the file as the study names it.

    Raises
    ------
    ModelError
        If the file cannot be read, or the function cannot be a model.
    UnknownNameError
        If there is no such function.
    """
    function = _find(_parse(path), name, path)
    arguments = function.args
    if arguments.posonlyargs:
        raise ModelError(
            f"{path}: {function.name} takes {arguments.posonlyargs[0].arg} by position; "
            "expected arguments that can be given by name"
        )
    inputs, left = _inputs(arguments)
    if not inputs:
        raise ModelError(f"{path}: {function.name} has no argument that is a number")
    outputs = list(dict.fromkeys(_returned(function)))
    check_names([each.name for each in inputs], "argument")
    check_names(outputs, "output")
    remarks = [f"{', '.join(left)}: left at the default of the function"] if left else []
    remarks.append("it takes its inputs by name, and returns a dict with a number for each output")
    first = (ast.get_docstring(function) or "").partition("\n")[0].strip().removesuffix(".")
    return Draft(
        title=first if first and first.isprintable() else function.name,
        model=(
            f'python = "{reference}:{function.name}"',
            "# vectorized = true      # if it takes arrays with a value for each run",
            '# time_limit = "10 s"    # of one run',
        ),
        inputs=tuple(inputs),
        outputs=tuple(outputs) or ("result",),
        knows_outputs=bool(outputs),
        remarks=tuple(remarks),
    )


def _parse(path: Path) -> ast.Module:
    try:
        return ast.parse(path.read_bytes(), str(path))
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
        reason = error.msg if isinstance(error, SyntaxError) else error
        raise ModelError(f"{path}{line}: is no Python: {reason}") from None


def _find(module: ast.Module, name: str, path: Path) -> ast.FunctionDef:
    """Return the function of a name, or the only public one."""
    found = {each.name: each for each in module.body if isinstance(each, ast.FunctionDef)}
    public = [each for each in found if not each.startswith("_")]
    if not name and len(public) == 1:
        return found[public[0]]
    if not name:
        known = ", ".join(f"{path}:{each}" for each in public) or "none is in it"
        raise UnknownNameError(f"{path}: expected the name of a function; {known}")
    if name not in found:
        raise UnknownNameError(f'{path} has no function "{name}"; {choices(name, public)}')
    return found[name]


def _inputs(arguments: ast.arguments) -> tuple[list[DraftInput], list[str]]:
    """Return the arguments that are numbers, and those that are left at their defaults."""
    plain, defaults = arguments.args, arguments.defaults
    missing: list[ast.expr | None] = [None] * (len(plain) - len(defaults))
    pairs = [
        *zip(plain, [*missing, *defaults], strict=True),
        *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
    ]
    inputs: list[DraftInput] = []
    left: list[str] = []
    for argument, default in pairs:
        nominal = None if default is None else _number(default)
        if labels := _literal_labels(argument):
            inputs.append(DraftInput(argument.arg, labels=labels))
        elif default is not None and (
            nominal is None
            or (ast.unparse(argument.annotation) if argument.annotation else "") in ("int", "bool")
        ):
            left.append(argument.arg)
        else:
            inputs.append(DraftInput(argument.arg, nominal, _unit(argument)))
    return inputs, left


def _number(node: ast.expr) -> float | None:
    """Return the value of a default; None where it is no finite number."""
    try:
        value = ast.literal_eval(node)
        is_number = type(value) in (int, float) and abs(float(value)) < _LARGEST
    except (ValueError, TypeError, OverflowError, MemoryError, RecursionError):
        return None
    return float(value) if is_number else None


def _literal_labels(argument: ast.arg) -> tuple[str, ...]:
    """Return the texts of an annotation such as ``Literal["M8", "M10"]``; empty for another."""
    match argument.annotation:
        case ast.Subscript(
            value=ast.Name(id="Literal") | ast.Attribute(attr="Literal"), slice=part
        ):
            parts = part.elts if isinstance(part, ast.Tuple) else [part]
            texts = [each.value for each in parts if isinstance(each, ast.Constant)]
            if len(texts) == len(parts) > 1 and all(isinstance(each, str) for each in texts):
                return tuple(map(str, texts))
    return ()


def _unit(argument: ast.arg) -> str:
    """Return the unit that an annotation states, as ``"kN"`` or ``Annotated[float, "kN"]``."""
    nodes = ast.walk(argument.annotation) if argument.annotation else ()
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            try:
                scale(node.value)
            except QuantityError:
                continue
            return node.value
    return ""


def _returned(function: ast.FunctionDef) -> Iterator[str]:
    """Yield the keys of the mappings that a function returns, where they are written in it."""
    for node in _own_nodes(function):
        match node:
            case ast.Return(value=ast.Dict(keys=keys)):
                yield from (
                    key.value
                    for key in keys
                    if isinstance(key, ast.Constant) and isinstance(key.value, str)
                )
            case ast.Return(value=ast.Call(func=ast.Name(id="dict"), keywords=keywords)):
                yield from (keyword.arg for keyword in keywords if keyword.arg)


def _own_nodes(parent: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a function, but not those of functions inside."""
    for node in ast.iter_child_nodes(parent):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            yield node
            yield from _own_nodes(node)


# Placeholders of files that a program reads or writes by itself.
_PATHS = ("inputs", "outputs")
# Where a result stands is not known: here in a line of its own.
_READING = r"""result = { text = "stdout", pattern = 'result *= *(\S+)' }  # FILL IN: its place"""
_ENDINGS = (".template", ".tmpl", ".tpl", ".in")


def command_draft(words: Sequence[str], template: Path | None, reference: str) -> Draft:
    """Return the draft of a study of a program.

    Parameters
    ----------
    words : sequence of str
        The program and its arguments.
    template : Path or None
        A file with a placeholder ``{name}`` for each input, if there is one.
    reference : str
        The path of the template as the study names it.

    Raises
    ------
    ModelError
        If the template cannot be read, or nothing has a placeholder.
    """
    if not words:
        raise ModelError("--command: found nothing, expected a program and its arguments")
    text = " ".join(words) + (f"\n{_read(template)}" if template else "")
    names = sorted(names_in(text) - {*_PATHS, ""}, key=lambda name: text.index(f"{{{name}"))
    if not names:
        where = (
            f"neither {template} nor the command has" if template else "the command does not have"
        )
        raise ModelError(f"{where} a placeholder such as {{load}} for an input")
    check_names(names, "placeholder")
    model = [f"command = {json.dumps(list(words), ensure_ascii=False)}"]
    model.append('# time_limit = "10 min"  # of one run')
    if template:
        # Of "input.txt.template", the run has "input.txt".
        endings = (each for each in _ENDINGS if template.name.endswith(each))
        bare = template.name.removesuffix(next(endings, ""))
        file = json.dumps(bare or template.name, ensure_ascii=False)
        model += ["\n[model.templates]", f"{file} = {json.dumps(reference, ensure_ascii=False)}"]
    writes_json = "{outputs}" in text
    return Draft(
        title=Path(words[0]).name,
        model=tuple(model),
        inputs=tuple(map(DraftInput, names)),
        outputs=("result",),
        knows_outputs=False,
        readings=() if writes_json else (_READING,),
    )


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ModelError(f"{path}: is not UTF-8") from None


# What uqpen does with columns that are neither input nor output.
_MEANINGS = {
    STATUS: "what became of each run",
    REASON: "why a run failed",
    REPLICATE: "numbers independent sets of points, of a design that follows one",
    WEIGHT: "of draws from another distribution; if it is an input, list all inputs",
}


# Headings of the number of a run, in small letters.
_NUMBERING = frozenset({"run", "id", "no", "nr", "number", "index", "case", "sample", "row", "#"})
# Rows that tell whether a column follows from others, for each of these columns, and at most. The
# ranks of inputs that are drawn together share less of their variance.
_FEWEST_RANKED, _MOST_RANKED, _SHARE_OF_OUTPUT = 10, 10_000, 0.3
# Rows beyond which a Gaussian process takes minutes, and those that it takes at most.
_MANY_FOR_PROCESS, _MOST_FOR_PROCESS = 600, 2000
_LONGEST_LINE = 100


@dataclass(frozen=True)
class DataDraft:
    """Draft of a study of a data file."""

    reference: str  # the path of the file as the study names it
    rows: int  # number of its runs
    inputs: tuple[DataColumn, ...]  # the columns that are inputs
    outputs: tuple[DataColumn, ...]  # those that are taken for outputs
    guess: str  # why these are taken for outputs
    others: tuple[str, ...]  # the columns with a meaning of their own
    ignored: dict[str, str]  # why a column can be neither input nor output, by name
    missing: tuple[float, ...]  # numbers that seem to stand for none
    has_gaps: bool  # whether an input is blank in some row
    headings: dict[str, str]  # the headings of columns that are no names, by those given to them

    def text(self, file: str) -> str:
        """Return the text of a study file of this name; `uqpen check` accepts it as it is."""
        head = head_lines(file, "", "which columns are outputs")
        parts = [*self._model(), *self._inputs(), *self._outputs(), *self._design()]
        return "\n".join([*head, *parts, *self._surrogate()]) + "\n"

    def _model(self) -> Iterator[str]:
        yield "[model]"
        yield line(f"data = {toml_text(self.reference)}", f"runs: {self.rows}")
        yield f"# {FILL_IN}: which columns are outputs. This is a guess: {self.guess}."
        yield f"outputs = {_list(each.name for each in self.outputs)}"
        yield "# All other columns are inputs, as if this stood here:"
        yield f"# inputs = {_list(each.name for each in self.inputs)}"
        if self.missing:
            numbers = ", ".join(f"{each:.15g}" for each in self.missing)
            yield line(f"missing = [{numbers}]", f"{FILL_IN}: what stands for no value")
        if self.has_gaps:
            yield line(f"drop = {toml_text(BLANK_INPUTS)}", "rows without one of their inputs")
        if self.ignored:
            yield from (f"# {toml_text(name)} {why}" for name, why in self.ignored.items())
            yield f"ignore = {_list(self.ignored)}"
        yield from (f"# The column {name}: {_MEANINGS[name]}." for name in self.others)
        yield "# Inputs that [inputs] does not state are distributed as in this file, rows whole."
        yield "together = true"
        named = [f"{name} = {toml_text(text)}" for name, text in self.headings.items()]
        inline = f"columns = {{ {', '.join(named)} }}"
        is_short = len(inline) <= _LONGEST_LINE
        if named:
            yield "# The headings in the file, by the names of this study."
            yield from [inline] if is_short else ["", "[model.columns]", *named]
        yield ""
        variables = (*self.inputs, *self.outputs)
        if bare := [each.name for each in variables if not (each.unit or each.labels)]:
            yield line("# [model.units]", "of columns without a unit in their heading")
            yield from (f'# {name} = "{DIMENSIONLESS}"' for name in bare)
            yield ""

    def _inputs(self) -> Iterator[str]:
        yield "# How the inputs are distributed, if it is known; the points are compared with it."
        yield "# The ends are those of the points."
        yield "# [inputs]"
        yield from (f"# {each.name} = {_range(each)}" for each in self.inputs)
        yield ""

    def _outputs(self) -> Iterator[str]:
        for each in self.outputs:
            if each.labels:
                continue
            yield f"# [outputs.{each.name}]"
            limit = toml_text(f"3 {each.unit or DIMENSIONLESS}")
            yield line(f"# exceeds = [{limit}]", "the probability that it exceeds a limit")
            yield "# quantiles = [0.05, 0.5, 0.95]"
            yield ""

    def _design(self) -> Iterator[str]:
        yield "# [designs.data]"
        yield '# kind = "data"'
        yield "# The next line claims that the points are independent draws from the distribution"
        yield "# of interest. Intervals rest on that, so there are none without it. Points of an"
        yield "# optimisation, a parameter study or a Markov chain are not such draws."
        yield "# independent = true"
        yield line('# follows = "latin-hypercube"', "or, in its place, the design that drew them")
        yield ""

    def _surrogate(self) -> Iterator[str]:
        is_unordered = any(len(each.labels) > 2 for each in self.inputs)
        if self.rows > (_MOST_FOR_PROCESS if is_unordered else _MANY_FOR_PROCESS):
            lines = surrogate_lines("data")
            yield from lines if is_unordered else (each.removeprefix("# ") for each in lines)
            return
        yield "# A cheap model, fitted to these runs. It predicts other points, with a deviation:"
        yield "# uqpen predict ARCHIVE POINTS"
        yield "[surrogates.cheap]"
        yield 'kind = "gaussian-process"'
        yield 'design = "data"'


def data_draft(path: Path, reference: str) -> DataDraft:
    """Return the draft of a study of a data file, which may be of any format that uqpen reads.

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
        found = "; ".join(f"found {p.found}; expected {p.expected}" for p in error.problems)
        raise ModelError(f"{path}: {found}") from None
    ignored: dict[str, str] = {}
    headings: dict[str, str] = {}
    variables: list[DataColumn] = []
    distant = {each.distant_value() for each in file.columns if not _fault(each)}
    missing = tuple(sorted(each for each in distant if each is not None and is_nines(each)))
    for written in file.columns:
        column = written.without(missing).coded()
        if column.name in OTHER_COLUMNS:
            continue
        if reason := _fault(column):
            ignored[column.name] = reason
            continue
        if not NAME.match(name := column.name) or name in RESERVED:
            taken = {each.name for each in (*file.columns, *variables)}
            bare = name = variable_name(column.name)
            while name in taken:
                name = f"{bare}_{len(headings) + 2}"
            headings[name] = column.heading or column.name
        variables.append(replace(column, name=name, unit=column.unit if _has_unit(column) else ""))
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
        guess="columns with gaps, and the last that follow from those before",
        others=tuple(each.name for each in file.columns if each.name in OTHER_COLUMNS),
        ignored=ignored,
        missing=missing,
        has_gaps=not all(map(_is_whole, inputs)),
        headings=headings,
    )


def _outputs(variables: list[DataColumn]) -> tuple[DataColumn, ...]:
    """Return the columns with a blank, which no input has, and the last that follow from others."""
    rows = len(variables[0].entries) if variables else 0
    blank = [
        each
        for place, each in enumerate(variables)
        if not _is_whole(each)
        and (
            rows < _FEWEST_RANKED * len(variables)
            or np.isinf(each.numbers()).any()
            or (place and _follows(each, variables[:place]))
        )
    ]
    first = max(len(variables) - 1, 0)
    while first > 1 and _follows(variables[first - 1], variables[: first - 1]):
        first -= 1
    wanted = {each.name for each in (*blank, *variables[first:])}
    if len(wanted) == len(variables):
        wanted = {each.name for each in blank}
    return tuple(each for each in variables if each.name in wanted)


def _follows(column: DataColumn, earlier: Sequence[DataColumn]) -> bool:
    """Check whether a column follows from those before: by a share of the variance of its ranks."""
    # The order of codes has no meaning.
    plain = [each for each in earlier if not each.labels]
    numbers = np.array([each.numbers()[:_MOST_RANKED] for each in (*plain, column)])
    ranks = scipy.stats.rankdata(numbers[:, np.isfinite(numbers).all(axis=0)], axis=1)
    if ranks.shape[1] < _FEWEST_RANKED * len(numbers) or not plain or not ranks[-1].std():
        return False
    *others, own = ranks - ranks.mean(axis=1, keepdims=True)
    unexplained = own - np.transpose(others) @ np.linalg.lstsq(np.transpose(others), own)[0]
    return bool(1 - unexplained.var() / own.var() >= _SHARE_OF_OUTPUT)


def _fault(column: DataColumn) -> str:
    """Return why the entries of a column are no values of a variable; empty if they are."""
    # What stands in round brackets need not be a unit.
    if not _has_unit(column) and not column.heading.endswith(")"):
        return f"has no unit that is known: {toml_text(column.unit)}"
    try:
        numbers = column.numbers()
    except SettingsError as error:
        expected = error.problems[0].expected
        return "has texts" if expected == "a number" else f"has texts; expected {expected}"
    if not np.isfinite(numbers).any():
        return "has no number"
    is_number = numbers.size > 1 and not column.unit and bool((np.diff(numbers) == 1).all())
    if is_number and (column.name.lower() in _NUMBERING or numbers.size >= _FEWEST_RANKED):
        return "numbers the runs" if numbers[0] in (0, 1) else ""
    return ""


def _has_unit(column: DataColumn) -> bool:
    """Check that the unit of a heading is known; a missing one is."""
    try:
        si_unit(column.unit or DIMENSIONLESS)
    except QuantityError:
        return False
    return True


def _is_whole(column: DataColumn) -> bool:
    return bool(np.isfinite(column.numbers()).all())


def _range(column: DataColumn) -> str:
    """Return the uniform distribution between the smallest and the largest value of a column."""
    if column.labels:
        values = ", ".join(map(toml_text, column.labels))
        return f"{{ discrete = {{ values = [{values}] }} }}"
    unit = "" if column.unit in ("", DIMENSIONLESS) else f" {column.unit}"
    lower, upper = (
        toml_text(f"{end:.6g}{unit}") if unit else f"{end:.6g}"
        for end in (np.nanmin(column.numbers()), np.nanmax(column.numbers()))
    )
    return f"{{ uniform = {{ lower = {lower}, upper = {upper} }} }}"


def _list(names: Iterable[str]) -> str:
    return f"[{', '.join(map(toml_text, names))}]"
