"""Structure that an archive must have to be read as one, even if it is damaged or edited.

Hashes show no such fault, since whoever edits an archive can hash anew. A group is checked by its
declaration in `GROUPS`; then what one group says of another is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.estimates import correction_names, has_interval_texts, statistic_names
from uqpen.archive.fields import field_dimensions
from uqpen.archive.groups import (
    DESIGN_GROUPS,
    GROUPS,
    group_names,
    innermost_groups,
    is_benchmark,
    model_trees,
    read_group,
)
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.blocks import block_ranges, is_true_by_blocks
from uqpen.core.catalogue import (
    BENCHMARK_STATISTICS,
    CATALOGUE,
    COMPARISON_DIMENSIONS,
    COMPARISON_STATISTICS,
    DIMENSIONS,
    METHOD_STATISTICS,
    REQUESTED_DIMENSIONS,
    comparison_statistics,
    method_statistics,
)
from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    ABSENT,
    AXIS_SCALE,
    BOUND,
    BOUNDS,
    BUDGET,
    CAVEAT,
    CITED,
    COMPARISON_GROUP,
    CONDITIONAL,
    CONFIDENCE_LEVEL,
    CONTRADICTED_DISTRIBUTIONS,
    CONTRADICTION,
    DECISION,
    DECISION_CLAIM,
    DECISION_LOWER,
    DECISION_PROBABILITY,
    DECISION_RUNS,
    DECISION_UPPER,
    DERIVED_FROM,
    DERIVED_INPUT,
    FAILED_RUN,
    FAILURE_REASON,
    FAILURES_GROUP,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    KIND,
    LARGEST_CONTRIBUTION,
    MAGNITUDES,
    MATRIX,
    MISSING,
    MODELS,
    NOT_FITTED,
    NOTE,
    POINT,
    PROBABILITY,
    RECIPE,
    REFERENCE,
    REFUTED,
    REPEAT,
    REPLICATED,
    REPLICATES_OF_BUDGET,
    ROLE,
    ROUND,
    RUN,
    RUNS,
    RUNS_ABSENT,
    RUNS_OF_BUDGET,
    RUNS_SPENT,
    SAMPLING,
    SINGLE,
    SOURCE,
    SOURCE_KIND,
    STATISTICS_GROUP,
    STATUS,
    STOPPING_CLAIM,
    STOPPING_STATISTICS,
    SURROGATES,
    TRAJECTORY,
    VARIANT,
    VARIANTS,
    WEIGHT,
)
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import EntryDimension, Statistic
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.core.variables import MOST_DIMENSIONS

_ROOT = ("title", "study_text", "study_sha256", "seed")
# Python reads no number of more digits from a text.
_SEED = re.compile(r"[0-9]{1,4300}\Z")

# What an attribute of some name is, wherever it stands.
_ATTRIBUTES = {
    **dict.fromkeys(
        (
            *(INTERVAL, INTERVAL_LABEL, NOTE, ROLE, CONDITIONAL, MISSING, "units", "display_units"),
            *(
                ABSENT,
                CONTRADICTED_DISTRIBUTIONS,
                CONTRADICTION,
                DERIVED_FROM,
                "source",
                "minus",
                "outputs",
                "check",
            ),
            *(AXIS_SCALE, CAVEAT, SOURCE_KIND, CITED, MAGNITUDES, LARGEST_CONTRIBUTION),
            *(NOT_FITTED, REFUTED),
            *("flag_meanings", DECISION, DECISION_CLAIM, STOPPING_CLAIM, STOPPING_STATISTICS),
        ),
        "text",
    ),
    **dict.fromkeys((RECIPE, RUNS_SPENT, RUNS_ABSENT, DECISION_RUNS), "count"),
    **dict.fromkeys(("runs", "runs_used"), "count"),
    **dict.fromkeys(("order", "terms", "q2", "check_q2_of_output", CONFIDENCE_LEVEL), "number"),
    **dict.fromkeys((DECISION_PROBABILITY, DECISION_LOWER, DECISION_UPPER), "number"),
}
_KINDS = {"text": "OUS", "count": "iu", "number": "iuf"}

# Statistics of the inputs of failed runs, which tables show together.
_ASSOCIATIONS = ("larger", "further_out")
# A surrogate that no independent runs check says so by this.
_NO_CHECK = "none"


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
    yield from _declared_faults(tree, is_of_model=False)
    yield from _estimate_faults(tree)
    yield from find_level_faults(tree)


def _study_faults(tree: xr.DataTree) -> Iterator[str]:
    models = model_trees(tree)
    if not models:
        yield "no models"
    for name, model in models.items():
        root = f"/{MODELS}/{name}" if name else ""
        head = f"{root}: " if root else ""
        if not isinstance(model.attrs.get("model_name"), str):
            yield f"{head}no name of the model"
        if not group_names(model, RUNS):
            yield f"{head}no runs"
        for fault in chain(_declared_faults(model, is_of_model=True), find_model_faults(model)):
            yield f"{root if fault.startswith('/') else head}{fault}"


def _declared_faults(tree: xr.DataTree, *, is_of_model: bool) -> Iterator[str]:
    """Yield the faults of the groups of a model, or of those of the archive, by their records."""
    for name, group in GROUPS.items():
        if group.is_of_model != is_of_model or name not in tree.children:
            continue
        node = tree.children[name]
        for path, child in innermost_groups(node, len(group.levels)) if group.statistics else ():
            dataset = child.to_dataset(inherit=False)
            for fault in find_dataset_faults(dataset, group.statistics):
                yield f"/{name}{path}: {fault}"
        if group.check:
            yield from (f"/{name}{fault}" for fault in resolve(group.check)(node))


# Attributes, levels and intervals, wherever they stand


def find_attribute_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the faults of attributes whose type is not the one that their name implies."""
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        path = node.path
        owners: dict[str, Mapping[Any, Any]] = {path: dataset.attrs}
        owners |= {f"{path}/{key}": v.attrs for key, v in dataset.variables.items()}
        for place, attributes in owners.items():
            for name, value in attributes.items():
                kind = _ATTRIBUTES.get(str(name))
                if kind and not (np.ndim(value) == 0 and has_kind(value, kind)):
                    yield f"{place}: {name} is no {kind}"
            try:
                scale(str(attributes.get("display_units", "1")))
            except QuantityError:
                yield f"{place}: display_units that are no unit"


