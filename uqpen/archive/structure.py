"""Structure that an archive must have to be read as one, even if it is damaged or edited."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.comparison import find_comparison_faults
from uqpen.archive.estimates import has_interval_texts
from uqpen.archive.fields import find_field_faults
from uqpen.archive.files import find_file_faults
from uqpen.archive.layout import (
    find_attribute_faults,
    find_dataset_faults,
    find_statistics_faults,
    has_kind,
)
from uqpen.archive.requirements import find_level_faults, find_model_faults
from uqpen.archive.tree import is_benchmark, model_trees
from uqpen.core.blocks import block_ranges, is_true_by_blocks
from uqpen.core.catalogue import FAILURE_STATISTICS, JOINT_STATISTICS, MODEL_FORM_STATISTICS
from uqpen.core.labels import (
    BOUND,
    DIFFERENCES,
    FAILED_RUN,
    FAILURE_REASON,
    FAILURES_GROUP,
    JOINT_GROUP,
    KIND,
    MODEL_FORM,
    MODELS,
    RECIPE,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SOURCE_KIND,
    STATISTICS_GROUP,
    STATUS,
    SURROGATES,
    WEIGHT,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status

__all__ = ["find_faults"]

_ROOT = ("title", "study_text", "study_sha256", "seed")
# Python reads no number of more digits from a text.
_SEED = re.compile(r"[0-9]{1,4300}\Z")


def find_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the faults of an archive, a line each, in the structure on which all readers depend."""
    for name in _ROOT:
        if not isinstance(tree.attrs.get(name), str):
            yield f'no text "{name}" at its root'
    if RECIPE not in tree.attrs:
        yield f"no {RECIPE} at its root"
    if not _SEED.match(str(tree.attrs.get("seed", ""))):
        yield "a seed that is no number"
    yield from find_attribute_faults(tree)
    if KIND not in tree.attrs:
        yield from _study_faults(tree)
    elif is_benchmark(tree):
        yield from find_comparison_faults(tree)
    else:
        yield f'of kind "{tree.attrs[KIND]}", which this uqpen does not know'
    yield from _estimate_faults(tree)
    yield from find_level_faults(tree)
    yield from find_file_faults(tree.children)


def _study_faults(tree: xr.DataTree) -> Iterator[str]:
    models = model_trees(tree)
    if not models:
        yield "no models"
    for name, model in models.items():
        root = f"/{MODELS}/{name}" if name else ""
        for fault in _model_faults(model):
            yield f"{root}{fault}" if fault.startswith("/") or not root else f"{root}: {fault}"
    for name, pair in _children(tree, DIFFERENCES):
        if MODELS not in tree.children or name not in models:
            yield f"/{DIFFERENCES}/{name}: of no model"
        yield from (f"/{DIFFERENCES}/{name}{fault}" for fault in _pair_faults(pair))
    for name, source in _children(tree, MODEL_FORM):
        for output, child in source.children.items():
            dataset = child.to_dataset(inherit=False)
            for fault in find_dataset_faults(dataset, MODEL_FORM_STATISTICS):
                yield f"/{MODEL_FORM}/{name}/{output}: {fault}"


def _pair_faults(tree: xr.DataTree) -> Iterator[str]:
    yield from find_statistics_faults(tree)
    for source, outputs in tree.children.items():
        for output, child in outputs.children.items():
            if "minus" not in child.attrs:
                yield f"/{source}/{output}: does not say of which model"


def _source_faults(node: xr.DataTree) -> Iterator[str]:
    for name, source in node.children.items():
        kind = source.attrs.get(SOURCE_KIND)
        needed = {"design": (RUNS_SPENT,), "surrogate": (RUNS_SPENT, "check"), "publication": ()}
        if kind not in needed:
            yield f"/{STATISTICS_GROUP}/{name}: of no kind that is known"
        else:
            for key in needed[str(kind)]:
                if key not in source.attrs:
                    yield f"/{STATISTICS_GROUP}/{name}: no {key}"


