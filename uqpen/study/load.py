"""Reading of a study file into a `Study`, or one error that lists every mistake in it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from uqpen.core.errors import StudyError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import CONVERGENCE, SENSITIVITY
from uqpen.core.lookup import resolve
from uqpen.core.model import Model, violated_conditions
from uqpen.core.settings import count, flag, number, text
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION, describe
from uqpen.designs.design import Design
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.one_at_a_time import OneAtATime
from uqpen.designs.repeated import each_point_once
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import FailurePolicy
from uqpen.measurements.experiments import MeasuredOutputs
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.published import Publication, Reading
from uqpen.study import SECTIONS
from uqpen.study.budget_section import (
    BUDGET,
    FEWEST_RUNS,
    STAND_IN,
    BudgetPlan,
    check_budget,
    plan_budget,
)
from uqpen.study.data_section import DEFAULT_DESIGNS, bind_designs, check_fixed, has_data
from uqpen.study.designs_section import (
    check_designs,
    check_models,
    check_noise,
    check_outputs,
    check_tables,
    read_designs,
)
from uqpen.study.document import Document, Objects, parse_document, read_document
from uqpen.study.inputs_section import read_constraints, read_inputs
from uqpen.study.joint_section import Inputs, read_dependence, read_groups
from uqpen.study.measured_section import check_roles, read_measured, read_validations
from uqpen.study.model_section import (
    check_finer,
    check_stand_ins,
    check_sweep,
    check_variants,
    read_models,
    read_sweep,
)
from uqpen.study.outputs_section import (
    check_analyses,
    check_formulas,
    derive_outputs,
    read_analyses,
)
from uqpen.study.study import ONLY_MODEL, SurrogateOrigin, ValidatedStudy, Variant
from uqpen.study.surrogates_section import check_surrogates, read_surrogates, refined_designs
from uqpen.study.table_reader import StudyParts, TableReader
from uqpen.surrogates.surrogate import Surrogate


def load_study(path: str | Path) -> ValidatedStudy:
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
    return read_study(read_document(path), path.stem, path.absolute().parent, trust=True)


def parse_study(
    text: str,
    *,
    name: str = "study",
    folder: str | Path = ".",
    trust: bool = True,
    objects: Objects | None = None,
) -> ValidatedStudy:
    """Read a study from its text, as `load_study` reads a file.

    Parameters
    ----------
    text : str
        TOML.
    name : str
        The name of the file without its suffix.
    folder : str or Path
        The folder to which the paths of files are relative.
    trust : bool
        True if models and analyses that it names may be loaded, which executes modules and sends
        requests to servers. Otherwise they cannot be run, but the rest of the study can be used.
    objects : mapping of tuple to object, optional
        For the text of a study made in Python: the objects that it names, by the paths of their
        tables, such as ``{("model",): function}``. Without its function a model cannot be run.
    """
    document = parse_document(text, f"{name}.toml", objects)
    return read_study(document, name, Path(folder).absolute(), trust=trust)


# The tables of a study beside its models, those first that it must have.
_TABLES = sorted(
    (key for key, section in SECTIONS.items() if section.is_table),
    key=lambda key: not SECTIONS[key].expected,
)


@dataclass(frozen=True, kw_only=True)
class _Heading:
    """The keys of a study that stand in no table."""

    title: str | None = text(expected="a title in quotes", default=None)
    seed: int = count(
        minimum=0,
        maximum=math.inf,
        expected="a whole number, 0 or more: the same seed gives the same draws",
    )
    confidence_level: float = number(
        above=0.5,
        below=1,
        expected="a confidence level above 0.5 and below 1, such as 0.9",
        default=LEVEL,
    )
    budget: int | None = count(minimum=FEWEST_RUNS, default=None)
    sensitivity: bool = flag(default=True)
    convergence: bool = flag(default=True)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Analyses that are not wanted."""
        return tuple(name for name in (SENSITIVITY, CONVERGENCE) if not getattr(self, name))


