"""Fingerprint of runs: the parts of a study that determine them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator
from typing import Any

from uqpen.archive.provenance import of_python_functions, provenance
from uqpen.core.dependency import Dependency
from uqpen.core.lookup import class_version
from uqpen.core.model import Model
from uqpen.designs.design import RUNS, STATISTICS
from uqpen.distributions.truncated import Truncated
from uqpen.models.python_function import PythonFunction
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.study import SECTIONS
from uqpen.study.study import ValidatedStudy
from uqpen.study.user_defined_members import referenced_members
from uqpen.surrogates.refinement import RefinedDesign

__all__ = [
    "POINT_TABLES",
    "dependency_hashes",
    "flatten_tables",
    "is_user_defined",
    "model_fingerprint",
    "point_classes",
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