def has_kind(values: npt.ArrayLike, kind: str) -> bool:
    """Return True if values are of a kind: texts, counts or numbers."""
    known = getattr(values, "dtype", None)  # without reading them, where they are in a file
    return (np.asarray(values).dtype if known is None else known).kind in _KINDS[kind]


def find_level_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the intervals whose level is no probability, a line each."""
    for node in tree.subtree:
        for name, variable in node.to_dataset(inherit=False).variables.items():
            level = variable.attrs.get(INTERVAL_LEVEL)
            if level is None:
                continue
            if np.ndim(level) or not has_kind(level, "number") or not 0 < level < 1:
                yield f"{node.path}/{name}: {INTERVAL_LEVEL} is no probability"


def _estimate_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield a fault for each estimate that does not say how its interval was made."""
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        for name in dataset.data_vars:
            if BOUND in dataset.variables[name].dims and not has_interval_texts(dataset, str(name)):
                yield f"{node.path}/{name}: does not say how its interval was made"


# Statistics of a group


def find_dataset_faults(
    dataset: xr.Dataset,
    catalogue: Mapping[str, Statistic],
    dimensions: Mapping[str, EntryDimension] = DIMENSIONS,
) -> Iterator[str]:
    """Yield the faults of the statistics of one group.

    A statistic that is not in the catalogue may have any dimensions. A statistic that the group
    lacks is no fault. The entries of statistics lie along `dimensions`, those of fields along any
    others.
    """
    for name in statistic_names(dataset):
        variable = dataset.variables[name]
        entry = catalogue.get(name)
        dims = tuple(str(dim) for dim in variable.dims)
        if entry is not None:
            expected = (*entry.dims, *((BOUND,) if entry.has_bounds else ()))
            of_field = dims[: len(dims) - len(expected)]
            of_statistic = dims[len(of_field) :]
            if (
                of_statistic != expected
                or not dimensions.keys().isdisjoint(of_field)
                or not has_kind(variable, entry.kind)
            ):
                yield f"{name} is not of {entry.kind}s along {', '.join(expected)}"
                continue
        if BOUND in dims:
            yield from _interval_faults(dataset, name)
        for dimension in dims:
            yield from _coordinate_faults(dataset, dimension, dimensions)
    yield from _field_faults(dataset, catalogue, dimensions)


