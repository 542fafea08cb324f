"""What determines the runs and the archive of a study: text, files, versions and models."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator
from typing import Any

from uqpen.archive.provenance import CONVENTIONS, SCHEMA, of_python_functions, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE
from uqpen.core.catalogue import INTERVAL_RECIPE
from uqpen.core.dependency import Dependency
from uqpen.core.labels import CONFIDENCE_LEVEL, DEPENDENCIES, RECIPE
from uqpen.core.lookup import class_version
from uqpen.core.model import Model
from uqpen.designs.design import RUNS, STATISTICS
from uqpen.distributions.truncated import Truncated
from uqpen.models.python_function import PythonFunction
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.statistics.estimate import LEVEL
from uqpen.study import SECTIONS
from uqpen.study.study import ValidatedStudy
from uqpen.study.user_defined_members import referenced_members
from uqpen.surrogates.refinement import RefinedDesign

__all__ = [
    "POINT_TABLES",
    "dependency_hashes",
    "flatten_tables",
    "is_user_defined",
    "level_attribute",
    "model_fingerprint",
    "model_identity",
    "point_classes",
    "root_attributes",
    "run_fingerprint",
]

# Sections that determine the points of every design. The title does not, nor what is asked of the
# runs, nor what they are held against.
POINT_TABLES = tuple(key for key, section in SECTIONS.items() if section.determines_points)


def run_fingerprint(study: ValidatedStudy, model: str, design: str) -> dict[str, str]:
    """Return the properties that determine the runs of a model in a design, as texts by key.

    That is the model, the inputs, the constraints, the seed, the design, the files that these name,
    and the software. Modules that a model imports only during its runs are recorded by the runs.
    """
    content = tomllib.loads(study.text)
    tables = {name: content[name] for name in POINT_TABLES if name in content}
    if "designs" in content:
        tables["designs"] = {design: _point_settings(content["designs"][design])}
    if isinstance(refined := study.designs[design], RefinedDesign):
        tables["surrogates"] = {refined.name: content["surrogates"][refined.name]}
        tables["outputs"] = content.get("outputs", {})
    if model:
        tables["models"] = {model: content["models"][model]}
    else:
        tables["model"] = content["model"]
    adapter = study.models[model].model
    files = [*adapter.files(), *study.joint.files, *study.design_files(design)]
    versions = {
        f"{member} {key}": value
        for member, cls in point_classes(study, design)
        for key, value in class_version(cls).items()
    }
    has_user_defined_code = is_user_defined(adapter) or bool(versions or referenced_members(tables))
    return {
        **dict(flatten_tables(tables)),
        **{f"model {name}": value for name, value in adapter.identity().items()},
        **versions,
        **{f"file {file.path.name}": file.sha256 for file in files},
        **dependency_hashes(adapter.dependencies()),
        **provenance(),
        **(of_python_functions() if has_user_defined_code else {}),
    }


def model_fingerprint(study: ValidatedStudy, name: str) -> dict[str, str]:
    """Return the properties that determine a run of a model at given inputs, as texts by key.

    They are those of `run_fingerprint` that no design has a part in.
    """
    content = tomllib.loads(study.text)
    tables = {"constraints": content["constraints"]} if "constraints" in content else {}
    tables |= {"models": {name: content["models"][name]}} if name else {"model": content["model"]}
    model = study.models[name].model
    return {
        **dict(flatten_tables(tables)),
        **{f"model {key}": value for key, value in model.identity().items()},
        **{f"file {file.path.name}": file.sha256 for file in model.files()},
        **dependency_hashes(model.dependencies()),
        **provenance(),
        **(of_python_functions() if is_user_defined(model) else {}),
    }


def dependency_hashes(lines: Iterable[str]) -> dict[str, str]:
    """Return the hashes of dependencies, by their names in a message."""
    found = (Dependency.from_line(line) for line in lines)
    return {each.label: each.sha256 for each in sorted(found) if each.sha256}


def _point_settings(table: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a design that determine its runs, so without `keep`."""
    if table.get("keep") not in (RUNS, STATISTICS):  # a user-defined design may have another
        return table
    return {key: value for key, value in table.items() if key != "keep"}


def is_user_defined(model: Model) -> bool:
    """Return True for a user-defined model in Python."""
    return isinstance(model, PythonFunction | UserDefinedModel)


def point_classes(study: ValidatedStudy, design: str) -> Iterator[tuple[str, type]]:
    """Yield the classes that determine the points of a design, with a text for each."""
    yield f"design {design}", type(study.designs[design])
    if study.joint.dependence is not None:
        yield "dependence", type(study.joint.dependence)
    for entry in study.joint.random:
        distribution = entry.distribution
        distribution = distribution.parent if isinstance(distribution, Truncated) else distribution
        yield f"distribution of {entry.variable.name}", type(distribution)


def flatten_tables(table: dict[str, Any], *path: str) -> Iterator[tuple[str, str]]:
    """Yield values of nested tables by dotted key; the distribution of an input is one value."""
    for key, value in table.items():
        if isinstance(value, dict) and path[:1] != ("inputs",):
            yield from flatten_tables(value, *path, key)
        else:
            yield ".".join((*path, key)), json.dumps(value, ensure_ascii=False, default=str)


def root_attributes(study: ValidatedStudy) -> dict[str, str | int]:
    """Return the attributes of an archive's root, which determine its numbers."""
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
        **_section_attributes(study),
        **({} if study.has_several_models else model_identity(study.model)),
        **provenance(),
        **of_python_functions(),
    }


def _section_attributes(study: ValidatedStudy) -> dict[str, str]:
    """Return what sections of the study state at the root."""
    sections = [each for each in SECTIONS.values() if each.attribute]
    stated = {each.attribute: getattr(study, each.field) for each in sections}
    return {
        name: ", ".join(value) if isinstance(value, tuple) else str(value)
        for name, value in stated.items()
        if value
    }


def level_attribute(study: ValidatedStudy) -> dict[str, float]:
    """Return the confidence level of a study that states another than the default."""
    level = study.confidence_level
    return {} if level == LEVEL else {CONFIDENCE_LEVEL: level}


def model_identity(model: Model) -> dict[str, str]:
    """Return the identity of a model, and what its runs depend on, as attributes of its group."""
    lines = sorted(model.dependencies())
    return {
        **{f"model_{key}": value for key, value in model.identity().items()},
        **({DEPENDENCIES: "\n".join(lines)} if lines else {}),
    }
