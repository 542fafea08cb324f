"""From a study file to a `Study`, or to one error that lists every mistake in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uqpen.errors import Problem, as_written
from uqpen.inputs.law import InputLaw
from uqpen.model import Model, inadmissible
from uqpen.study.designs_section import check_designs, read_designs
from uqpen.study.document import Document, parse_document, read_document
from uqpen.study.inputs_section import read_constraints, read_inputs
from uqpen.study.model_section import read_model
from uqpen.study.outputs_section import read_questions
from uqpen.study.section import Section
from uqpen.study.study import Study
from uqpen.units import describe

__all__ = ["load_study", "parse_study"]


def load_study(path: str | Path) -> Study:
    """Read a study file.

    Parameters
    ----------
    path : str or Path
        A TOML file; what it names lies beside it.

    Returns
    -------
    Study
        Valid: it can be run.

    Raises
    ------
    StudyError
        Listing every mistake with its line, what was found and what is expected.
    """
    path = Path(path)
    return _study(read_document(path), path.stem, path.absolute().parent)


def parse_study(text: str, *, name: str = "study", folder: str | Path = ".") -> Study:
    """Like `load_study`, from the text of a study.

    Parameters
    ----------
    text : str
        TOML.
    name : str
        What the file would be called, without its ending.
    folder : str or Path
        Where the files lie that it names.
    """
    return _study(parse_document(text, f"{name}.toml"), name, Path(folder).absolute())


def _study(document: Document, name: str, folder: Path) -> Study:
    problems: list[Problem] = []
    root = Section(document, problems, (), document.content)
    title = root.text("title", "a title in quotes", default=name)
    seed = _seed(root)
    model_table = root.table("model", "a [model] table")
    inputs_table = root.table("inputs", "an [inputs] table")
    designs_table = root.table("designs", "at least one [designs.<name>]")
    outputs_table, constraints_table = root.table("outputs"), root.table("constraints")
    root.close()
    model = read_model(model_table, folder) if model_table else None
    designs = read_designs(designs_table, folder) if designs_table else {}
    if model is None or inputs_table is None or designs_table is None:
        # Without a model nobody knows what its inputs and outputs should be.
        raise document.error(problems)
    noted = len(problems)
    law = read_inputs(inputs_table, model)
    inputs_are_right = len(problems) == noted
    constraints = read_constraints(constraints_table, model, inputs_table.content)
    questions = read_questions(outputs_table, model)
    # An input that could not be understood would only cause mistakes that are none.
    noted = len(problems)
    given_by_tables = check_designs(designs_table, designs, law) if inputs_are_right else set()
    if len(problems) == noted:
        _check_completeness(inputs_table, model, given_by_tables)
    if not problems:
        _check_nominal(inputs_table, model, law)
    if problems or title is None or seed is None:
        raise document.error(problems)
    return Study(name, title, seed, model, law, constraints, questions, designs, document.text)


def _seed(root: Section) -> int | None:
    expected = "a whole number, 0 or more: the same seed gives the same draws"
    seed = root.take("seed")
    if seed is None:
        root.missing("seed", expected)
        return None
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        root.wrong("seed", as_written(seed), expected)
        return None
    return seed


def _check_completeness(table: Section, model: Model, given_by_tables: set[str]) -> None:
    """Note inputs that nothing gives: neither the study nor a column of every table."""
    for name in model.missing(given_by_tables.union(table)):
        variable = model.input(name)
        alternatives = next((group for group in model.alternatives if name in group), ())
        instead = f' (or "{alternatives[1]}")' if len(alternatives) > 1 else ""
        table.missing(name, describe(variable.unit) + instead)


def _check_nominal(table: Section, model: Model, law: InputLaw) -> None:
    """Note a condition of the model's that its nominal inputs violate."""
    nominal = law.nominal()
    if next(model.missing(nominal), None) is not None:
        return  # a table gives some of the inputs, and its points are data
    inputs = {name: np.array([value]) for name, value in nominal.items()}
    for violated, condition in inadmissible(model, inputs):
        if violated.any():
            found = f"inputs that, at their medians, violate {condition}"
            table.wrong((), found, f"inputs that {model.name} admits")