def _field_faults(
    dataset: xr.Dataset,
    catalogue: Mapping[str, Statistic],
    dimensions: Mapping[str, EntryDimension],
) -> Iterator[str]:
    """Find dimensions of a field that have no coordinates with a unit."""
    known = {
        str(dim)
        for name in dataset.data_vars
        if name in catalogue
        for dim in dataset.variables[name].dims
    }
    for dimension in sorted(known.difference(dimensions, (BOUND,))):
        if dimension not in dataset.coords or "units" not in dataset.variables[dimension].attrs:
            yield f"no coordinates with a unit along {dimension}"


def _interval_faults(dataset: xr.Dataset, name: str) -> Iterator[str]:
    """Find what is wrong with the bounds of a statistic, and with the texts on them."""
    variable = dataset.variables[name]
    # Not dataset[BOUND]: building a DataArray takes most of the time of these checks.
    if BOUND not in dataset.coords or dataset.variables[BOUND].values.tolist() != list(BOUNDS):
        yield f"{name}: not the bounds of an estimate"
    elif not has_interval_texts(dataset, name):
        yield f"{name}: does not say how its interval was made"
    elif variable.dims[-1] != BOUND or not has_kind(variable, "number"):
        yield f"{name}: not the bounds of an estimate"
    for beside in correction_names(name):
        found = dataset.variables.get(beside)
        if found is None:
            continue
        if found.dims != variable.dims[:-1] or not has_kind(found, "number"):
            yield f"{beside} is not of a number for each entry of {name}"


def _coordinate_faults(
    dataset: xr.Dataset, dimension: str, dimensions: Mapping[str, EntryDimension]
) -> Iterator[str]:
    """Find what is wrong with the coordinates along a dimension of the catalogue."""
    described = dimensions.get(dimension)
    if described is None:
        return
    is_there = dimension in dataset.coords
    if not is_there or not has_kind(dataset.variables[dimension], described.kind):
        yield f"no {dimension} to tell its entries apart"
        return
    for name, kind in {**described.companions, **described.optional}.items():
        beside = dataset.variables.get(name)
        if beside is None:
            is_wrong = name in described.companions
        else:
            is_wrong = beside.dims != (dimension,) or not has_kind(beside, kind)
        if is_wrong:
            yield f"no {name} for each entry"


# What the records of groups do not show


def find_run_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of the runs of all designs."""
    for name, runs in node.children.items():
        yield from (f"/{name}: {fault}" for fault in _run_faults(runs.dataset))


def _run_faults(runs: xr.Dataset) -> Iterator[str]:
    yield from find_field_faults(runs)
    status, numbers = runs.variables.get(STATUS), runs.variables.get(RUN)
    if status is None or status.dims != (RUN,):
        yield f"no {STATUS} along {RUN}"
    elif not is_true_by_blocks(lambda found: np.isin(found, list(Status)).all(), status):
        yield f"a {STATUS} that is none"
    if str(runs.attrs.get(SAMPLING)) not in list(Sampling):
        yield f"no {SAMPLING} that is known"
    if numbers is None or RUN not in runs.coords or not has_kind(numbers, "count"):
        yield f"no {RUN} numbers"
    elif not is_true_by_blocks(lambda run: (np.diff(run) > 0).all(), numbers, overlap=1):
        yield f"{RUN} numbers that do not ascend"
    elif REPEAT in runs.coords and not _has_repeats(runs):
        yield f"a {REPEAT} without a {POINT}, or another one than its place among the runs there"
    elif WEIGHT in runs.coords and not _has_weights(runs.variables[WEIGHT]):
        yield f"a {WEIGHT} that is none"
    elif FAILURE_REASON in runs and not _has_failed_run_reasons(runs):
        yield f"reasons without a {FAILED_RUN}"


def find_pair_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of runs that were made twice."""
    for name, pairs in node.children.items():
        dims, variables = (RUN, REPEAT), pairs.dataset.data_vars
        if dict(pairs.sizes).get(REPEAT) != 2 or RUN not in pairs.coords:
            yield f"/{name}: no two runs of each number"
        elif STATUS not in variables or any(each.dims[:2] != dims for each in variables.values()):
            yield f"/{name}: a variable that does not lie along {RUN} and {REPEAT}"


