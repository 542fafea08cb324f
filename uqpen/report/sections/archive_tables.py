"""Tables of what an archive was made of: inputs, designs, models, versions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.archive.provenance import SCHEMA_ATTRIBUTE
from uqpen.archive.read import group
from uqpen.errors import StudyError
from uqpen.evaluation import status_counts
from uqpen.figures.part import Part
from uqpen.figures.texts import plain, with_unit
from uqpen.labels import CONTENT, REPLICATE, ROLE, RUN, RUNS, SURROGATES, Sampling, Status
from uqpen.report.sections.evidence import leading
from uqpen.study.document import parse_document
from uqpen.summary.digits import grouped
from uqpen.summary.table import NOTHING, OutputTable

__all__ = ["designs_of", "inputs_of", "model_of", "provenance_of"]

# What designs of a kind are made for, where it is more than a sample of the inputs.
_MADE_FOR = {
    Sampling.INDEPENDENT: "a sample of the inputs",
    Sampling.STRATIFIED: "a sample of the inputs, spread evenly",
    Sampling.GIVEN: "points of the user's own, taken for a sample of the inputs",
    Sampling.PICK_FREEZE: "Sobol' indices; two of its matrices are a sample of the inputs",
    Sampling.RULE: "sums with weights for mean and standard deviation; no sample",
    Sampling.TRAJECTORIES: "a screening of the inputs by elementary effects; no sample",
    Sampling.STEPS: "responses at the nominal point; no sample",
}

# Attributes of the root that are shown, and what a person reads; others are shown after them.
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
_ELSEWHERE = ("study_text", CONTENT, "Conventions")


def inputs_of(part: Part) -> OutputTable:
    """Each input: its value, or what the leading design drew; and what the study says of it."""
    design = leading(part) or next(iter([*part.samples, *part.designs]))
    runs = group(part.tree, RUNS, design)
    written = _written_inputs(part)
    table = OutputTable(
        f"Inputs, over the runs of {design}, lost ones among them",
        ["meaning", "value or median", "from … to", "as the study says"],
    )
    for key, values in runs.data_vars.items():
        name = str(key)
        if values.attrs.get(ROLE) == "input":
            shown = part.measure(name).from_si(np.asarray(values.values, dtype=np.float64))
            title = plain(str(values.attrs.get("long_name", name)))
            said = written.get(name, NOTHING)
            label = with_unit(name, part.unit(name))
            table.rows.append((label, [title, *_spread(shown), said]))
    return table


def _spread(values: npt.NDArray[np.float64]) -> list[str]:
    """The value of a constant; median and range of what varies."""
    if not values.ndim or not values.size:
        return [f"{values:.6g}" if values.size else NOTHING, NOTHING]
    return [f"{np.median(values):.4g}", f"{values.min():.4g} … {values.max():.4g}"]


def _written_inputs(part: Part) -> dict[str, str]:
    """What the study says of each input, as near as TOML leaves it to how it was written."""
    try:
        content = parse_document(str(part.archive.attrs["study_text"]), "study").content
    except StudyError:
        return {}
    model = (
        _table(_table(content, "models"), part.model) if part.model else _table(content, "model")
    )
    inputs = _table(content, "inputs") | _table(model, "with")
    return {str(name): plain(_written(value), 100) for name, value in inputs.items()}


def _table(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A table of a study; an empty one where there is none."""
    found = content.get(name)
    return found if isinstance(found, dict) else {}


def _written(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_nested(entry)}" for key, entry in value.items())
    if isinstance(value, list):
        return f"[{', '.join(map(_nested, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _nested(value: Any) -> str:
    return f"({_written(value)})" if isinstance(value, dict) else _written(value)


def designs_of(part: Part) -> OutputTable:
    """Each design: how its points were chosen, how many runs it made, and what it is for."""
    table = OutputTable("Designs", ["points", "runs", "came back", "replicates", "made for"])
    for name in part.designs:
        runs = group(part.tree, RUNS, name)
        sampling = part.sampling(name)
        back = grouped(status_counts(runs)[Status.OK])
        made_for = "; ".join((_MADE_FOR[sampling], *_used_by(part, name)))
        replicates = (
            str(np.unique(runs[REPLICATE]).size) if REPLICATE in runs.variables else NOTHING
        )
        cells = [str(sampling), grouped(runs.sizes[RUN]), back, replicates, made_for]
        table.rows.append((name, cells))
    return table


def _used_by(part: Part, design: str) -> Iterator[str]:
    """The surrogates that a design trains or checks."""
    made = part.tree.children.get(SURROGATES)
    for name, surrogate in (made.children if made is not None else {}).items():
        if surrogate.attrs.get("design") == design:
            yield f"trains {name}"
        if surrogate.attrs.get("check") == design:
            yield f"checks {name}"


def model_of(part: Part) -> OutputTable:
    """What is told of a model: its name, version, source, settings."""
    table = OutputTable("Model", ["value"])
    _add(table, _of_model(part.tree.attrs))
    return table


def _of_model(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    return {
        _called(name): value for name, value in attributes.items() if str(name).startswith("model_")
    }


def provenance_of(part: Part) -> OutputTable:
    """What made the archive: study, seed, model, versions, platform."""
    table = OutputTable("What made this archive", ["value"])
    attributes = part.archive.attrs
    known = {text: attributes[name] for name, text in _NAMES.items() if name in attributes}
    _add(table, known | _of_model(attributes))
    others = {
        _called(name): value
        for name, value in attributes.items()
        if name not in _NAMES and name not in _ELSEWHERE and not str(name).startswith("model_")
    }
    _add(table, others)
    return table


def _called(name: Any) -> str:
    text = str(name)
    if text.startswith("version_"):
        return f"version of {plain(text.removeprefix('version_'))}"
    words = plain(text.replace("_", " "))
    return words.replace("sha256", "SHA-256")


def _add(table: OutputTable, entries: Mapping[str, Any]) -> None:
    table.rows += [(name, [plain(str(value), 120)]) for name, value in entries.items()]
