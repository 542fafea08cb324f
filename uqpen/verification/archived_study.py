"""Study of an archive, read from its own text; no code is executed unless trusted."""

from __future__ import annotations

import contextlib
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.core.errors import ArchiveError, ModelError, StudyError
from uqpen.core.labels import RUN, RUNS, SAMPLING
from uqpen.core.sampling import Sampling
from uqpen.designs.unloaded import UnloadedDesign
from uqpen.study.analyses_section import ANALYSES_KEY
from uqpen.study.data_section import DATA
from uqpen.study.document import Objects
from uqpen.study.load import parse_study
from uqpen.study.model_section import USER_DEFINED_MODELS
from uqpen.study.named_object import OBJECT
from uqpen.study.study import ValidatedStudy, Variant
from uqpen.study.user_defined_members import (
    is_reference,
    object_members,
    object_surrogates,
    referenced_members,
    referenced_surrogates,
)
from uqpen.verification.unloaded_models import archived_dimensions, unloaded_models

__all__ = [
    "archived_runs",
    "archived_study",
    "find_incompatibility",
    "refuse_user_defined_names",
    "run_inputs",
    "user_defined_analyses",
    "user_defined_members",
    "user_defined_models",
    "user_defined_names",
]


# The keys that name code; ``use`` does so unless it has the name of a model.
_NAMED = ("use", *(key for key in USER_DEFINED_MODELS if key not in (OBJECT, DATA)))


def archived_study(
    tree: xr.DataTree, folder: Path, *, trust: bool, objects: Objects | None = None
) -> ValidatedStudy:
    """Read the study of an archive from its text.

    Parameters
    ----------
    tree, folder
        The archive, and the folder with the files that the study names.
    trust : bool
        True if code that it names may be executed, and requests sent to servers. Otherwise its
        models and analyses cannot be run, but the rest of the study can be used.
    objects : mapping of tuple to object, optional
        Python objects that the study names, as for `parse_study`.

    Raises
    ------
    StudyError
        If it cannot be read here, for example because a file that it names is missing.
    """
    name = str(tree.attrs.get("study_name", "study"))
    text = str(tree.attrs["study_text"])
    known = unloaded_models(tree, _content(text), trust=trust)
    dimensions = {} if trust else archived_dimensions(tree, _content(text))
    objects = {**known, **dimensions, **(objects or {})}
    try:
        study = parse_study(text, name=name, folder=folder, trust=trust, objects=objects)
    except StudyError as error:
        where = f"the files that it names are looked for in {folder.absolute()} (--folder)"
        raise StudyError(f"{error}\n\n{where}", error.problems) from None
    runs = next(iter(archived_runs(tree).values()), {})
    designs = {
        design: _with_archived_sampling(unloaded, runs[design])
        for design, unloaded in study.designs.items()
        if isinstance(unloaded, UnloadedDesign) and design in runs
    }
    return replace(study, designs={**study.designs, **designs})


def _with_archived_sampling(design: UnloadedDesign, runs: xr.Dataset) -> UnloadedDesign:
    with contextlib.suppress(ValueError):  # the record of a damaged archive
        design = replace(design, sampling=Sampling(str(runs.attrs.get(SAMPLING))))
    return replace(design, runs=runs.sizes.get(RUN, 0))


def user_defined_models(text: str) -> list[str]:
    """Return the models that a study names code for, as its text names them."""
    named = [_named_code(table) for table in _model_tables(text)]
    return [code for code in named if code]


def _named_code(table: Mapping[str, Any]) -> str:
    """Return the code that the table of a model names; empty for a named model or an object."""
    named = [table[key] for key in _NAMED if key in table and _is_code(key, table[key])]
    if not named:
        return "" if {"use", OBJECT, DATA} & table.keys() else "a model of an unknown kind"
    # A class, a function, a server, or the words of a command.
    return " ".join(map(str, named[0])) if isinstance(named[0], list) else str(named[0])


def _is_code(key: str, value: object) -> bool:
    return key != "use" or is_reference(value)


def _named_objects(text: str) -> dict[str, list[str]]:
    """Return the names of the Python objects of a study, by their kind."""
    models = [str(table[OBJECT]) for table in _model_tables(text) if OBJECT in table]
    content = _content(text)
    members, surrogates = object_members(content), object_surrogates(content)
    return {"model": models, "design or distribution": members, "surrogate": surrogates}


def user_defined_members(text: str) -> list[str]:
    """Return the designs and distributions that a study names code for."""
    return referenced_members(_content(text))


