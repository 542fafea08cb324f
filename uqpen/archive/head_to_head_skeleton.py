"""What an archive of methods head to head must hold to be read as one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.labels import (
    BOUND,
    BUDGET,
    ENTRIES,
    ERRORS,
    ESTIMATES,
    METHOD,
    METHODS,
    MOMENTS,
    QUANTILES,
    REFERENCE,
    REPEAT,
    REPLICATED,
    SINGLE,
    SLOPES,
    VARIANT,
    VERDICTS,
)

__all__ = ["faults_of_contest"]

# The variables of a method, and what those of a statistic are along in each group, before its own
# entries and a bound. What ends a name there tells its variables apart.
_OF_METHODS = {
    "runs": (METHOD, BUDGET),
    "replicates": (METHOD, BUDGET),
    "source": (METHOD,),
    "contests": (METHOD,),
}
_OF_STATISTICS: dict[str, dict[str, tuple[str, ...]]] = {
    ESTIMATES: {"": (METHOD, BUDGET, REPEAT)},
    ERRORS: {"": (METHOD, BUDGET), "_coverage": (METHOD, BUDGET), "_scale": ()},
    SLOPES: {"": (METHOD,)},
    VERDICTS: {
        f"_{what}": (VARIANT, BUDGET)
        for what in ("winner", "runner_up", "level", "verdict", "note", "lead")
    },
}
_BOUNDED = {(ERRORS, ""), (SLOPES, ""), (VERDICTS, "_lead")}


def faults_of_contest(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with such an archive, for one line each."""
    yield from _faults_of_methods(tree)
    for group in (MOMENTS, QUANTILES):
        if REFERENCE not in tree.children or group not in tree.children[REFERENCE].children:
            yield f"/{REFERENCE}: no {group}"
    outputs = tree.children[ESTIMATES].children if ESTIMATES in tree.children else {}
    if not outputs:
        yield f"no {ESTIMATES}"
    for output, estimates in outputs.items():
        if not estimates.data_vars:
            yield f"/{ESTIMATES}/{output}: no statistic"
        for statistic in estimates.data_vars:
            yield from _faults_of_statistic(tree, str(output), str(statistic))


def _faults_of_methods(tree: xr.DataTree) -> Iterator[str]:
    if METHODS not in tree.children:
        yield f"no {METHODS}"
        return
    methods = tree.children[METHODS].dataset
    for name in ("repeats", "reference_runs"):
        if not isinstance(methods.attrs.get(name), int | np.integer):
            yield f"/{METHODS}: no number of {name.replace('_', ' ')}"
    for name, dimensions in _OF_METHODS.items():
        if name not in methods or methods[name].dims != dimensions:
            yield f"/{METHODS}: no {name} along {', '.join(dimensions)}"


def _faults_of_statistic(tree: xr.DataTree, output: str, statistic: str) -> Iterator[str]:
    entries = (ENTRIES[statistic],) if statistic in ENTRIES else ()
    for group, variables in _OF_STATISTICS.items():
        outputs = tree.children[group].children if group in tree.children else {}
        held = outputs[output].dataset if output in outputs else xr.Dataset()
        for suffix, dimensions in variables.items():
            bound = (BOUND,) if (group, suffix) in _BOUNDED else ()
            along = (*dimensions, *entries, *bound)
            name = f"{statistic}{suffix}"
            if name not in held or held[name].dims != along:
                yield f"/{group}/{output}: no {name} along {', '.join(along) or 'nothing'}"
            elif not set(along) <= set(held.coords):
                yield f"/{group}/{output}: no coordinates of {name}"
        if VARIANT in held.coords and list(held[VARIANT].values) != [SINGLE, REPLICATED]:
            yield f"/{group}/{output}: no {VARIANT} that is known"
