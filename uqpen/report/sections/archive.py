"""The study as its author wrote it, its inputs and designs, and the provenance of the archive."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.hashes import recorded_hashes
from uqpen.archive.provenance import SCHEMA_ATTRIBUTE
from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.charts.chart import Block
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, FAILURE_STATISTICS, UNLISTED_DIMENSIONS
from uqpen.core.dependency import Dependency
from uqpen.core.errors import StudyError
from uqpen.core.labels import (
    BOUND,
    CONTENT,
    DEPENDENCIES,
    DERIVED_INPUT,
    DIFFERENCES,
    MISSING,
    NOTE,
    RANK,
    REPLICATE,
    REWEIGHTED,
    REWEIGHTED_STUDY,
    ROLE,
    RUN,
    RUNS,
    SURROGATES,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import replicate_count, run_count, status_counts
from uqpen.report.blocks import Heading, Listing, Remarks, Table, Text
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import count_text, grouped_number, number_text, range_text
from uqpen.results.field_tables import field_lines
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import plain_text, title_with_unit
from uqpen.study.document import parse_document
from uqpen.surrogates.diagnostics import unfitted_outputs

# Characters of a text, and files whose texts are shown.
_LONGEST = 20_000
_MOST_FILES = 10

_COMMANDS = """\
# Check the hashes, repeat a sample of the runs, and compute all statistics again:
uqpen verify ARCHIVE
# Repeat the whole study into another archive, and list the differences of the two:
uqpen rerun ARCHIVE -o AGAIN
uqpen diff ARCHIVE AGAIN
"""
# Purposes of designs, by their sampling.
_PURPOSES = {
    Sampling.INDEPENDENT: "a sample of the inputs",
    Sampling.STRATIFIED: "a sample of the inputs, spread evenly",
    Sampling.GIVEN: "points of the user's own, presumed to be a sample of the inputs",
    Sampling.PICK_FREEZE: "Sobol' indices; two of its matrices are a sample of the inputs",
    Sampling.QUADRATURE: "weighted sums for mean and standard deviation; no sample",
    Sampling.TRAJECTORIES: "a screening of the inputs by elementary effects; no sample",
    Sampling.ONE_AT_A_TIME: "responses at the nominal point; no sample",
    Sampling.SEARCH_CURVES: "indices by FAST; no sample",
    Sampling.FINITE_DIFFERENCES: "squared derivatives by the inputs (DGSM); no sample",
    Sampling.TWO_LEVELS: "effects of the inputs between two levels; no sample",
    Sampling.OVER_BOX: "bounds over intervals of parameters, by weights; no sample",
    Sampling.TOWARDS_EVENT: "the probability of a rare event; no sample",
    Sampling.TOWARDS_BOUNDS: "bounds over intervals; no sample",
    Sampling.POSTERIOR: "draws of unknown inputs, moved to their posterior; no sample",
    Sampling.WEIGHTED_POSTERIOR: "draws of posteriors by surrogates, then weighted; no sample",
    Sampling.TOWARDS_MEASUREMENTS: "unknown inputs from measurements; no sample",
    Sampling.AT_EXPERIMENTS: "a sample at measured experiments",
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
_SHOWN_ELSEWHERE = ("study_text", CONTENT, "Conventions", DEPENDENCIES, REWEIGHTED_STUDY)
# Distinct notes that are listed.
_MOST_NOTES = 20

# Diagnostics of other estimates, which have notes of their own.
_DIAGNOSES = [each.name for each in CATALOGUE.values() if each.is_diagnosis]
# Growing parts of the runs repeat the notes of the whole, and so do all percentiles.
_REPEATED = UNLISTED_DIMENSIONS - {RANK}
# Heavy tails are one warning, however heavy.
_NUMBERS = re.compile(r" \(kurtosis [^()]*\)")


def archive(view: ArchiveView) -> Iterator[Block]:
    """The study's text, inputs and designs of each model, and the archive's provenance."""
    is_study = not is_benchmark(view.archive)
    yield from _study_blocks(view)
    for each in view.model_views if is_study else []:
        if each.model:
            yield Heading(each.model)
            yield Table(_value_table("Model", _model_attributes(each.tree.attrs)))
        yield Table(_inputs_table(each))
        table = OutputTable("Designs", ["points", "runs", "completed", "replicates", "purpose"])
        for name in each.designs:
            runs = read_group(each.tree, RUNS, name)
            sampling = each.design(name).sampling
            completed = grouped_number(status_counts(runs)[Status.OK])
            weighted = str(runs.attrs.get(REWEIGHTED, ""))
            purpose = "; ".join((weighted or _PURPOSES[sampling], *_surrogate_uses(each, name)))
            replicates = str(replicate_count(runs)) if REPLICATE in runs.variables else NOTHING
            cells = [str(sampling), grouped_number(run_count(runs)), completed, replicates, purpose]
            table.rows.append((name, cells))
        yield Table(table)
    if fields := tuple(map(plain_text, field_lines(view.archive))):
        yield Remarks("Outputs with dimensions, run by run in the archive", fields)
    if view.model:
        yield Heading("The archive of all models")
    if found := archive_notes(view.archive):
        yield Remarks("Notes in this archive, and the number of estimates with each", found)
    attributes = view.archive.attrs
    known = {text: attributes[name] for name, text in _NAMES.items() if name in attributes}
    others = {
        _attribute_name(name): value
        for name, value in attributes.items()
        if name not in (*_NAMES, *_SHOWN_ELSEWHERE) and not str(name).startswith("model_")
    }
    yield Table(_value_table("Provenance", known | _model_attributes(attributes) | others))
    if is_study:
        yield Text(
            "These commands check the archive of this page, and repeat it. A model or an analysis "
            "of its author's own is executed only with --trust."
        )
        yield Listing("Commands", _COMMANDS)
    if recorded_hashes(view.archive):
        title = "SHA-256 of the content of each of the archive's groups"
        yield _listing(title, str(view.archive.attrs[CONTENT]), is_folded=True)


def _study_blocks(view: ArchiveView) -> Iterator[Block]:
    """The study as its author wrote it, and the files that it names."""
    attributes = view.archive.attrs
    yield _listing(
        f"The study: {plain_text(str(attributes.get('study_name', '')))}",
        str(attributes["study_text"]),
    )
    files = archived_files(read_group(view.archive, FILES))
    if files:
        table = OutputTable("Files that the study names", ["bytes", "content", "SHA-256"])
        for file in files:
            kept = "in the archive" if file.is_whole else "not in the archive"
            cells = [grouped_number(file.size), kept, file.sha256]
            table.rows.append((plain_text(file.name), cells))
        yield Table(table)
    shown = [file for file in files if file.encoding == "utf-8"]
    for file in shown[:_MOST_FILES]:
        yield _listing(plain_text(file.name), file.content, is_folded=True)
    if len(shown) > _MOST_FILES:
        more = len(shown) - _MOST_FILES
        yield Text(f"The archive has the texts of {more} more files, which are not shown here.")


def _listing(title: str, text: str, *, is_folded: bool = False) -> Listing:
    """A text, cut where it is too long for a page."""
    if len(text) > _LONGEST:
        cut = f"the first {grouped_number(_LONGEST)} of {grouped_number(len(text))} characters"
        title = f"{title} ({cut})"
    return Listing(title, text[:_LONGEST], is_folded)


def _inputs_table(view: ArchiveView) -> OutputTable:
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
        if values.attrs.get(ROLE) in ("input", DERIVED_INPUT):
            shown = view.scale(name).from_si(np.asarray(values.values, dtype=np.float64))
            title = plain_text(str(values.attrs.get("long_name", name)))
            text = written.get(name, NOTHING)
            label = title_with_unit(name, view.unit(name))
            texts = view.code_labels(name)
            cells = _labels(values.values, texts) if texts else _spread(shown)
            table.rows.append((label, [title, *cells, text]))
    return table


def _labels(codes: FloatArray, texts: Sequence[str]) -> list[str]:
    """The most frequent label, and each label with its share of the runs."""
    shares = [float(np.mean(codes == place)) for place in range(len(texts))]
    listed = (f"{text} {share:.3g}" for text, share in zip(texts, shares, strict=True) if share)
    return [plain_text(texts[int(np.argmax(shares))]), plain_text(", ".join(listed), 120)]


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
    model = _table(models, view.model) if models else _table(content, "model")
    inputs = _table(content, "inputs") | _table(model, "with") | _table(content, "sweep")
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


def _surrogate_uses(view: ArchiveView, design: str) -> Iterator[str]:
    surrogates = view.tree.children.get(SURROGATES)
    for name, surrogate in (surrogates.children if surrogates is not None else {}).items():
        if surrogate.attrs.get("design") == design:
            yield f"trains {name}"
        if surrogate.attrs.get("check") == design:
            yield f"checks {name}"


def _model_attributes(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Return name, version, source and settings of a model, by their labels."""
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


