"""From a study file to a `Study`, or to one error that lists every mistake in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from uqpen.core.errors import Problem, toml_text
from uqpen.core.model import violated_conditions
from uqpen.core.streams import Stream
from uqpen.core.units import describe
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.dependence_section import read_dependence
from uqpen.study.designs_section import check_designs, read_designs
from uqpen.study.document import Document, parse_document, read_document
from uqpen.study.failures_section import read_failures
from uqpen.study.inputs_section import read_constraints, read_inputs
from uqpen.study.models_section import check_variants, read_models
from uqpen.study.outputs_section import read_quantities_of_interest
from uqpen.study.published_section import read_published
from uqpen.study.study import Study, Variant
from uqpen.study.surrogates_section import check_surrogates, read_surrogates
from uqpen.study.table_reader import TableReader

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
    return _read_study(read_document(path), path.stem, path.absolute().parent, trust=True)


def parse_study(
    text: str,
    *,
    name: str = "study",
    folder: str | Path = ".",
    trust: bool = True,
) -> Study:
    """Like `load_study`, from the text of a study.

    Parameters
    ----------
    text : str
        TOML.
    name : str
        What the file would be called, without its ending.
    folder : str or Path
        Where the files lie that it names.
    trust : bool
        Whether models that it names may be loaded, which executes modules and asks servers. If
        not, they cannot be run, but all else can be asked of the study.
    """
    document = parse_document(text, f"{name}.toml")
    return _read_study(document, name, Path(folder).absolute(), trust=trust)


# The tables of a study beside its models, with what is expected of those that it must have.
_TABLES = {
    "inputs": "an [inputs] table",
    "designs": "at least one [designs.<name>]",
    "dependence": "",
    "constraints": "",
    "outputs": "",
    "surrogates": "",
    "published": "",
    "failures": "",
}


def _read_study(document: Document, name: str, folder: Path, *, trust: bool) -> Study:
    problems: list[Problem] = []
    root = TableReader(document, problems, (), document.content)
    title = root.text("title", "a title in quotes", default=name)
    seed = _seed(root)
    models = read_models(root, folder, trust=trust)
    tables = {key: root.table(key, expected) for key, expected in _TABLES.items()}
    root.check_unknown_keys()
    inputs, designs_table = tables["inputs"], tables["designs"]
    failures = read_failures(tables["failures"])
    designs = read_designs(designs_table, folder) if designs_table else {}
    surrogates = read_surrogates(tables["surrogates"], list(designs_table or ()))
    if not models or inputs is None or designs_table is None:
        # Without a model nobody knows what its inputs and outputs should be.
        raise document.error(problems)
    model = next(iter(models.values())).model
    noted = len(problems)
    joint = read_inputs(inputs, model, folder, Stream(seed or 0, "inputs"))
    constraints = read_constraints(tables["constraints"], model, inputs.content)
    quantities = read_quantities_of_interest(tables["outputs"], model)
    published = read_published(tables["published"], model, {*designs, *surrogates})
    if len(problems) == noted:
        # Inputs that could not be understood would only cause mistakes that are none.
        joint = read_dependence(tables["dependence"], joint)
        given_by_tables = check_designs(designs_table, designs, joint)
        check_surrogates(tables["surrogates"], surrogates, designs, model, joint)
        check_variants(root, models, {entry.variable.name for entry in joint.random})
        _check_models(inputs, models, joint, given_by_tables)
    if problems or title is None or seed is None:
        raise document.error(problems)
    return Study(
        name=name,
        title=title,
        seed=seed,
        models=models,
        joint=joint,
        constraints=constraints,
        quantities_of_interest=quantities,
        designs=designs,
        text=document.text,
        surrogates=surrogates,
        published=published,
        folder=folder,
        failures=failures,
    )


def _check_models(
    table: TableReader,
    models: Mapping[str, Variant],
    joint: JointDistribution,
    given_by_tables: set[str],
) -> None:
    """Note what a model lacks, or does not admit at the nominal inputs."""
    noted = len(table.problems)
    for variant in models.values():
        _check_completeness(table, variant, given_by_tables)
    if len(table.problems) == noted:
        for variant in models.values():
            _check_nominal(table, variant, joint)


def _seed(root: TableReader) -> int | None:
    expected = "a whole number, 0 or more: the same seed gives the same draws"
    seed = root.take("seed")
    if seed is None:
        root.add_missing("seed", expected)
        return None
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        root.add_problem("seed", toml_text(seed), expected)
        return None
    return seed


def _check_completeness(table: TableReader, variant: Variant, given_by_tables: set[str]) -> None:
    """Note inputs that nothing gives: neither the study nor a column of every table."""
    model = variant.model
    for name in model.missing_inputs(given_by_tables.union(table, variant.given)):
        variable = model.input(name)
        alternatives = next((group for group in model.alternatives if name in group), ())
        instead = f' (or "{alternatives[1]}")' if len(alternatives) > 1 else ""
        table.add_missing(name, describe(variable.unit) + instead)


def _check_nominal(table: TableReader, variant: Variant, joint: JointDistribution) -> None:
    """Note a condition of the model's that its nominal inputs violate."""
    model, nominal = variant.model, {**joint.nominal(), **variant.given}
    if next(model.missing_inputs(nominal), None) is not None:
        return  # a table gives some of the inputs, and its points are data
    inputs = {name: np.array([value]) for name, value in nominal.items()}
    for violated, condition in violated_conditions(model, inputs):
        if violated.any():
            found = f"inputs that, at their medians, violate {condition}"
            table.add_problem((), found, f"inputs that {model.name} admits")