def _has_repeats(runs: xr.Dataset) -> bool:
    """Return True if every run has its point and its number there, and they stand in order."""
    if POINT not in runs.coords:
        return False
    variables = [runs.variables[name] for name in (POINT, REPEAT)]
    if any(each.dims != (RUN,) or not has_kind(each, "count") for each in variables):
        return False

    def are_numbered(point: IntArray, repeat: IntArray) -> bool:
        is_next = (np.diff(point) == 0) & (np.diff(repeat) == 1)
        return bool((is_next | ((np.diff(point) > 0) & (repeat[1:] == 0))).all())

    return is_true_by_blocks(are_numbered, *variables, overlap=1)


def _has_weights(weights: xr.Variable) -> bool:
    """Return True if every run has a weight, and some run counts."""
    if weights.dims != (RUN,) or not has_kind(weights, "number"):
        return False
    is_weight = is_true_by_blocks(lambda each: (np.isfinite(each) & (each >= 0)).all(), weights)
    return is_weight and not is_true_by_blocks(lambda each: (each <= 0).all(), weights)


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


def find_field_faults(runs: xr.Dataset) -> Iterator[str]:
    """Yield the faults of the fields of a design's runs, and of their coordinates."""
    dimensions: set[str] = set()
    for name in runs.data_vars:
        variable = runs.variables[name]
        along = field_dimensions(variable)
        if variable.attrs.get(ROLE) != "output" or not along:
            continue
        dimensions.update(along)
        if variable.dims[0] != RUN or len(along) > MOST_DIMENSIONS:
            yield f"{name} does not lie along {RUN} and its own dimensions"
        elif not has_kind(variable, "number"):
            yield f"{name} is not of numbers"
    for dimension in sorted(dimensions):
        if dimension not in runs.coords or not has_kind(runs[dimension], "number"):
            yield f"no coordinates along {dimension}"
            continue
        values = runs[dimension].values
        if not np.isfinite(values).all() or not (np.diff(values) > 0).all():
            yield f"coordinates along {dimension} that do not ascend"
        elif "units" not in runs[dimension].attrs:
            yield f"no units of {dimension}"


def find_source_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of the sources of statistics: other entries than elsewhere, attributes."""
    yield from _entry_faults(node)
    for name, source in node.children.items():
        needed = {"design": (RUNS_SPENT,), "surrogate": (RUNS_SPENT, "check"), "publication": ()}
        kind = source.attrs.get(SOURCE_KIND)
        if kind not in needed:
            yield f"/{name}: of no kind that is known"
        for key in needed.get(str(kind), ()):
            if key not in source.attrs:
                yield f"/{name}: no {key}"


def _entry_faults(node: xr.DataTree) -> Iterator[str]:
    """Find entries that a study asks for and that are not the same for all sources."""
    entries: dict[tuple[str, str], list[Any]] = {}
    for path, child in innermost_groups(node, 2):
        output, dataset = path.rpartition("/")[2], child.to_dataset(inherit=False)
        for dimension in dataset.dims:
            if dimension in dataset.coords and dimension in REQUESTED_DIMENSIONS:
                found = dataset.variables[dimension].values.tolist()
                if entries.setdefault((output, str(dimension)), found) != found:
                    yield f"{path}: another {dimension} than elsewhere"


def find_difference_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of the differences of models from the first."""
    archive = node.parent
    models = group_names(archive, MODELS) if archive is not None else []
    for name, pair in node.children.items():
        if name not in models:
            yield f"/{name}: of no model"
        yield from (f"/{name}{fault}" for fault in _entry_faults(pair))
        for path, child in innermost_groups(pair, 2):
            if "minus" not in child.attrs:
                yield f"/{name}{path}: does not say of which model"


