"""Intervals that another recipe has made: of these statistics only the estimates are compared."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, interval_codes_name
from uqpen.core.catalogue import (
    CATALOGUE,
    FAILURE_STATISTICS,
    INTERVAL_RECIPE,
    JOINT_STATISTICS,
    MODEL_FORM_STATISTICS,
)
from uqpen.core.labels import BOUND, INTERVAL_LEVEL, RECIPE
from uqpen.verification.check_result import CheckOutcome, CheckResult

__all__ = ["check_recipe", "other_recipe", "without_intervals"]

_STATISTICS = {**CATALOGUE, **FAILURE_STATISTICS, **JOINT_STATISTICS, **MODEL_FORM_STATISTICS}


def other_recipe(tree: xr.DataTree) -> frozenset[str]:
    """Return the statistics whose intervals another recipe than this uqpen's has made."""
    recipe = int(tree.attrs[RECIPE])
    if recipe > INTERVAL_RECIPE:
        return frozenset(_STATISTICS)  # what a later one has changed is not known here
    return frozenset(name for name, entry in _STATISTICS.items() if entry.recipe > recipe)


def check_recipe(tree: xr.DataTree) -> CheckResult | None:
    """Return the result for intervals of another recipe; None where there are none."""
    names = other_recipe(tree)
    recipe = int(tree.attrs[RECIPE])
    if recipe > INTERVAL_RECIPE:
        message = f"made by a later recipe ({recipe}, here {INTERVAL_RECIPE}): not compared"
    elif names:
        of = ", ".join(name for name in _STATISTICS if name in names)
        made = f"made by an earlier recipe ({recipe}, here {INTERVAL_RECIPE})"
        message = f"those of {of} are {made}; only the estimates are compared"
    else:
        return None
    return CheckResult("intervals", CheckOutcome.UNCHECKED, message)


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
