"""Identity of a study, of its runs and of its archive: text, files, versions and models."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.files import FILES, archived_files, files_by_name
from uqpen.archive.provenance import CONVENTIONS, SCHEMA, of_python_functions, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE, model_trees, read_group
from uqpen.core.catalogue import INTERVAL_RECIPE
from uqpen.core.dependency import Dependency
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import CONFIDENCE_LEVEL, DEPENDENCIES, FINER_THAN, RECIPE
from uqpen.core.lookup import class_version
from uqpen.core.model import Model
from uqpen.designs.design import RUNS, STATISTICS
from uqpen.designs.repeated import each_point_once
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.univariate import Mixture, Truncated
from uqpen.models.python_function import PythonFunction
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.statistics.estimate import LEVEL
from uqpen.study import SECTIONS
from uqpen.study.study import ValidatedStudy
from uqpen.study.user_defined_members import (
    named_objects,
    named_references,
    user_defined_objects,
)
from uqpen.surrogates.refinement import RefinedDesign

# Sections that determine the points of every design. The title does not, nor what is asked of the
# runs, nor what they are compared with.
POINT_TABLES = tuple(key for key, section in SECTIONS.items() if section.determines_points)


# What a study says of a model and its runs, and what changes none: a seed would.
_OF_NO_RUN = ("noise", FINER_THAN)

# Begins the names of attributes of an archive that distinguish the versions of a model.
MODEL_PREFIX = "model_"


class ModelIdentity(NamedTuple):
    """Identity of a model: all that decides a run at given inputs, in a study or an archive."""

    # Its name, and what distinguishes its versions, as in `Model.identity`.
    attributes: Mapping[str, str]
    table: Mapping[str, str]  # its table of the study, flattened, without the inputs that it sets
    constraints: Mapping[str, str]  # the same of the constraints
    # The hashes of the files that it names, and of those that it has used so far, by name; in an
    # archive those of all models.
    files: Mapping[str, str]
    dependencies: tuple[Dependency, ...]  # what it has used so far
    software: Mapping[str, str]  # versions that its last digits depend on

    # What no archive says.

    uncompared: tuple[str, ...] = ()  # what decides its runs and cannot be compared, in words
    # Why its versions cannot be distinguished from those of an archive; empty if they can.
    unknown: str = ""
    # True if its results may depend on the runs that are made with them.
    depends_on_batch: bool = False
    # All of that which says whether finished runs are still its own.
    fingerprint: Mapping[str, str] = MappingProxyType({})
    folder: Path = Path()  # folder of the study
    surroundings: ModelFolder | None = None  # the folder from which its runs import modules


class StudyIdentity(NamedTuple):
    """Identity of a study: all that decides its archive, gathered at once or read from that."""

    attributes: Mapping[str, Any]  # those of the archive's root
    content: Mapping[str, Any]  # the text of the study, parsed; empty for a text that is damaged
    models: Mapping[str, ModelIdentity]  # by name
    files: Mapping[str, str]  # the hashes of all files that it names, by name

    # What no archive says.

    # The properties that determine the runs of a design, by model and design.
    runs: Mapping[tuple[str, str], Mapping[str, str]] = MappingProxyType({})
    # Why versions of its parts cannot be distinguished, each with a word for the part.
    unknown: tuple[tuple[str, str], ...] = ()
    is_known: bool = True  # true if the archive states the version of all that it consists of


def study_identity(study: ValidatedStudy) -> StudyIdentity:
    """Gather what decides the archive of a study."""
    objects = user_defined_objects(study.content)
    reasons = (variant.model.unknown_dependency for variant in study.models.values())
    unknown = [(reason, "the model") for reason in reasons if reason]
    unknown += [(f"{name} is a Python object", "it") for name in objects]
    classes = [cls for design in study.designs for _, cls in _point_classes(study, design)]
    classes += map(type, study.surrogates.values())
    is_known = (
        not (objects or named_objects(study.content, "surrogates"))
        and not any(map(class_version, classes))
        and all(analysis.surroundings is not None for analysis in study.analyses)
    )
    runs = {
        (model, design): run_fingerprint(study, model, design)
        for model in study.models
        for design in study.designs
    }
    files = files_by_name(study.files(), study.folder)
    return StudyIdentity(
        {**root_attributes(study), **level_attribute(study)},
        study.content,
        {name: model_identity(study, name, files) for name in study.models},
        {name: file.sha256 for name, file in files.items()},
        runs,
        tuple(unknown),
        is_known,
    )


def model_identity(
    study: ValidatedStudy, name: str, files: Mapping[str, FileSnapshot] | None = None
) -> ModelIdentity:
    """Gather what decides the runs of a model of a study, whose `files` have the archive's names.

    Without them, they are gathered.
    """
    content, model = study.content, study.models[name].model
    table, constraints = model_tables(content, name)
    tables = {key: content[key] for key in ("constraints",) if key in content}
    tables |= _model_table(content, name)
    surroundings, unknown = None, ""
    if isinstance(model, PythonFunction | UserDefinedModel):
        surroundings = model.surroundings
    if model.unknown_dependency:
        unknown = f"its model has versions that cannot be distinguished: {model.unknown_dependency}"
    elif isinstance(model, PythonFunction) and surroundings and not surroundings.imported:
        unknown = f"no archive says which version of {model.name} its runs were made with"
    software = {**provenance(), **(of_python_functions() if is_user_defined(model) else {})}
    files = files_by_name(study.files(), study.folder) if files is None else files
    own = {file.path for file in model.files()}
    return ModelIdentity(
        model.identity(),
        table,
        constraints,
        {key: file.sha256 for key, file in files.items() if file.path in own},
        tuple(map(Dependency.from_line, model.dependencies())),
        software,
        tuple(model.uncompared),
        unknown,
        depends_on_batch(model),
        {**dict(_flatten_tables(tables)), **_model_properties(model), **software},
        study.folder,
        surroundings,
    )


def archived_identity(tree: xr.DataTree) -> StudyIdentity:
    """Gather what an archive says of what decided it; nothing of it is executed."""
    content = archived_content(tree)
    files = {file.name: file.sha256 for file in archived_files(read_group(tree, FILES))}
    models = {}
    for name, model in model_trees(tree).items():
        attributes = {str(key): str(value) for key, value in model.attrs.items()}
        lines = sorted(filter(None, attributes.get(DEPENDENCIES, "").split("\n")))
        models[name] = ModelIdentity(
            {
                key.removeprefix(MODEL_PREFIX): value
                for key, value in attributes.items()
                if key.startswith(MODEL_PREFIX)
            },
            *model_tables(content, name),
            files,
            tuple(map(Dependency.from_line, lines)),
            {str(key): str(value) for key, value in tree.attrs.items()},
        )
    attributes = {str(key): value for key, value in tree.attrs.items()}
    return StudyIdentity(attributes, content, models, files)


def archived_content(tree: xr.DataTree) -> dict[str, Any]:
    """Parse the text of the study of an archive; empty for a text that is damaged.

    Whoever reads the study says what is wrong with it.
    """
    try:
        return tomllib.loads(str(tree.attrs.get("study_text", "")))
    except (ValueError, RecursionError):
        return {}


def model_tables(content: Mapping[str, Any], name: str) -> tuple[dict[str, str], dict[str, str]]:
    """Return the table of a model and the constraints as texts by dotted key.

    The inputs that the model sets itself are left out.
    """
    is_one_of_several = name and "models" in content  # each value of a sweep has the one model
    table = content["models"].get(name, {}) if is_one_of_several else content.get("model", {})
    kept = {key: value for key, value in table.items() if key not in ("with", *_OF_NO_RUN)}
    constraints = {"constraints": content.get("constraints", {})}
    return dict(_flatten_tables({"model": kept})), dict(_flatten_tables(constraints))


def _model_table(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the table of a model in its place, without what changes none of its runs."""
    is_one_of_several = name and "models" in content
    table = content["models"][name] if is_one_of_several else content["model"]
    kept = {key: value for key, value in table.items() if key not in _OF_NO_RUN}
    return {"models": {name: kept}} if is_one_of_several else {"model": kept}


