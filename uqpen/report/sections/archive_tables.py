"""Tables of inputs, designs, models and versions of an archive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from uqpen.archive.provenance import SCHEMA_ATTRIBUTE
from uqpen.archive.read import read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.dependency import Dependency
from uqpen.core.errors import StudyError
from uqpen.core.labels import CONTENT, DEPENDENCIES, REPLICATE, ROLE, RUN, RUNS, SURROGATES
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import replicate_count, run_count, status_counts
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, number_text, range_text
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import plain_text, title_with_unit
from uqpen.study.document import parse_document

__all__ = ["designs_table", "inputs_table", "model_table", "provenance_table"]

# Purposes of designs, by their sampling.
_PURPOSES = {
    Sampling.INDEPENDENT: "a sample of the inputs",
    Sampling.STRATIFIED: "a sample of the inputs, spread evenly",
    Sampling.GIVEN: "points of the user's own, presumed to be a sample of the inputs",
    Sampling.PICK_FREEZE: "Sobol' indices; two of its matrices are a sample of the inputs",
    Sampling.QUADRATURE: "weighted sums for mean and standard deviation; no sample",
    Sampling.TRAJECTORIES: "a screening of the inputs by elementary effects; no sample",
    Sampling.ONE_AT_A_TIME: "responses at the nominal point; no sample",
    Sampling.TOWARDS_EVENT: "the probability of a rare event; no sample",
}

# Attributes of the root that are shown, and their labels; others are shown after them.
_NAMES = {
    "study_name": "study",
    "title": "title",
    "seed": "seed",
    "study_sha256": "SHA-256 of the study's text",
    "platform": "platform",
    "cpu_features": "processor features used by NumPy",
    "blas": "BLAS kernel",
    "blas_threads": "BLAS threads",
    "numba_target": "processor that Numba compiles for",
    SCHEMA_ATTRIBUTE: "schema of the archive",
}
# Characters of an attribute that are shown: a hash fits, and the table stays within the screen.
_LONGEST_VALUE = 72
_SHOWN_ELSEWHERE = ("study_text", CONTENT, "Conventions", DEPENDENCIES)


def inputs_table(view: ArchiveView) -> OutputTable:
    """Each input: its value, or the draws of the leading design; and its text in the study."""
    design = view.leading_design or next(iter([*view.sample_designs, *view.designs]))
    runs = read_group(view.tree, RUNS, design).isel({RUN: slice(RUNS_IN_MEMORY)})
    written = _inputs_as_written(view)
    source = f"{view.design(design).shown_prefix or 'the runs of '}{design}"
    table = OutputTable(
        f"Inputs, over {source}, failed ones included",
        ["meaning", "value or median", "from … to", "in the study"],
    )
    for key in runs.data_vars:
        name, values = str(key), runs.variables[key]
        if values.attrs.get(ROLE) == "input":
            shown = view.scale(name).from_si(np.asarray(values.values, dtype=np.float64))
            title = plain_text(str(values.attrs.get("long_name", name)))
            text = written.get(name, NOTHING)
            label = title_with_unit(name, view.unit(name))
            table.rows.append((label, [title, *_spread(shown), text]))
    return table


def _spread(values: FloatArray) -> list[str]:
    """The value of a constant; median and range of a variable."""
    if not values.ndim or not values.size:
        return [number_text(float(values), 6) if values.size else NOTHING, NOTHING]
    return [
        number_text(float(np.median(values))),
        range_text(number_text(values.min()), number_text(values.max())),
    ]


def _inputs_as_written(view: ArchiveView) -> dict[str, str]:
    """Return the study's entry for each input, as near to its original text as TOML allows."""
    try:
        content = parse_document(str(view.archive.attrs["study_text"]), "study").content
    except StudyError:
        return {}
    models = _table(content, "models")
    model = _table(models, view.model) if view.model else _table(content, "model")
    inputs = _table(content, "inputs") | _table(model, "with")
    return {str(name): plain_text(_toml_text(value), 100) for name, value in inputs.items()}


def _table(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A table of a study; an empty one where there is none."""
    found = content.get(name)
    return found if isinstance(found, dict) else {}


def _toml_text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_nested(entry)}" for key, entry in value.items())
    if isinstance(value, list):
        return f"[{', '.join(map(_nested, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _nested(value: Any) -> str:
    return f"({_toml_text(value)})" if isinstance(value, dict) else _toml_text(value)


def designs_table(view: ArchiveView) -> OutputTable:
    """Each design: its sampling, its number of runs, and its purpose."""
    table = OutputTable("Designs", ["points", "runs", "completed", "replicates", "purpose"])
    for name in view.designs:
        runs = read_group(view.tree, RUNS, name)
        sampling = view.design(name).sampling
        completed = grouped_number(status_counts(runs)[Status.OK])
        purpose = "; ".join((_PURPOSES[sampling], *_surrogate_uses(view, name)))
        replicates = str(replicate_count(runs)) if REPLICATE in runs.variables else NOTHING
        cells = [str(sampling), grouped_number(run_count(runs)), completed, replicates, purpose]
        table.rows.append((name, cells))
    return table


def _surrogate_uses(view: ArchiveView, design: str) -> Iterator[str]:
    surrogates = view.tree.children.get(SURROGATES)
    for name, surrogate in (surrogates.children if surrogates is not None else {}).items():
        if surrogate.attrs.get("design") == design:
            yield f"trains {name}"
        if surrogate.attrs.get("check") == design:
            yield f"checks {name}"


def model_table(view: ArchiveView) -> OutputTable:
    """Return a table of a model: its name, version, source, settings."""
    table = OutputTable("Model", ["value"])
    _add(table, _model_attributes(view.tree.attrs))
    return table


def _model_attributes(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    found = {
        _attribute_name(name): value
        for name, value in attributes.items()
        if str(name).startswith("model_")
    }
    lines = str(attributes.get(DEPENDENCIES, "")).splitlines()
    named = (Dependency.from_line(line) for line in lines)
    if labels := [each.label for each in named if each.sha256]:
        found["its runs depend on"] = ", ".join(labels)
    return found


def provenance_table(view: ArchiveView) -> OutputTable:
    """Return a table of the provenance: study, seed, model, versions, platform."""
    table = OutputTable("Provenance", ["value"])
    attributes = view.archive.attrs
    known = {text: attributes[name] for name, text in _NAMES.items() if name in attributes}
    _add(table, known | _model_attributes(attributes))
    others = {
        _attribute_name(name): value
        for name, value in attributes.items()
        if name not in (*_NAMES, *_SHOWN_ELSEWHERE) and not str(name).startswith("model_")
    }
    _add(table, others)
    return table


def _attribute_name(name: Any) -> str:
    text = str(name)
    if text.startswith("version_"):
        return f"version of {plain_text(text.removeprefix('version_'))}"
    words = plain_text(text.replace("_", " "))
    return words.replace("sha256", "SHA-256")


def _add(table: OutputTable, entries: Mapping[str, Any]) -> None:
    table.rows += [
        (name, [plain_text(str(value), _LONGEST_VALUE)]) for name, value in entries.items()
    ]