def _attribute_name(name: Any) -> str:
    text = str(name)
    if text.startswith("version_"):
        return f"version of {plain_text(text.removeprefix('version_'))}"
    words = plain_text(text.replace("_", " "))
    return words.replace("sha256", "SHA-256")


def _value_table(title: str, entries: Mapping[str, Any]) -> OutputTable:
    table = OutputTable(title, ["value"])
    for name, value in entries.items():
        table.rows.append((name, [plain_text(str(value), _LONGEST_VALUE)]))
    return table


def archive_notes(tree: xr.DataTree) -> tuple[str, ...]:
    """The distinct notes of an archive's estimates, the most frequent first, one line each."""
    counts: Counter[str] = Counter()
    for model in model_trees(tree).values():
        counts.update(_estimate_notes(SourceStatistics(model)))
        counts.update(_failure_notes(model))
    for name in group_names(tree, DIFFERENCES):
        counts.update(_estimate_notes(SourceStatistics.of_differences(tree, name)))
    first = counts.most_common(_MOST_NOTES)
    lines = [f"{count_text(count, 'estimate')}: {plain_text(note, 240)}" for note, count in first]
    if more := counts.total() - sum(count for _, count in first):
        lines.append(f"{grouped_number(more)} more estimates have other notes.")
    return (*_model_notes(tree), *lines)