def depends_on_batch(model: Model) -> bool:
    """Return True for a model whose results may depend on the runs that are made with them."""
    return model.vectorized and not model.is_batch_independent


def run_fingerprint(study: ValidatedStudy, model: str, design: str) -> dict[str, str]:
    """Return the properties that determine the runs of a model in a design, as texts by key.

    That is the model, the inputs, the constraints, the seed, the design, the files that these name,
    and the software. Modules that a model imports only during its runs are recorded by the runs.
    """
    content = study.content
    tables = {name: content[name] for name in POINT_TABLES if name in content}
    if "designs" in content:
        # What is kept of the runs does not determine them; a user-defined design may have another
        # setting of this name.
        table = content["designs"][design]
        is_kept = table.get("keep") in (RUNS, STATISTICS)
        own = {key: table[key] for key in table if not (is_kept and key == "keep")}
        tables["designs"] = {design: own}
    wanted = getattr(study.designs[design], "experiments", None)
    if wanted is not None and wanted.sections:
        tables["measured"] = {each.name: content["measured"][each.name] for each in wanted.sections}
    if isinstance(refined := study.designs[design], RefinedDesign):
        tables["surrogates"] = {refined.name: content["surrogates"][refined.name]}
        tables["outputs"] = content.get("outputs", {})
    tables |= _model_table(content, model)
    if study.swept:
        tables["sweep"] = {**study.models[model].given}
    adapter = study.models[model].model
    others = [*study.joint.files, *study.design_files(design)]
    versions = {
        f"{member} {key}": value
        for member, cls in _point_classes(study, design)
        for key, value in class_version(cls).items()
    }
    has_user_defined_code = is_user_defined(adapter) or bool(
        versions or named_references(tables, "designs", "inputs")
    )
    return {
        **dict(_flatten_tables(tables)),
        **versions,
        **_model_properties(adapter),
        **{f"file {file.path.name}": file.sha256 for file in others},
        **provenance(),
        **(of_python_functions() if has_user_defined_code else {}),
    }


