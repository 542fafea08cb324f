"""Verdicts by the rule of today are repeated; those by another are left as they are, and named."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import xarray as xr

import uqpen
from uqpen.study.study import ValidatedStudy
from uqpen.trust import VALIDATION_RULE
from uqpen.verification.archived_study import archived_runs
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.earlier_verdicts import earlier_verdict_groups, without_verdicts
from uqpen.verification.repetition import repeated_statistics

pytestmark = pytest.mark.slow

STUDY = """
[designs.training]
kind = "monte-carlo"
runs = 20
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
order = 1
"""


def test_only_verdicts_by_the_rule_of_today_are_compared(
    study_of: Callable[..., ValidatedStudy],
) -> None:
    study = study_of("a + b", STUDY, a=(0, 1), b=(0, 1))
    tree = uqpen.run(study)
    assert tree["statistics/pce"].attrs["verdict_rule"] == VALIDATION_RULE
    mean = tree["statistics/pce/y"]["mean"]
    assert mean.attrs["interval_label"] == "unchecked"
    mean.attrs["interval_label"] = "refused"

    def outcome(tree: xr.DataTree) -> CheckOutcome:
        names = [name for name in tree.attrs if name.startswith(("version", "model"))]
        return repeated_statistics(study, tree, archived_runs(tree), 0.0, names).verdict

    assert outcome(tree) is CheckOutcome.DIFFERENT
    assert earlier_verdict_groups(tree) == {}
    del tree["statistics/pce"].attrs["verdict_rule"]
    assert earlier_verdict_groups(tree) == {"/statistics/pce": "pce"}
    assert outcome(tree) is CheckOutcome.EQUAL
    mean.values[0] += 1e-3
    assert outcome(tree) is CheckOutcome.DIFFERENT


def test_what_is_left_out_stays_in_the_archive() -> None:
    texts = {"interval_label": "checked", "note": "inside the interval of runs", "units": "m"}
    group = xr.Dataset({"mean": ((), 1.0, texts)}, attrs={"verdict_rule": "another"})
    bare = without_verdicts(group)
    assert bare["mean"].attrs == {"units": "m"}
    assert bare.attrs == {}
    assert group["mean"].attrs == texts
    assert group.attrs == {"verdict_rule": "another"}
