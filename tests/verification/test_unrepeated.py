"""Surrogates of this uqpen's recipe are repeated; those of another are left out, and named."""

from __future__ import annotations

from collections.abc import Callable

import xarray as xr

import uqpen
from uqpen.study.study import ValidatedStudy
from uqpen.verification.unrepeated import leave_out

STUDY = """
[designs.training]
kind = "monte-carlo"
runs = 20
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
order = 1
"""


def test_only_surrogates_of_the_recipe_of_today_are_repeated(
    study_of: Callable[..., ValidatedStudy],
) -> None:
    study = study_of("a + b", STUDY, a=(0, 1), b=(0, 1))
    tree: xr.DataTree = uqpen.run(study)
    assert leave_out(study, tree, trust=True) == (study, tree, [])
    tree["statistics/pce"].attrs["surrogate_recipe"] += 1
    bare, kept, (result,) = leave_out(study, tree, trust=True)
    assert bare.surrogates == {}
    assert result.text == "not checked: pce; another uqpen has fitted and corrected them"
    assert not [path for path in kept.groups if "pce" in path]
    assert "/statistics/training/y" in kept.groups