def find_surrogate_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of surrogates: attributes, and diagnostics of the fit to each output."""
    for surrogate, made in node.children.items():
        for name in ("outputs", "check", "runs_used", RUNS_SPENT):
            if name not in made.attrs:
                yield f"/{surrogate}: no {name}"
        for output in str(made.attrs.get("outputs", "")).split():
            if output not in made.children or not _has_diagnostics(made.children[output]):
                yield f"/{surrogate}: does not say how well it fits {output}"


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


# What one group of a model says of another


def find_model_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the faults in the groups of a model, a line each."""
    designs = {name: read_group(tree, RUNS, name) for name in group_names(tree, RUNS)}
    known = _variable_roles(next(iter(designs.values()), xr.Dataset()))
    inputs = {name for name, is_output in known.items() if not is_output}
    for name, runs in designs.items():
        if _variable_roles(runs) != known:
            yield f"/{RUNS}/{name}: other inputs or outputs than elsewhere"
        failures = read_group(tree, FAILURES_GROUP, name)
        if names := set(statistic_names(failures)) - {PROBABILITY}:
            for missing in (each for each in _ASSOCIATIONS if each not in names):
                yield f"{missing} of failed runs of {name}: not of numbers for each {INPUT}"
        for group in DESIGN_GROUPS:
            for fault in _input_faults(read_group(tree, group, name), inputs):
                yield f"/{group}/{name}: {fault}"
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _variable_faults(runs))
    yield from (f"/{TRAJECTORY}: {fault}" for fault in _trajectory_faults(tree, known))
    yield from _fit_faults(tree, known, list(designs))
    yield from _origin_faults(tree, known, inputs)


def _fit_faults(tree: xr.DataTree, known: dict[str, bool], designs: Sequence[str]) -> Iterator[str]:
    """Find surrogates of runs or outputs that the archive does not have."""
    for name in group_names(tree, SURROGATES):
        attributes = tree.children[SURROGATES].children[name].attrs
        if attributes.get("design") not in designs:
            yield f"/{SURROGATES}/{name}: fitted to runs of no design"
        if attributes.get("check") not in (*designs, _NO_CHECK):
            yield f"/{SURROGATES}/{name}: checked by runs of no design"
        for output in str(attributes.get("outputs", "")).split():
            if not known.get(output):
                yield f"/{SURROGATES}/{name}: of {output}, which is no output of the runs"


def _origin_faults(tree: xr.DataTree, known: dict[str, bool], inputs: set[str]) -> Iterator[str]:
    """Find statistics of runs, surrogates, outputs or inputs that the archive does not have."""
    groups = {"design": RUNS, "surrogate": SURROGATES}
    sources = group_names(tree, STATISTICS_GROUP)
    for group in groups.values():
        for name in group_names(tree, group):
            if name not in sources:
                yield f"/{group}/{name}: without a group of statistics"
    for source in sources:
        node = tree.children[STATISTICS_GROUP].children[source]
        place = f"/{STATISTICS_GROUP}/{source}"
        origin = groups.get(str(node.attrs.get(SOURCE_KIND)))
        if origin is not None and source not in group_names(tree, origin):
            yield f"{place}: of what /{origin} does not have"
        for output in node.children:
            if not known.get(str(output)):
                yield f"{place}: of {output}, which is no output of the runs"
            for fault in _input_faults(read_group(node, str(output)), inputs):
                yield f"{place}/{output}: {fault}"


def _input_faults(dataset: xr.Dataset, inputs: set[str]) -> Iterator[str]:
    """Find entries of statistics that are of no input."""
    entries = dataset.coords[INPUT].values.tolist() if INPUT in dataset.coords else []
    for entry in entries if isinstance(entries, list) else [entries]:
        if entry not in inputs:
            yield f"of {entry}, which is no input of the runs"