def _model_faults(tree: xr.DataTree) -> Iterator[str]:
    if not isinstance(tree.attrs.get("model_name"), str):
        yield "no name of the model"
    designs = _children(tree, RUNS)
    if not designs:
        yield "no runs"
    for name, runs in designs:
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _run_faults(runs.dataset))
    if STATISTICS_GROUP in tree.children:
        node = tree.children[STATISTICS_GROUP]
        yield from (f"/{STATISTICS_GROUP}{fault}" for fault in find_statistics_faults(node))
        yield from _source_faults(node)
    for name, child in _children(tree, FAILURES_GROUP):
        for fault in find_dataset_faults(child.to_dataset(inherit=False), FAILURE_STATISTICS):
            yield f"/{FAILURES_GROUP}/{name}: {fault}"
    for name, child in _children(tree, JOINT_GROUP):
        for fault in find_dataset_faults(child.to_dataset(inherit=False), JOINT_STATISTICS):
            yield f"/{JOINT_GROUP}/{name}: {fault}"
    for name, surrogate in _children(tree, SURROGATES):
        yield from (f"/{SURROGATES}/{name}: {fault}" for fault in _surrogate_faults(surrogate))
    yield from find_model_faults(tree)


def _children(tree: xr.DataTree, group: str) -> list[tuple[str, xr.DataTree]]:
    return list(tree.children[group].children.items()) if group in tree.children else []


def _surrogate_faults(made: xr.DataTree) -> Iterator[str]:
    for name in ("outputs", "check", "runs_used", RUNS_SPENT):
        if name not in made.attrs:
            yield f"no {name}"
    for output in str(made.attrs.get("outputs", "")).split():
        if output not in made.children or not _has_diagnostics(made.children[output]):
            yield f"does not say how well it fits {output}"


def _has_diagnostics(fit: xr.DataTree) -> bool:
    """Return True if a group has diagnostics of a fit, as attributes or as titled numbers."""
    if "diagnostics" not in fit.children:
        return all(each in fit.attrs for each in ("order", "terms", "q2", "check_q2_of_output"))
    return all(
        not variable.dims
        and has_kind(variable, "number")
        and all(isinstance(variable.attrs.get(key), str) for key in ("units", "long_name"))
        for variable in fit.children["diagnostics"].data_vars.values()
    )


def _estimate_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield a fault for each estimate that does not say how its interval was made."""
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        for name in dataset.data_vars:
            if BOUND in dataset.variables[name].dims and not has_interval_texts(dataset, str(name)):
                yield f"{node.path}/{name}: does not say how its interval was made"


def _run_faults(runs: xr.Dataset) -> Iterator[str]:
    yield from find_field_faults(runs)
    status = runs.variables.get(STATUS)
    if status is None or status.dims != (RUN,):
        yield f"no {STATUS} along {RUN}"
    elif not is_true_by_blocks(lambda found: np.isin(found, list(Status)).all(), status):
        yield f"a {STATUS} that is none"
    if str(runs.attrs.get(SAMPLING)) not in list(Sampling):
        yield f"no {SAMPLING} that is known"
    if RUN not in runs.coords or not has_kind(runs[RUN], "count"):
        yield f"no {RUN} numbers"
    elif not is_true_by_blocks(
        lambda run: (np.diff(run) > 0).all(), runs.variables[RUN], overlap=1
    ):
        yield f"{RUN} numbers that do not ascend"
    elif WEIGHT in runs.coords and not _has_weights(runs[WEIGHT]):
        yield f"a {WEIGHT} that is none"
    elif FAILURE_REASON in runs and not _has_failed_run_reasons(runs):
        yield f"reasons without a {FAILED_RUN}"


def _has_weights(weights: xr.DataArray) -> bool:
    """Return True if every run has a weight, and some run counts."""
    if weights.dims != (RUN,) or not has_kind(weights, "number"):
        return False
    if not is_true_by_blocks(
        lambda each: (np.isfinite(each) & (each >= 0)).all(), weights.variable
    ):
        return False
    return not is_true_by_blocks(lambda each: (each <= 0).all(), weights.variable)


def _has_failed_run_reasons(runs: xr.Dataset) -> bool:
    """Return True if every failure reason belongs to a run."""
    if FAILED_RUN not in runs or runs[FAILURE_REASON].dims != (FAILED_RUN,):
        return False
    failed = np.sort(runs[FAILED_RUN].values)
    known = 0
    for start, stop in block_ranges(runs.sizes[RUN]):
        numbers = runs[RUN][start:stop].values
        if numbers.size:
            first = np.searchsorted(failed, numbers[0])
            last = np.searchsorted(failed, numbers[-1], side="right")
            known += int(np.count_nonzero(np.isin(failed[first:last], numbers)))
    return bool(known == len(failed))
