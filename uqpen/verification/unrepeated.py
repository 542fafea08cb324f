"""Parts of an archive that are not repeated: left out, and named.

Without trust, nothing is executed that an archive names; no archive contains a Python object; runs
may not have been kept; and another uqpen may have made surrogates or intervals in another way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, interval_codes_name, statistic_names
from uqpen.archive.groups import GROUPS, group_place
from uqpen.archive.read import model_trees
from uqpen.core.catalogue import (
    CATALOGUE,
    DIMENSIONS,
    INTERVAL_RECIPE,
)
from uqpen.core.labels import (
    BOUND,
    INTERVAL_LEVEL,
    RECIPE,
    SOURCE_KIND,
    STATISTICS_GROUP,
    SURROGATE_RECIPE,
    SURROGATES,
    TRAJECTORY,
)
from uqpen.execution.omitted_runs import are_omitted
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.surrogate import UnloadedSurrogate
from uqpen.verification.archived_study import Runs, archived_runs, named_code
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.workflow import surrogate_source

ADVICE = "if you trust its author, use --trust"

_RERUN = "uqpen rerun makes the runs and their statistics again, and uqpen diff compares these"

_STATISTICS = {name: each for group in GROUPS.values() for name, each in group.statistics.items()}

_BUILT_IN_COORDINATES = {
    BOUND,
    *DIMENSIONS,
    *(name for dimension in DIMENSIONS.values() for name in dimension.companions),
}

# What is left of a study and its archive, and a result for what is not.
_Left = tuple[ValidatedStudy, xr.DataTree, CheckResult | None]


def leave_out(
    study: ValidatedStudy, tree: xr.DataTree, *, trust: bool
) -> tuple[ValidatedStudy, xr.DataTree, list[CheckResult]]:
    """Leave out of a study and its archive what is not repeated, with a result for each reason.

    The study that is left has no designs where no statistics are repeated. With `trust`, code that
    the archive names is executed.
    """
    results = []
    for leave in (_omitted, _unloaded, _absent, _earlier, *(() if trust else (_analyses,))):
        if study.designs:
            study, tree, result = leave(study, tree)
            results += [result] if result else []
    # Intervals of another recipe are not compared; their estimates are.
    names, recipe = other_recipe(tree), int(tree.attrs[RECIPE])
    text = ""
    if study.designs and recipe > INTERVAL_RECIPE:
        text = f"made by a later recipe ({recipe}, here {INTERVAL_RECIPE}): not compared"
    elif study.designs and names:
        of = ", ".join(name for name in _STATISTICS if name in names)
        made = f"made by an earlier recipe ({recipe}, here {INTERVAL_RECIPE})"
        text = f"those of {of} are {made}; only the estimates are compared"
    if text:
        results.append(CheckResult("intervals", CheckOutcome.UNCHECKED, text))
    return study, tree, results


def omitted_designs(runs: Runs) -> list[str]:
    """Return the designs whose runs the archive has not kept; they are the same for all models."""
    first = next(iter(runs.values()), {})
    return [design for design, made in first.items() if are_omitted(made)]


def _omitted(study: ValidatedStudy, tree: xr.DataTree) -> _Left:
    """Leave out what follows from runs that are not kept."""
    names = omitted_designs(archived_runs(tree))
    if not names:
        return study, tree, None
    kept = {name: each for name, each in study.designs.items() if name not in names}
    reason = f"those of {', '.join(names)}, as the archive has not kept the runs"
    result = _unchecked("statistics", reason, _RERUN)
    repeated = [name for name, group in GROUPS.items() if group.is_repeated]
    tree = _without(tree, lambda group, of: group in repeated and of in names)
    return replace(study, designs=kept), tree, result


def _unloaded(study: ValidatedStudy, tree: xr.DataTree) -> _Left:
    """Leave out surrogates and the trajectory where distributions or models are not loaded."""
    unloaded = dict.fromkeys([*study.joint.unloaded.values(), *study.unloaded_models])
    if not unloaded:
        return study, tree, None
    fitted = [source.name for source in _sources(tree, "surrogate")]

    def is_left_out(group: str, of: str) -> bool:
        return group in (SURROGATES, TRAJECTORY) or (group == STATISTICS_GROUP and of in fitted)

    kept = _without(tree, is_left_out)
    kinds = "models" if study.unloaded_models else "distributions"
    reason = f"they follow from {kinds} that are not loaded ({', '.join(unloaded)})"
    result = _unchecked("surrogates", reason) if kept.groups != tree.groups else None
    return replace(study, surrogates={}), kept, result


def _absent(study: ValidatedStudy, tree: xr.DataTree) -> _Left:
    """Leave out surrogates whose classes are not here."""
    absent = {name: each for name, each in study.surrogates.items() if each.absence}
    reasons = "; ".join(dict.fromkeys(each.absence for each in absent.values()))
    is_code = any(
        isinstance(each, UnloadedSurrogate) and not each.is_object for each in absent.values()
    )
    return _without_surrogates(study, tree, absent, reasons, *(ADVICE,) * is_code)


def _earlier(study: ValidatedStudy, tree: xr.DataTree) -> _Left:
    """Leave out surrogates of another recipe than this uqpen's."""
    names = dict.fromkeys(
        str(source.name)
        for source in _sources(tree, "surrogate")
        if source.attrs.get(SURROGATE_RECIPE) != surrogate_source.RECIPE
    )
    reason = "another uqpen has fitted and corrected them"
    return _without_surrogates(study, tree, names, reason)