def read_study(document: Document, name: str, folder: Path, *, trust: bool) -> ValidatedStudy:
    """Read a study from its parsed text; see `parse_study`."""
    root = TableReader(document, folder, trust, document.content)
    heading = root.settings(_Heading) or _Heading(seed=0)
    noted = len(root.problems)
    models, model = read_models(root)
    are_models_whole = len(root.problems) == noted
    analyses = read_analyses(root, heading.seed)
    tables = {key: root.table(key, _expected(root, key)) for key in _TABLES}
    models = read_sweep(tables["sweep"], models, model)
    budget = check_budget(root, heading.budget)
    if has_data(root) and "designs" not in root:
        tables["designs"] = root.inside(DEFAULT_DESIGNS, "designs")
    elif budget is not None:
        tables["designs"] = root.inside(STAND_IN, "designs")
    root.check_unknown_keys()
    model, models = derive_outputs(tables["outputs"], model, models)
    # What is compared with the model waits until it has no mistake.
    whole_model = model if are_models_whole else None
    fields: dict[str, Any] = {
        section.field: tables[key].whole_settings(resolve(section.settings))
        for key, section in SECTIONS.items()
        if section.settings and tables[key].is_given
    }
    sections = read_measured(tables["measured"], whole_model)
    validations = read_validations(tables["validation"], tables["measured"], sections, whole_model)
    methods = _read_methods(tables, whole_model, sections)
    inputs, joint, is_clear = _read_joint(
        root, tables, model, models, methods.designs, heading.seed
    )
    check_fixed(tables["inputs"], joint, model)
    check_sweep(tables["sweep"], {entry.variable.name for entry in joint.random})
    check_formulas(tables["outputs"], models, inputs)
    constraints = read_constraints(tables["constraints"], model, inputs)
    plan = BudgetPlan(document.text)
    if budget is not None and is_clear:
        plan = plan_budget(root, budget, joint, models, is_constrained=bool(constraints))
        for key in ("designs", "surrogates"):
            tables[key] = root.inside(plan.section(key), key)
        methods = _read_methods(tables, whole_model, sections)
    sources = frozenset({*tables["designs"], *tables["surrogates"]})
    parts = StudyParts(model, sources, heading.confidence_level)
    fields |= {
        section.field: resolve(section.reader)(tables[key], parts)
        for key, section in SECTIONS.items()
        if section.reader
    }
    study = ValidatedStudy(
        name=name,
        title=heading.title or name,
        seed=heading.seed,
        models=models,
        joint=joint,
        constraints=constraints,
        text=plan.text,
        folder=folder,
        analyses=analyses,
        confidence_level=heading.confidence_level,
        plan=tuple(each.text for each in plan.tables),
        left_out=heading.left_out,
        measured={key: each for key, each in sections.items() if each is not None},
        validations=validations,
        swept=tuple(tables["sweep"]),
        **methods._asdict(),
        **fields,
    )
    _check_parts(root, tables, study, model, joint if is_clear else None, whole_model)
    asked = study.quantities_of_interest, constraints
    refined = refined_designs(tables["surrogates"], study.surrogates, study.designs, models, *asked)
    if whole_model is not None and not inputs.unclear and tables["inputs"].is_given:
        for variant in models.values():
            _check_nominal(tables["inputs"], variant, joint)
    _check_readings(root, study.published, name)
    if root.problems:
        raise document.error(root.problems)
    return replace(study, designs=refined)