def user_defined_analyses(text: str) -> list[str]:
    """Return the user-defined analyses that the text of a study names."""
    named = _content(text).get(ANALYSES_KEY)
    references = named if isinstance(named, list) else []
    return [str(each) for each in references if is_reference(each)]


def _model_tables(text: str) -> list[dict[str, Any]]:
    content = _content(text)
    several = content.get("models")
    tables = [content.get("model"), *(several.values() if isinstance(several, dict) else ())]
    return [table for table in tables if isinstance(table, dict)]


def _content(text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return {}  # whoever reads the study will say what is wrong with it


def user_defined_names(text: str) -> list[str]:
    """Return the user-defined code that the text of a study names.

    First models, then designs and distributions, then surrogates, then analyses.
    """
    members = [*user_defined_members(text), *referenced_surrogates(_content(text))]
    return [*user_defined_models(text), *members, *user_defined_analyses(text)]


def refuse_user_defined_names(tree: xr.DataTree, path: Path, *, trust: bool) -> None:
    """Refuse an archive whose study cannot be repeated, or not without executing others' code.

    Raises
    ------
    ArchiveError
        If it is not the archive of a study.
    ModelError
        If that code may not be executed, or its runs come from a file. The message names the models
        and analyses, or the file.
    """
    if is_benchmark(tree):
        raise ArchiveError(
            f"{path}: contains a benchmark of methods, which `uqpen compare` repeats"
        )
    text = str(tree.attrs["study_text"])
    if files := [str(table[DATA]) for table in _model_tables(text) if DATA in table]:
        raise ModelError(
            f"{path}: its runs come from a file ({', '.join(files)}), and no model can make them "
            "again; uqpen verify reads them again"
        )
    for kind, objects in _named_objects(text).items():
        if objects:
            raise ModelError(
                f"{path}: its {kind} is an object of a Python program ({', '.join(objects)}), "
                "which no archive contains; run that program again"
            )
    named = user_defined_names(text)
    if named and not trust:
        raise ModelError(
            f"{path}: its study executes code that it names: {', '.join(named)}\n"
            "  if you trust its author, use --trust"
        )


def archived_runs(tree: xr.DataTree) -> dict[str, dict[str, xr.Dataset]]:
    """Return the runs of every design by model."""
    return {
        name: {design: read_group(model, RUNS, design) for design in group_names(model, RUNS)}
        for name, model in model_trees(tree).items()
    }


def find_incompatibility(
    study: ValidatedStudy, runs: Mapping[str, Mapping[str, xr.Dataset]]
) -> str:
    """Reason why runs cannot be those of a study; empty if they can."""
    if set(study.models) != set(runs):
        return f"its text names other models than it holds: {_list_names(study.models)}"
    for name, variant in study.models.items():
        if set(study.designs) != set(runs[name]):
            return f"its text names other designs than it holds: {_list_names(study.designs)}"
        for design, design_runs in runs[name].items():
            if design_runs.attrs.get(SAMPLING) != str(study.designs[design].sampling):
                return f"its text has another kind of design by the name of {design}"
            if lacking := _missing_variable(variant, study, design_runs):
                return f"{design} lacks {lacking}, which its text contains"
    return ""


def _missing_variable(variant: Variant, study: ValidatedStudy, made: xr.Dataset) -> str:
    """Return the name of an input or output that runs lack."""
    for output in variant.model.all_outputs:
        kind = "i" if output.categories else "f"
        dims = (RUN, *(dimension.name for dimension in output.dims))
        if output.name not in made or made[output.name].dims != dims:
            return output.name
        if made[output.name].dtype.kind != kind:
            return output.name
        for dimension in output.dims:
            if not np.array_equal(made[dimension.name].values, dimension.values):
                return dimension.name
    needed = {entry.variable.name for entry in study.joint.inputs} | set(variant.given)
    for name in sorted(needed.union(run_inputs(study, made))):
        found = made.variables.get(name)
        if found is None or found.dims not in ((), (RUN,)) or found.dtype.kind != "f":
            return name
    return next(variant.model.missing_inputs(run_inputs(study, made)), "")


def run_inputs(study: ValidatedStudy, made: xr.Dataset) -> list[str]:
    """Return the inputs of runs: of the joint distribution, and given by a table or a model."""
    return [variable.name for variable in study.joint.variables if variable.name in made]


def _list_names(names: Mapping[str, object]) -> str:
    return ", ".join(names) or "a single one"
