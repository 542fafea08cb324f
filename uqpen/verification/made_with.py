"""Versions, programs and sources that an archive was made with, against those of today."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.archive.files import FILES
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import model_trees
from uqpen.core.labels import REUSED_RUNS
from uqpen.models import MODELS
from uqpen.models.source import source_sha256
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import named_code
from uqpen.verification.check_result import CheckOutcome, CheckResult

__all__ = [
    "VERSION_ATTRIBUTES",
    "check_sources",
    "different_programs",
    "environment_differences",
    "has_other_version",
    "model_attributes",
]

# Attributes that distinguish versions of a model.
_SOURCE = "model_source_sha256"
_PROGRAM = "model_program_sha256"
VERSION_ATTRIBUTES = ("model_version", _SOURCE, _PROGRAM)


def environment_differences(tree: xr.DataTree) -> list[str]:
    """List differences from this installation that may change the last bits of results.

    They are versions, the processor, and the sources of models; also of runs that were taken from
    earlier archives.
    """
    # Versions that only Python functions depend on do not matter where there is no function.
    has_user_defined_code = bool(named_code(tree).code)
    here = {**provenance(), **of_python_functions()}
    then = {str(name): value for name, value in tree.attrs.items()}
    then |= {} if has_user_defined_code else of_python_functions()
    versions = [
        f"{name} {archived} (here {found})"
        for name, archived, found in provenance_differences(then, here)
    ]
    reused = str(tree.attrs.get(REUSED_RUNS, "")).split("\n")
    return [*versions, *filter(None, reused), *dict.fromkeys(_different_sources(tree))]


def has_other_version(tree: xr.DataTree) -> bool:
    """Return whether another version of uqpen wrote an archive."""
    version = "version_uqpen"
    return bool(tree.attrs.get(version) != provenance()[version])


def _different_sources(tree: xr.DataTree) -> Iterator[str]:
    """Yield the built-in models whose source differs from the installed one."""
    for model in model_trees(tree).values():
        name, archived_hash = (str(model.attrs.get(key, "")) for key in ("model_name", _SOURCE))
        if name in MODELS and archived_hash:
            here = source_sha256(MODELS[name].partition(":")[0])
            if here != archived_hash:
                yield f"source of {name} {archived_hash[:8]} (here {here[:8]})"


def different_programs(study: ValidatedStudy, tree: xr.DataTree) -> Iterator[str]:
    """Yield the external programs of the same name that differ from those on this machine."""
    for name, model_tree in model_trees(tree).items():
        model, archived_hash = study.models[name].model, str(model_tree.attrs.get(_PROGRAM, ""))
        here = model.identity().get(_PROGRAM.removeprefix("model_"), "")
        if here != archived_hash:
            yield f"{model.name} {archived_hash[:8]} (here {here[:8]})"


def check_sources(study: ValidatedStudy, tree: xr.DataTree) -> Iterator[CheckResult]:
    """Check that the source of user-defined models is unchanged, where it was not archived."""
    details = []
    for name, model_tree in model_trees(tree).items():
        model, made_with = study.models[name].model, model_tree.attrs.get(_SOURCE)
        if FILES in tree.children and not model.is_object:
            continue  # the archived files are what it was made with
        here = model.identity().get(_SOURCE.removeprefix("model_"))
        if model.name not in MODELS and made_with and here != made_with:
            found = f"found the SHA-256 {here}, expected {made_with}"
            details.append(f"{model.name} and what it imports: {found}")
    if details:
        message = "not the source of the models that it was made with"
        yield CheckResult("source", CheckOutcome.DIFFERENT, message, tuple(details))


def model_attributes(tree: xr.DataTree) -> list[str]:
    """Return the attributes that describe the models; some are known only of a loaded model."""
    found = [name for model in model_trees(tree).values() for name in map(str, model.attrs)]
    return [name for name in found if name.startswith("model_")]
