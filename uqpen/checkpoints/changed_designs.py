"""Designs that have been changed so that none of their earlier runs is of use."""

from __future__ import annotations

from collections.abc import Collection

from uqpen.checkpoints.first_points import first_points
from uqpen.checkpoints.reused_runs import ReusedRuns
from uqpen.study.study import ValidatedStudy

__all__ = ["unusable_runs"]


def unusable_runs(
    study: ValidatedStudy,
    reused: ReusedRuns,
    known: Collection[str],
) -> dict[str, str]:
    """Return a text for each changed design of whose earlier runs none is at its first points.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    reused : ReusedRuns
        The runs that the study may take.
    known : collection of str
        Names of designs that are left out.

    Returns
    -------
    dict of str to str
        By the name of a design.
    """
    texts = {}
    for name in study.designs:
        for model, found in reused.sources.items():
            runs = sum(len(each.runs.runs) for each in found if each.changed_design == name)
            if runs and name not in known and not _finds_any(study, name, model, reused):
                texts[name] = f"none of its {runs} earlier runs is at a point of the changed design"
    return texts


def _finds_any(study: ValidatedStudy, name: str, model: str, reused: ReusedRuns) -> bool:
    """Check whether one of the first points of a design has an earlier run."""
    return bool(reused.used_places(model, first_points(study, name, model)))
