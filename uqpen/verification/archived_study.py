"""Study of an archive, restored from its own text, runs and files; no code runs unless trusted."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.files import FILES, archived_files, extract_files
from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.core.dependency import file_sha256
from uqpen.core.errors import ArchiveError, ModelError, SettingsError, StudyError, UqpenError
from uqpen.core.labels import (
    CURVE_MAY_END,
    DERIVED_FROM,
    DERIVED_INPUT,
    ROLE,
    RUN,
    RUNS,
    SAMPLING,
    SURROGATES,
)
from uqpen.core.model import Category, Dimension, Input, Output
from uqpen.core.sampling import Sampling
from uqpen.core.variables import code_labels
from uqpen.designs.design import UnloadedDesign
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.study.data_section import DATA
from uqpen.study.document import Objects, inner_table
from uqpen.study.identity import (
    StudyIdentity,
    archived_content,
    archived_identity,
    study_identity,
)
from uqpen.study.load import parse_study
from uqpen.study.model_section import USER_DEFINED_MODELS
from uqpen.study.outputs_section import ANALYSES_KEY
from uqpen.study.study import ValidatedStudy, Variant
from uqpen.study.table_reader import OBJECT
from uqpen.study.user_defined_members import (
    is_reference,
    named_objects,
    named_references,
)
from uqpen.study.variables_section import dimensions_from_model
from uqpen.surrogates.archived_surrogate import restore_surrogate, surrogate_paths
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

# Archived runs by model and design.
Runs = Mapping[str, Mapping[str, xr.Dataset]]

# The keys that name code; ``use`` does so unless it has the name of a model.
_CODE_KEYS = ("use", *(key for key in USER_DEFINED_MODELS if key not in (OBJECT, DATA)))


# What the text names


class NamedCode(NamedTuple):
    """Code, Python objects and data files that the text of a study names."""

    models: list[str]  # code of models
    members: list[str]  # code of designs and distributions
    surrogates: list[str]  # code of surrogates
    analyses: list[str]  # code of analyses
    objects: dict[str, list[str]]  # Python objects by their kind
    data: list[str]  # files that runs come from

    @property
    def code(self) -> list[str]:
        """All code: of models first, then of members, surrogates and analyses."""
        return [*self.models, *self.members, *self.surrogates, *self.analyses]


def named_code(tree: xr.DataTree) -> NamedCode:
    """Return what the study of an archive names that is not built in."""
    content = archived_content(tree)
    several = content.get("models")
    tables = [content.get("model"), *(several.values() if isinstance(several, dict) else ())]
    models = [table for table in tables if isinstance(table, dict)]
    listed = content.get(ANALYSES_KEY)
    analyses = listed if isinstance(listed, list) else []
    return NamedCode(
        models=[code for code in map(_model_code, models) if code],
        members=named_references(content, "designs", "inputs"),
        surrogates=named_references(content, "surrogates"),
        analyses=[str(each) for each in analyses if is_reference(each)],
        objects={
            "model": [str(table[OBJECT]) for table in models if OBJECT in table],
            "design or distribution": named_objects(content, "designs", "inputs", "joint"),
            "surrogate": named_objects(content, "surrogates"),
        },
        data=[str(table[DATA]) for table in models if DATA in table],
    )


def _model_code(table: Mapping[str, Any]) -> str:
    """Return the code that the table of a model names; empty for a named model or an object."""
    for key in _CODE_KEYS:
        if key in table and (key != "use" or is_reference(table[key])):
            # A class, a function, a server, or the words of a command.
            named = table[key]
            return " ".join(map(str, named)) if isinstance(named, list) else str(named)
    return "" if {"use", OBJECT, DATA} & table.keys() else "a model of an unknown kind"


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
    named = named_code(tree)
    if named.data:
        raise ModelError(
            f"{path}: its runs come from a file ({', '.join(named.data)}), and no model can make "
            "them again; uqpen verify reads them again"
        )
    for kind, objects in named.objects.items():
        if objects:
            raise ModelError(
                f"{path}: its {kind} is an object of a Python program ({', '.join(objects)}), "
                "which no archive contains; run that program again"
            )
    if named.code and not trust:
        raise ModelError(
            f"{path}: its study executes code that it names: {', '.join(named.code)}\n"
            "  if you trust its author, use --trust"
        )


# The study, with stand-ins for what is not loaded


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
    objects = {**_stand_ins(tree, trust=trust), **(objects or {})}
    try:
        study = parse_study(
            str(tree.attrs["study_text"]), name=name, folder=folder, trust=trust, objects=objects
        )
    except StudyError as error:
        where = f"the files that it names are looked for in {folder.absolute()} (--folder)"
        raise StudyError(f"{error}\n\n{where}", error.problems) from None
    runs = next(iter(archived_runs(tree).values()), {})
    designs = dict(study.designs)
    for label, design in study.designs.items():
        if isinstance(design, UnloadedDesign) and label in runs:
            made = runs[label]
            with contextlib.suppress(ValueError):  # the record of a damaged archive
                design = replace(design, sampling=Sampling(str(made.attrs.get(SAMPLING))))
            designs[label] = replace(design, runs=made.sizes.get(RUN, 0))
    return replace(study, designs=designs)


def _stand_ins(tree: xr.DataTree, *, trust: bool) -> dict[tuple[str | int, ...], object]:
    """Return what stands in for models and coordinates in code that is not loaded.

    The archived runs say what they are. Each has the path of its table, as the objects of
    `parse_study`. Objects of a Python program have a stand-in also where classes are trusted.
    """
    found: dict[tuple[str | int, ...], object] = {}
    content = archived_content(tree)
    for name, group in model_trees(tree).items():
        path = ("models", name) if name and "models" in content else ("model",)
        table = inner_table(content, *path)
        for design in group_names(group, RUNS)[:1]:
            runs = read_group(group, RUNS, design)
            if table.get("class") is True and OBJECT in table:
                found[path] = _model(str(table[OBJECT]), runs, is_absent=True)
            elif is_reference(table.get("use")) and not trust:
                found[path] = _model(str(table["use"]), runs, is_absent=False)
            for inner in () if trust else dimensions_from_model(table):
                # A damaged archive may have none, or another; the study then says so.
                with contextlib.suppress(SettingsError, KeyError):
                    found[*path, *inner] = _dimension(inner[-1], runs)
    return found


def _model(reference: str, runs: xr.Dataset, *, is_absent: bool) -> UnloadedModel:
    """Return a model with the inputs and outputs of runs; a value for all runs is a default."""
    inputs: list[Input] = []
    outputs: list[Output] = []
    for name in map(str, runs.data_vars):
        variable = runs.variables[name]
        if variable.attrs.get(ROLE) in ("input", DERIVED_INPUT):
            is_number = not variable.dims and variable.dtype.kind == "f"
            default = float(variable.values) if is_number else None
            codes = code_labels(variable.attrs)
            inputs.append(Input(*_texts(name, variable), default=default, labels=codes))
        elif variable.attrs.get(ROLE) == "output" and DERIVED_FROM not in variable.attrs:
            flags = str(variable.attrs.get("flag_meanings", "")).split()
            labels = map(str, np.atleast_1d(variable.attrs.get("flag_labels", flags)))
            outputs.append(
                Output(
                    *_texts(name, variable),
                    categories=tuple(map(Category, flags, labels)),
                    dims=tuple(_dimension(str(dim), runs) for dim in variable.dims if dim != RUN),
                    may_end=variable.attrs.get("comment") == CURVE_MAY_END,
                )
            )
    return UnloadedModel(reference, tuple(inputs), tuple(outputs), is_absent)


def _dimension(name: str, runs: xr.Dataset) -> Dimension:
    coordinates = runs.variables[name]
    return Dimension(*_texts(name, coordinates), values=tuple(coordinates.values.tolist()))


def _texts(name: str, variable: xr.Variable) -> tuple[str, str, str, str]:
    """Return the name, SI unit, title and display unit of a variable."""
    keys = {"units": "1", "long_name": "", "display_units": ""}
    return name, *(str(variable.attrs.get(*pair)) for pair in keys.items())  # type: ignore[return-value]


# The study with its files


class RestoredStudy(NamedTuple):
    """A study of an archive that can be repeated.

    Either its files are the archived ones (`has_kept_files`), or each that differs has a line.
    """

    study: ValidatedStudy
    has_kept_files: bool
    different_files: list[str]


@contextlib.contextmanager
def restored_study(
    tree: xr.DataTree, folder: Path | None, *, trust: bool, objects: Objects | None = None
) -> Iterator[RestoredStudy]:
    """Provide an archive's study such that it can be repeated.

    Parameters
    ----------
    folder : Path or None
        Folder with the files that the study names; None for the archived files. Files that the
        archive has only as hashes are then taken from the current folder.
    trust, objects
        As for `archived_study`.

    Raises
    ------
    ArchiveError
        If its files do not match their hashes, or cannot be in a folder.
    StudyError
        If the study cannot be read, for example because a file that it names is missing.
    """
    here = Path.cwd()
    identity, files = archived_identity(tree), archived_files(read_group(tree, FILES))
    if folder is not None or not files:
        folder = folder or here
        study = archived_study(tree, folder, trust=trust, objects=objects)
        differing = _different_files(study, identity, folder.absolute())
        # No other stands in for a file that the archive knows by its hash alone.
        known = {file.name for file in files if not file.is_whole}
        if refused := [reason for name, reason in differing.items() if name in known]:
            raise ArchiveError("\n".join(refused))
        yield RestoredStudy(study, has_kept_files=False, different_files=list(differing.values()))
        return
    with extract_files(files, here) as (place, missing):
        try:
            study = archived_study(tree, place, trust=trust, objects=objects)
        except UqpenError as error:
            # The message does not name the temporary folder.
            message = str(error).partition("\n\nthe files that it names")[0]
            message = message.replace(f"{place}{os.sep}", "")
            advice = "the files that it names are the archived ones (others: --folder)"
            problems = error.problems if isinstance(error, StudyError) else ()
            raise StudyError("\n".join([message, "", *missing, advice]), problems) from None
        if differing := _different_files(study, identity, None):
            advice = "named by an absolute path, and changed since then (use it anyway: --folder)"
            raise ArchiveError("\n".join([*differing.values(), advice]))
        yield RestoredStudy(study, has_kept_files=True, different_files=[])


def study_surrogate(
    study: ValidatedStudy, tree: xr.DataTree, label: str
) -> tuple[str, xr.DataTree, FittedSurrogate]:
    """Restore a surrogate of an archive with the classes and models of its restored study.

    `label` is a key of `surrogate_paths`. Returned are the name of its model, its group in the
    archive, and the surrogate.
    """
    model, name = surrogate_paths(tree)[label]
    group, settings = model_trees(tree)[model].children[SURROGATES].children[name], study.surrogates
    loaded = None if settings[name].absence else type(settings[name])
    original = study.models[model].model
    return model, group, restore_surrogate(group, label, original, loaded=loaded)


def with_kept_folders(study: ValidatedStudy, folder: Path) -> ValidatedStudy:
    """Return a study whose programs keep the folders of their runs in another folder.

    Programs of several models get a folder each in that folder, when the first one is kept.
    """
    models = {
        name: replace(variant, model=variant.model.with_folder(folder / name))
        for name, variant in study.models.items()
    }
    return replace(study, models=models)


def _different_files(
    study: ValidatedStudy, archived: StudyIdentity, folder: Path | None
) -> dict[str, str]:
    """Return the difference of each file from the archived one, including files in a folder."""
    kept, read = archived.files, study_identity(study).files
    beside = {name: file_sha256(folder / name) for name in kept.keys() - read.keys() if folder}
    differing = {name: f"{name}: is not there" for name, found in beside.items() if not found}
    for name, found in sorted({**read, **beside}.items()):
        # An absolute path can have been another on the machine that made the archive.
        if found and found != kept.get(name) and found not in kept.values():
            expected = kept.get(name, "none, as the archive has no such file")
            differing[name] = f"{name}: found the SHA-256 {found}, expected {expected}"
    return differing


# The runs


def archived_runs(tree: xr.DataTree) -> dict[str, dict[str, xr.Dataset]]:
    """Return the runs of every design by model."""
    return {
        name: {design: read_group(model, RUNS, design) for design in group_names(model, RUNS)}
        for name, model in model_trees(tree).items()
    }


def find_incompatibility(study: ValidatedStudy, runs: Runs) -> str:
    """Reason why runs cannot be those of a study; empty if they can."""
    if set(study.models) != set(runs):
        names = ", ".join(study.models) or "a single one"
        return f"its text names other models than it holds: {names}"
    for name, variant in study.models.items():
        if set(study.designs) != set(runs[name]):
            return f"its text names other designs than it holds: {', '.join(study.designs)}"
        for design, design_runs in runs[name].items():
            if design_runs.attrs.get(SAMPLING) != str(
                study.designs[design].sampling_of(study.joint)
            ):
                return f"its text has another kind of design by the name of {design}"
            if lacking := _missing_variable(variant, study, design_runs):
                return f"{design} lacks {lacking}, which its text contains"
    return ""


def _missing_variable(variant: Variant, study: ValidatedStudy, made: xr.Dataset) -> str:
    """Return the name of an input or output that runs lack."""
    for output in variant.model.all_outputs:
        kind = "i" if output.categories else "f"
        dims = (RUN, *(dimension.name for dimension in output.dims))
        found = made.variables.get(output.name)
        if found is None or found.dims != dims or found.dtype.kind != kind:
            return output.name
        for dimension in output.dims:
            if not np.array_equal(made[dimension.name].values, dimension.values):
                return dimension.name
    needed = {entry.variable.name for entry in study.joint.inputs} | set(variant.given)
    needed |= {variant.model.noise.seed} - {""}
    for name in sorted(needed.union(run_inputs(study, made))):
        found = made.variables.get(name)
        kind = "i" if name == variant.model.noise.seed else "f"
        if found is None or found.dims not in ((), (RUN,)) or found.dtype.kind != kind:
            return name
    return next(variant.model.missing_inputs(run_inputs(study, made)), "")


def run_inputs(study: ValidatedStudy, made: xr.Dataset) -> list[str]:
    """Return the inputs of runs: of the joint distribution, given by a table or a model, seeds."""
    names = [variable.name for variable in study.joint.variables if variable.name in made]
    seeds = {each.model.noise.seed for each in study.models.values()}.intersection(made.data_vars)
    return [*dict.fromkeys([*names, *map(str, sorted(seeds))])]
