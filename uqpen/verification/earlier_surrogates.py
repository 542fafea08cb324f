"""Surrogates that another uqpen has fitted or corrected in another way: they are not repeated."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import xarray as xr

from uqpen.archive.read import model_trees
from uqpen.core.labels import SOURCE_KIND, STATISTICS_GROUP, SURROGATE_RECIPE
from uqpen.study.study import ValidatedStudy
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.user_defined_statistics import without_surrogates
from uqpen.workflow.surrogate_source import RECIPE

__all__ = ["check_surrogate_recipe", "leave_out_surrogates"]


def check_surrogate_recipe(
    study: ValidatedStudy, tree: xr.DataTree
) -> tuple[ValidatedStudy, xr.DataTree, list[CheckResult]]:
    """Leave out the surrogates of another recipe than this uqpen's, with a result for them."""
    names = _of_another_recipe(tree)
    if not names:
        return study, tree, []
    message = f"not checked: {', '.join(names)}; another uqpen has fitted and corrected them"
    result = CheckResult("surrogates", CheckOutcome.UNCHECKED, message)
    return *leave_out_surrogates(study, tree, names), [result]


def _of_another_recipe(tree: xr.DataTree) -> list[str]:
    found = {
        str(name): None
        for model in model_trees(tree).values()
        for name, source in model.children.get(STATISTICS_GROUP, xr.DataTree()).children.items()
        if source.attrs.get(SOURCE_KIND) == "surrogate"
        and source.attrs.get(SURROGATE_RECIPE) != RECIPE
    }
    return list(found)


def leave_out_surrogates(
    study: ValidatedStudy, tree: xr.DataTree, names: Collection[str]
) -> tuple[ValidatedStudy, xr.DataTree]:
    """Return a study and its archive without some surrogates and their statistics."""
    others = {name: each for name, each in study.surrogates.items() if name not in names}
    return replace(study, surrogates=others), without_surrogates(tree, names)
