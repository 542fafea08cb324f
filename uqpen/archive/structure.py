"""What an archive must hold to be read as one, whoever has written or damaged it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.archive.benchmark_structure import find_benchmark_faults
from uqpen.archive.files import find_file_faults
from uqpen.archive.interval_metadata import interval_metadata
from uqpen.archive.layout import find_attribute_faults, find_estimate_faults, has_kind
from uqpen.core.labels import (
    BENCHMARK,
    BOUND,
    BOUNDS,
    CDFS,
    DIFFERENCES,
    FAILED_RUN,
    FAILURE_REASON,
    INTERVAL_LABEL,
    KIND,
    MODELS,
    MOMENTS,
    QUANTILES,
    ROLE,
    RUN,
    RUNS,
    RUNS_SPENT,
    SAMPLING,
    SHARES,
    STATISTICS,
    STATUS,
    STATUSES,
    SURROGATES,
    Sampling,
    Status,
)

__all__ = ["find_faults"]

_SAMPLES = [str(sampling) for sampling in Sampling if sampling.is_sample]

_ROOT = ("title", "study_text", "study_sha256", "seed")
# Python reads no number of more digits from a text.
_SEED = re.compile(r"[0-9]{1,4300}\Z")


def find_faults(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with an archive, for one line each.

    Only what everything that reads archives goes by; that the figures are those of the study is
    another matter.
    """
    for name in _ROOT:
        if not isinstance(tree.attrs.get(name), str):
            yield f'no text "{name}" at its root'
    if not _SEED.match(str(tree.attrs.get("seed", ""))):
        yield "a seed that is no number"
    yield from find_attribute_faults(tree)
    kind = tree.attrs.get(KIND)
    if kind is None:
        yield from _study_faults(tree)
    elif kind == BENCHMARK:
        yield from find_benchmark_faults(tree)
    else:
        yield f'of kind "{kind}", which this uqpen does not know'
    yield from _estimate_faults(tree)
    yield from find_file_faults(tree.children)


def _study_faults(tree: xr.DataTree) -> Iterator[str]:
    models = tree.children[MODELS].children if MODELS in tree.children else {"": tree}
    if not models:
        yield "no models"
    for name, model in models.items():
        root = f"/{MODELS}/{name}" if name else ""
        for fault in _model_faults(model):
            yield f"{root}{fault}" if fault.startswith("/") or not root else f"{root}: {fault}"
    pairs = tree.children[DIFFERENCES].children if DIFFERENCES in tree.children else {}
    for name, pair in pairs.items():
        if MODELS not in tree.children or name not in models:
            yield f"/{DIFFERENCES}/{name}: of no model"
        yield from (f"/{DIFFERENCES}/{name}{fault}" for fault in _pair_faults(pair))


def _pair_faults(tree: xr.DataTree) -> Iterator[str]:
    yield from find_estimate_faults(tree)
    designs = tree.children[MOMENTS].children if MOMENTS in tree.children else {}
    for name, moments in designs.items():
        if "minus" not in moments.attrs:
            yield f"/{MOMENTS}/{name}: does not say of which model"


def _model_faults(tree: xr.DataTree) -> Iterator[str]:
    if not isinstance(tree.attrs.get("model_name"), str):
        yield "no name of the model"
    designs = tree.children[RUNS].children if RUNS in tree.children else {}
    if not designs:
        yield "no runs"
    for name, runs in designs.items():
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _run_faults(runs.dataset))
        if str(runs.attrs.get(SAMPLING)) in _SAMPLES:
            yield from _missing_statistics(tree, str(name), runs.dataset)
    yield from find_estimate_faults(tree)
    surrogates = tree.children[SURROGATES].children if SURROGATES in tree.children else {}
    for name, surrogate in surrogates.items():
        yield from (f"/{SURROGATES}/{name}: {fault}" for fault in _surrogate_faults(surrogate))


def _surrogate_faults(made: xr.DataTree) -> Iterator[str]:
    for name in ("outputs", "check", "runs_used", RUNS_SPENT):
        if name not in made.attrs:
            yield f"no {name}"
    for output in str(made.attrs.get("outputs", "")).split():
        name = f"{output}_coefficient"
        attributes = made.variables[name].attrs if name in made.variables else {}
        if not all(each in attributes for each in ("order", "terms", "q2", "check_q2_of_output")):
            yield f"does not say how well it fits {output}"


def _estimate_faults(tree: xr.DataTree) -> Iterator[str]:
    for node in tree.subtree:
        for variable in node.data_vars.values():
            is_estimate = BOUND in variable.dims
            if is_estimate and variable.sizes[BOUND] != len(BOUNDS):
                yield f"{node.path}/{variable.name}: not the bounds of an estimate"
            if is_estimate and not interval_metadata(variable, INTERVAL_LABEL):
                yield f"{node.path}/{variable.name}: does not say how its interval was made"


def _run_faults(runs: xr.Dataset) -> Iterator[str]:
    if STATUS not in runs or runs[STATUS].dims != (RUN,):
        yield f"no {STATUS} along {RUN}"
    elif not np.isin(runs[STATUS].values, list(Status)).all():
        yield f"a {STATUS} that is none"
    if str(runs.attrs.get(SAMPLING)) not in list(Sampling):
        yield f"no {SAMPLING} that is known"
    if RUN not in runs.coords or not has_kind(runs[RUN], "count"):
        yield f"no {RUN} numbers"
    elif (np.diff(runs[RUN].values) <= 0).any():
        yield f"{RUN} numbers that do not ascend"
    elif FAILURE_REASON in runs and not _has_failed_run_reasons(runs):
        yield f"reasons without a {FAILED_RUN}"


def _has_failed_run_reasons(runs: xr.Dataset) -> bool:
    """Whether every reason is of a run."""
    if FAILED_RUN not in runs or runs[FAILURE_REASON].dims != (FAILED_RUN,):
        return False
    return bool(runs[FAILED_RUN].isin(runs[RUN]).all())


def _missing_statistics(tree: xr.DataTree, design: str, runs: xr.Dataset) -> Iterator[str]:
    """Groups and variables that there is one of for each design, or each output of it."""
    failed = [status.meaning for status in Status if status is not Status.OK]
    yield from _missing_names(tree, STATUSES, design, failed)
    for name, variable in runs.data_vars.items():
        if variable.attrs.get(ROLE) != "output":
            continue
        needed = (
            {SHARES: [f"{name}"]}
            if "flag_meanings" in variable.attrs
            else {
                MOMENTS: [f"{name}_{moment}" for moment in STATISTICS],
                QUANTILES: [f"{name}", f"{name}_probability"],
                CDFS: [f"{name}"],
            }
        )
        for group, names in needed.items():
            yield from _missing_names(tree, group, design, names)


def _missing_names(
    tree: xr.DataTree, group: str, design: str, names: Sequence[str]
) -> Iterator[str]:
    designs = tree.children[group].children if group in tree.children else {}
    present = designs[design].variables if design in designs else {}
    yield from (f"/{group}/{design}: no {name}" for name in names if name not in present)