def _variable_roles(runs: xr.Dataset) -> dict[str, bool]:
    """Return the inputs and outputs, and whether each is an output."""
    roles = {str(name): runs.variables[name].attrs.get(ROLE) for name in runs.data_vars}
    known = ("input", DERIVED_INPUT, "output")
    return {name: role == "output" for name, role in roles.items() if role in known}


def _variable_faults(runs: xr.Dataset) -> Iterator[str]:
    for name, is_output in _variable_roles(runs).items():
        variable = runs.variables[name]
        # The dimensions of fields have been checked by the structure of the archive.
        lies_right = variable.dims[:1] == (RUN,) if is_output else variable.dims in ((), (RUN,))
        if not (lies_right and has_kind(variable, "number")):
            yield f"{name} is not of numbers along {RUN}"
        elif "flag_meanings" in variable.attrs and not _has_flags(variable):
            yield f"{name} does not define its categories"
        elif is_output and not _is_finite(variable, runs.variables[STATUS]):
            yield f"{name} of a completed run is not finite"
    if runs.attrs.get(SAMPLING) == Sampling.PICK_FREEZE and MATRIX not in runs.variables:
        yield f"no {MATRIX} to distinguish its blocks"
    for name in (MATRIX, ROUND):
        if name in runs.variables and runs.variables[name].dims != (RUN,):
            yield f"{name} does not lie along {RUN}"


def _has_flags(variable: xr.Variable) -> bool:
    words = str(variable.attrs["flag_meanings"]).split()
    labels = np.atleast_1d(variable.attrs.get("flag_labels", words))
    return np.size(variable.attrs.get("flag_values", ())) == len(words) == len(labels)


def _is_finite(variable: xr.Variable, status: xr.Variable) -> bool:
    # NaN is the value behind the end of a curve, and of a derived number that a run does not have.
    may_be_nan = variable.ndim == 2 or ABSENT in variable.attrs

    def is_finite(values: FloatArray, statuses: IntArray) -> bool:
        completed = np.asarray(values, dtype=np.float64)[statuses == Status.OK]
        return bool((np.isfinite(completed) | (may_be_nan & np.isnan(completed))).all())

    return is_true_by_blocks(is_finite, variable, status)


def _trajectory_faults(tree: xr.DataTree, known: dict[str, bool]) -> Iterator[str]:
    trajectory = read_group(tree, TRAJECTORY)
    if not trajectory:
        return
    dimensions = [str(name) for name in trajectory.dims]
    if len(dimensions) != 1 or dimensions[0] not in trajectory.coords or dimensions[0] not in known:
        yield "does not lie along an output"
        return
    for name, variable in trajectory.variables.items():
        if variable.dims != (dimensions[0],) or not has_kind(variable.values, "number"):
            yield f"{name} is not of numbers along {dimensions[0]}"
    for name, value in trajectory.attrs.items():
        if str(name).startswith("nominal_") and not (
            np.ndim(value) == 0 and has_kind(value, "number")
        ):
            yield f"{name} is not a number"


# A group by the names on its path.
_Path = tuple[str, ...]

# Labels along dimensions, by the output that has them in common; empty for all outputs.
_Labels = dict[tuple[str, str], list[Any]]


def reference_name(tree: xr.DataTree) -> str:
    """Return the name of the source that errors are measured from."""
    kinds = {
        name: read_group(tree, STATISTICS_GROUP, name).attrs.get(SOURCE_KIND)
        for name in group_names(tree, STATISTICS_GROUP)
    }
    return next((name for name, kind in kinds.items() if kind == REFERENCE), REFERENCE)