def _check_parts(
    root: TableReader,
    tables: Mapping[str, TableReader],
    study: ValidatedStudy,
    model: Model,
    joint: JointDistribution | None,
    whole_model: Model | None,
) -> None:
    """Note what parts of a study contradict; without a whole joint distribution or model, less."""
    designs, models = study.designs, study.models
    random = {entry.variable.name for entry in study.joint.random} - {*study.swept}
    check_variants(root, models, random)
    check_surrogates(tables["surrogates"], study.surrogates, designs, model, joint)
    if joint is not None:
        check_roles(tables["measured"], study.measured, joint)
        check_designs(tables["designs"], designs, joint)
        check_analyses(root, study.analyses, joint)
    check_stand_ins(root, models)
    check_finer(root, models)
    if whole_model is not None:
        check_outputs(tables["designs"], designs, study.quantities_of_interest)
        check_models(tables["designs"], designs, models)
        check_noise(root, designs, models, study.failures or FailurePolicy())


class _Methods(NamedTuple):
    """Designs and surrogates of a study, and where user-defined ones come from."""

    designs: dict[str, Design]
    design_modules: dict[str, tuple[FileSnapshot, ...]]
    surrogates: dict[str, Surrogate]
    surrogate_origins: dict[str, SurrogateOrigin]


def _read_methods(
    tables: Mapping[str, TableReader],
    model: Model | None,
    measured: Mapping[str, MeasuredOutputs | None],
) -> _Methods:
    """Read the designs and surrogates; designs of a data file get their runs from the model."""
    designs, modules = read_designs(tables["designs"], measured)
    surrogates, origins = read_surrogates(tables["surrogates"], list(tables["designs"]))
    if model is not None:
        designs = bind_designs(tables["designs"], designs, model)
    return _Methods(designs, modules, surrogates, origins)


def _read_joint(
    root: TableReader,
    tables: dict[str, TableReader],
    model: Model,
    models: Mapping[str, Variant],
    designs: dict[str, Design],
    seed: int,
) -> tuple[Inputs, JointDistribution, bool]:
    """Read the inputs and how they depend on each other; note those that nothing gives.

    Returns
    -------
    inputs, joint
        What could be read, and the joint distribution of it.
    is_clear : bool
        True if each input that is given could be read.
    """
    if "inputs" not in root and not _expected(root, "inputs"):
        tables["inputs"] = root.inside({}, "inputs")
    groups = read_groups(tables["joint"], model, tables["inputs"])
    inputs = read_inputs(tables["inputs"], model, Stream(seed, "inputs"), groups)
    is_clear = not inputs.unclear
    given_by_tables = None
    if all(variable.unit is not ANY_DIMENSION for variable in model.inputs):
        given_by_tables = check_tables(tables["designs"], designs, inputs.joint)
    if given_by_tables is not None:
        variants = models if models or "models" in root else {ONLY_MODEL: Variant(model, {})}
        given = given_by_tables | groups.owners.keys()
        missing = _note_missing(tables["inputs"], model, variants, given)
        inputs = Inputs(inputs.joint, inputs.unclear | missing)
    joint = read_dependence(
        tables["dependence"], inputs, groups.owners, model, Stream(seed, "dependence")
    )
    return inputs, joint, is_clear


def _expected(root: TableReader, key: str) -> str:
    """Return what is expected of a table that must be there; empty for one that need not be."""
    is_elsewhere = (
        has_data(root)
        or (key == "designs" and BUDGET in root)
        or (key == "inputs" and "joint" in root)
    )
    return "" if is_elsewhere else SECTIONS[key].expected


def _note_missing(
    table: TableReader, first: Model, models: Mapping[str, Variant], given_by_tables: set[str]
) -> set[str]:
    """Note inputs that nothing gives: neither the study nor a column of every table."""
    known = {variable.name for variable in first.inputs}
    if not table.is_given or not known.issuperset(table):
        return set()  # an input may stand there under a name with a mistake
    found: set[str] = set()
    for variant in models.values():
        model = variant.model
        given = given_by_tables.union(table, variant.given)
        for name in filter(known.__contains__, model.missing_inputs(given)):
            alternatives = next((group for group in model.alternatives if name in group), (name,))
            instead = f' (or "{alternatives[1]}")' if len(alternatives) > 1 else ""
            table.add_missing(name, describe(model.input(name).unit) + instead)
            found.update(alternatives)
    return found


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