def _model_properties(model: Model) -> dict[str, str]:
    """Return what distinguishes a model's versions, its files and what it has used, as texts."""
    used = sorted(map(Dependency.from_line, model.dependencies()))
    return {
        **{f"model {key}": value for key, value in model.identity().items()},
        **{f"file {file.path.name}": file.sha256 for file in model.files()},
        **{each.label: each.sha256 for each in used if each.sha256},
    }


def is_user_defined(model: Model) -> bool:
    """Return True for a user-defined model in Python."""
    return isinstance(model, PythonFunction | UserDefinedModel)


def _point_classes(study: ValidatedStudy, design: str) -> Iterator[tuple[str, type]]:
    """Yield the classes that determine the points of a design, with a text for each."""
    yield f"design {design}", type(each_point_once(study.designs[design]))
    if study.joint.dependence is not None:
        yield "dependence", type(study.joint.dependence)
    for entry in study.joint.random:
        for part in _single_distributions(entry.distribution):
            yield f"distribution of {entry.variable.name}", type(part)


def _single_distributions(distribution: Distribution) -> Iterator[Distribution]:
    """Yield the distributions that another is made of, or itself."""
    if isinstance(distribution, Truncated):
        yield from _single_distributions(distribution.parent)
    elif isinstance(distribution, Mixture):
        for part in distribution.parts:
            yield from _single_distributions(part)
    else:
        yield distribution


def _flatten_tables(table: dict[str, Any], *path: str) -> Iterator[tuple[str, str]]:
    """Yield values of nested tables by dotted key; the distribution of an input is one value."""
    for key, value in table.items():
        if isinstance(value, dict) and path[:1] != ("inputs",):
            yield from _flatten_tables(value, *path, key)
        else:
            yield ".".join((*path, key)), json.dumps(value, ensure_ascii=False, default=str)


def root_attributes(study: ValidatedStudy) -> dict[str, str | int]:
    """Return the attributes of an archive's root, which determine its numbers."""
    sections = [each for each in SECTIONS.values() if each.attribute]
    stated = {each.attribute: getattr(study, each.field) for each in sections}
    return {
        "title": study.title,
        "Conventions": CONVENTIONS,
        SCHEMA_ATTRIBUTE: SCHEMA,
        RECIPE: INTERVAL_RECIPE,
        "study_name": study.name,
        "study_text": study.text,
        "study_sha256": study.sha256,
        # As text: a seed may be larger than any integer of NetCDF.
        "seed": str(study.seed),
        **{
            name: ", ".join(value) if isinstance(value, tuple) else str(value)
            for name, value in stated.items()
            if value
        },
        **({} if study.has_several_models else model_attributes(study.model)),
        **provenance(),
        **of_python_functions(),
    }


def level_attribute(study: ValidatedStudy) -> dict[str, float]:
    """Return the confidence level of a study that states another than the default."""
    level = study.confidence_level
    return {} if level == LEVEL else {CONFIDENCE_LEVEL: level}


def model_attributes(model: Model) -> dict[str, str]:
    """Return the identity of a model, and what its runs depend on, as attributes of its group."""
    lines = sorted(model.dependencies())
    return {
        **{f"{MODEL_PREFIX}{key}": value for key, value in model.identity().items()},
        **({DEPENDENCIES: "\n".join(lines)} if lines else {}),
    }