def find_comparison_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield a line for each fault of such an archive."""
    reference = reference_name(tree)
    methods = [name for name in group_names(tree, STATISTICS_GROUP) if name != reference]
    if not methods:
        yield f"/{STATISTICS_GROUP}: no method that was given runs"
    for source, texts in {reference: (), **dict.fromkeys(methods, (SOURCE, VARIANTS))}.items():
        attributes = read_group(tree, STATISTICS_GROUP, source).attrs
        if RUNS_SPENT not in attributes or not all(
            isinstance(attributes.get(name), str) for name in texts
        ):
            yield f"/{STATISTICS_GROUP}/{source}: no {', '.join((RUNS_SPENT, *texts))}"
    outputs = group_names(tree, COMPARISON_GROUP)
    if not outputs:
        yield f"no {COMPARISON_GROUP}"
    known: _Labels = {("", VARIANT): [SINGLE, REPLICATED]}
    for output in outputs:
        yield from _output_faults(tree, output, methods, known)
    budgets = known.get(("", BUDGET), [0])
    if budgets[0] < 1 or sorted(set(budgets)) != budgets:
        yield f"/{STATISTICS_GROUP}: numbers of runs that do not ascend from 1"


def _output_faults(
    tree: xr.DataTree, output: str, methods: Sequence[str], known: _Labels
) -> Iterator[str]:
    """Yield the faults of the groups of an output; `known` are the labels of others."""
    truth = (STATISTICS_GROUP, reference_name(tree), output)
    verdicts = (COMPARISON_GROUP, output)
    catalogues: dict[_Path, Mapping[str, Statistic]] = {
        **{(STATISTICS_GROUP, method, output): METHOD_STATISTICS for method in methods},
        truth: CATALOGUE,
        verdicts: COMPARISON_STATISTICS,
    }
    groups = {path: read_group(tree, *path) for path in catalogues}
    for path, dataset in groups.items():
        if not dataset:
            yield f"{_place(path)}: no statistics"
            continue
        for fault in find_dataset_faults(dataset, catalogues[path], COMPARISON_DIMENSIONS):
            yield f"{_place(path)}: {fault}"
        for dimension in filter(dataset.indexes.__contains__, COMPARISON_DIMENSIONS):
            # An output has quantiles and thresholds of its own.
            of = "" if dimension in (VARIANT, BUDGET, REPEAT) else output
            found = dataset[dimension].values.tolist()
            if known.setdefault((of, dimension), found) != found:
                yield f"{_place(path)}: another {dimension} than elsewhere"
        if catalogues[path] is METHOD_STATISTICS and not _has_run_counts(dataset):
            beside = f"{RUNS_OF_BUDGET} and {REPLICATES_OF_BUDGET}"
            yield f"{_place(path)}: no {beside} along {BUDGET}"
    if not {"units", "display_units"} <= groups[verdicts].attrs.keys():
        yield f"{_place(verdicts)}: no units of the output"
    yield from _missing_statistics(groups, truth, verdicts)


def _has_run_counts(dataset: xr.Dataset) -> bool:
    """Return whether runs and replicates stand beside the budgets, and no runs lack replicates."""
    if not {RUNS_OF_BUDGET, REPLICATES_OF_BUDGET} <= dataset.coords.keys():
        return False
    runs, replicates = dataset[RUNS_OF_BUDGET], dataset[REPLICATES_OF_BUDGET]
    return bool(np.all((runs.values <= 0) | (replicates.values >= 1)))


def _missing_statistics(
    groups: Mapping[_Path, xr.Dataset], truth: _Path, verdicts: _Path
) -> Iterator[str]:
    """Find what the groups of an output lack of the statistics that methods are compared by."""
    is_compared = False
    for statistic in BENCHMARK_STATISTICS:
        needed = {path: [each.name for each in method_statistics(statistic)] for path in groups}
        needed[truth] = [statistic.name]
        needed[verdicts] = [each.name for each in comparison_statistics(statistic)]
        missing = {
            path: [n for n in names if n not in groups[path]] for path, names in needed.items()
        }
        # The reference has statistics besides.
        if all(missing[path] == needed[path] for path in groups if path != truth):
            continue
        is_compared = True
        for path, names in missing.items():
            yield from (f"{_place(path)}: no {name}" for name in names)
        if not missing[truth]:
            used = groups[truth][statistic.name].attrs.get("runs_used", "")
            if not has_kind(used, "count"):
                yield f"{_place(truth)}: no runs_used of {statistic.name}"
    if not is_compared:
        yield f"{_place(verdicts)}: no statistic that methods are compared by"


def _place(path: _Path) -> str:
    return f"/{'/'.join(path)}"