def _estimate_notes(statistics: SourceStatistics) -> Iterator[str]:
    # A published estimate has no interval, and its own note on that.
    sources = [name for name in statistics.sources if not statistics.citation(name)]
    counted = [
        each
        for each in CATALOGUE.values()
        if each.name not in _DIAGNOSES and _REPEATED.isdisjoint(each.dims)
    ]
    for source, output in product(sources, statistics.scalar_outputs):
        arrays = statistics.statistics(source, output)
        for each in counted:
            if each.name in arrays:
                yield from _notes(arrays[each.name], is_whole=each.is_function)


def _failure_notes(model: xr.DataTree) -> Iterator[str]:
    statistics = SourceStatistics(model)
    for statistic, source in product(FAILURE_STATISTICS.values(), statistics.sources):
        if (array := statistics.failures(source).get(statistic.name)) is not None:
            yield from _notes(array)


def _notes(array: xr.DataArray, *, is_whole: bool = False) -> Iterator[str]:
    """Yield the notes of an array's entries, or of the whole once."""
    if BOUND not in array.dims:
        return
    notes = np.ravel(array.coords[NOTE].values).tolist()
    for note in filter(None, notes[: 1 if is_whole else None]):
        yield _NUMBERS.sub("", note)


def _model_notes(tree: xr.DataTree) -> Iterator[str]:
    """Yield missing runs, surrogates that are not fitted, and distributions that do not fit."""
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        statistics = SourceStatistics(model)
        for design in statistics.sources:
            if missing := statistics.run_accounts(design).get(MISSING):
                yield f"{head}{design}: {missing} did not complete."
        for surrogate in group_names(model, SURROGATES):
            group = model.children[SURROGATES].children[surrogate]
            for output, reason in unfitted_outputs(group).items():
                reason_text = plain_text(reason, 240)
                yield f"{head}{surrogate} is not fitted to {output}: {reason_text}."
        rejected = {
            f"{head}{name}: {plain_text(str(variable.attrs['fit_warning']), 240)}.": None
            for design in group_names(model, RUNS)
            for name, variable in read_group(model, RUNS, design).variables.items()
            if "fit_warning" in variable.attrs
        }
        yield from rejected