def _check_readings(root: TableReader, publications: Mapping[str, Publication], name: str) -> None:
    """Note the mistakes in the studies that publications are read by, if there are no others."""
    document = root.document
    if root.problems or not publications:
        return
    stated = _changed_content(document.content, Reading("", {}, {}))
    for publication, each in publications.items():
        for label, reading in each.readings.items():
            place = ("published", publication, "readings", label)
            content = _changed_content(document.content, reading)
            if content == stated and not reading.lost:
                expected = "other values than those of the study"
                root.add_problem(place, "a reading that changes nothing", expected)
            changed = Document(document.label, document.text, content, document.objects)
            try:
                read_study(changed, name, root.folder, trust=root.trust)
            except StudyError as error:
                root.add_problems(error.problems, *place)


def _changed_content(content: Mapping[str, Any], reading: Reading) -> dict[str, Any]:
    """Return the content of a study as a reading changes it, with what figures are compared with.

    An input is replaced as a whole; other tables keep the keys that the reading does not have.
    """
    kept = {key: value for key, value in content.items() if key not in ("published", "surrogates")}
    changed = _merge(kept, {key: each for key, each in reading.changes.items() if key != "inputs"})
    inputs = {**content.get("inputs", {}), **reading.changes.get("inputs", {})}
    return {**changed, "inputs": inputs} if inputs else changed


def _merge(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with changes, merged into the tables inside it."""
    found = dict(table)
    for key, value in changes.items():
        is_inner = isinstance(value, Mapping) and isinstance(found.get(key), Mapping)
        found[key] = _merge(found[key], value) if is_inner else value
    return found


def reading_study(
    study: ValidatedStudy, reading: Reading, runs: int | None = None
) -> ValidatedStudy:
    """Return the study that a publication is read by, with the designs that give its figures.

    These are the first `monte-carlo` design, with another number of runs where one is given, and
    the first `one-at-a-time` design.
    """
    content = _changed_content(study.content, reading)
    designs = {name: each_point_once(each) for name, each in study.designs.items()}
    first = {
        kind: next((name for name, each in designs.items() if isinstance(each, kind)), None)
        for kind in (MonteCarlo, OneAtATime)
    }
    content["designs"] = {
        name: table for name, table in content["designs"].items() if name in first.values()
    }
    if runs is not None and (sample := first[MonteCarlo]) is not None:
        content["designs"][sample] = {"kind": "monte-carlo", "runs": runs}
    # Publications have means, deviations and responses alone.
    content |= {"sensitivity": False, "convergence": False}
    return parse_study(tomli_w.dumps(content), name=study.name, folder=study.folder)


# With fewer points there is no interval of a standard deviation.
FEWEST_PILOT_POINTS = 200


def pilot_study(study: ValidatedStudy, runs: int) -> ValidatedStudy:
    """Return the pilot of a study.

    Its runs are the first of those of the study's first `monte-carlo` design, if it has one. A
    model with noise of its own has two at each point, and `FEWEST_PILOT_POINTS` at least.
    """
    designs = {name: each_point_once(each) for name, each in study.designs.items()}
    independent = (name for name, each in designs.items() if isinstance(each, MonteCarlo))
    name = next(independent, "pilot")
    content = {**study.content}
    content.pop("surrogates", None)
    pilot: dict[str, Any] = {"kind": "monte-carlo", "runs": runs}
    if any(each.model.noise.is_declared for each in study.models.values()):
        pilot |= {"runs": max(runs // 2, FEWEST_PILOT_POINTS), "repeats": 2}
    content["designs"] = {name: pilot}
    try:
        return parse_study(tomli_w.dumps(content), name=study.name, folder=study.folder)
    except StudyError as error:
        head = f"{study.name}: no pilot of independent runs can be made"
        raise StudyError(f"{head}: {error.problems[0]}", error.problems) from None