def _without_surrogates(
    study: ValidatedStudy, tree: xr.DataTree, names: Collection[str], reason: str, *advice: str
) -> _Left:
    if not names:
        return study, tree, None
    result = _unchecked("surrogates", f"{', '.join(names)}; {reason}", *advice)
    others = {name: each for name, each in study.surrogates.items() if name not in names}
    tree = _without(tree, lambda group, of: group in (SURROGATES, STATISTICS_GROUP) and of in names)
    return replace(study, surrogates=others), tree, result


def _analyses(study: ValidatedStudy, tree: xr.DataTree) -> _Left:
    """Leave out statistics of user-defined analyses, and the coordinates that only they need."""
    named = named_code(tree).analyses
    if not named:
        return study, tree, None
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    statistics: set[str] = set()
    outputs = [each for source in _sources(tree, "design") for each in source.children.values()]
    for node in outputs:
        dataset = groups[node.path]
        added = [name for name in statistic_names(dataset) if name not in CATALOGUE]
        if added:
            kept = dataset.drop_vars([*added, *map(interval_codes_name, added)], errors="ignore")
            used = {dim for name in kept.data_vars for dim in kept[name].dims}
            unneeded = [
                name
                for name, coordinate in kept.coords.items()
                if name not in _BUILT_IN_COORDINATES or not used.issuperset(coordinate.dims)
            ]
            groups[node.path] = kept.drop_vars(unneeded)
            statistics.update(added)
    reason = f"they follow from code that the archive names ({', '.join(named)})"
    result = _unchecked("analyses", f"{', '.join(sorted(statistics)) or 'none'}; {reason}", ADVICE)
    built_in = tuple(each for each in study.analyses if each.is_built_in)
    return replace(study, analyses=built_in), xr.DataTree.from_dict(groups), result


def other_recipe(tree: xr.DataTree) -> frozenset[str]:
    """Return the statistics whose intervals another recipe than this uqpen's has made."""
    recipe = int(tree.attrs[RECIPE])
    if recipe > INTERVAL_RECIPE:
        return frozenset(_STATISTICS)  # what a later one has changed is not known here
    return frozenset(name for name, entry in _STATISTICS.items() if entry.recipe > recipe)


def without_intervals(dataset: xr.Dataset, names: Collection[str]) -> xr.Dataset:
    """Return a group in which some statistics have estimates alone, no bounds and no texts."""
    kept = dataset.drop_vars(map(interval_codes_name, names), errors="ignore")
    for name in names:
        if name in kept.data_vars and BOUND in kept[name].dims:
            array = kept[name].variable.copy()
            # The estimate is the first along the last dimension.
            array.values[..., 1:] = np.nan
            dropped = (*INTERVAL_TEXTS, INTERVAL_LEVEL)
            array.attrs = {key: text for key, text in array.attrs.items() if key not in dropped}
            kept = kept.assign({name: array})
    return kept


def _unchecked(part: str, reason: str, *advice: str) -> CheckResult:
    return CheckResult(part, CheckOutcome.UNCHECKED, f"not checked: {reason}", advice)


def _sources(tree: xr.DataTree, kind: str) -> Iterator[xr.DataTree]:
    """Yield the groups of statistics of all designs, or of all surrogates."""
    for model in model_trees(tree).values():
        for source in model.children.get(STATISTICS_GROUP, xr.DataTree()).children.values():
            if source.attrs.get(SOURCE_KIND) == kind:
                yield source


def _without(tree: xr.DataTree, is_left_out: Callable[[str, str], bool]) -> xr.DataTree:
    """Return a copy of an archive without some groups, and without those that would be empty.

    They are known by the group of a model that they are in, and by their design or surrogate.
    """
    kept = set()
    for leaf in tree.leaves:
        group, names = group_place(leaf.path)
        of = next((names[each] for each in ("design", "source", "surrogate") if each in names), "")
        if not is_left_out(group, of):
            kept |= {leaf.path, *(above.path for above in leaf.parents)}
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    return xr.DataTree.from_dict({path: groups[path] for path in groups if path in kept})
