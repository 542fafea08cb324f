"""Reading of the kept folders of runs again, in place of making the runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uqpen.checkpoints.checkpoint_folder import CheckpointFolder
from uqpen.core.errors import CheckpointError, StudyError
from uqpen.core.status import Status
from uqpen.study.study import ValidatedStudy

__all__ = ["read_again"]


def read_again(
    study: ValidatedStudy, kept: CheckpointFolder, *, repeats_others: bool
) -> ValidatedStudy:
    """Return a study that reads the folders of its runs where they are kept.

    All finished runs are removed from the checkpoint, as other readings may give other outputs.

    Parameters
    ----------
    study : ValidatedStudy
        A study of a program.
    kept : CheckpointFolder
        Its finished runs.
    repeats_others : bool
        Whether finished runs without a folder may be removed, too.

    Raises
    ------
    StudyError
        If no model of the study keeps folders.
    CheckpointError
        If finished runs have no folder.
    """
    models = {name: variant.model.reading_again() for name, variant in study.models.items()}
    if all(variant.model is models[name] for name, variant in study.models.items()):
        raise StudyError("no model of the study keeps the folders of its runs; a command does")
    if not repeats_others and (without := _runs_without_folder(study, kept)):
        raise CheckpointError(
            f"{kept.folder}: {without} finished runs have no folder that could be read again\n"
            'keep = "all" in [model] keeps those of later runs; with --fresh, the others are '
            "repeated"
        )
    kept.remove_all()
    variants = {name: variant.with_model(models[name]) for name, variant in study.models.items()}
    return replace(study, models=variants)


def _runs_without_folder(study: ValidatedStudy, kept: CheckpointFolder) -> int:
    """Return the number of finished runs whose folders are not kept."""
    count = 0
    for model, finished in kept.finished_runs():
        for position in np.flatnonzero(finished.results.status == Status.OK).tolist():
            inputs = {name: float(values[position]) for name, values in finished.inputs.items()}
            count += study.models[model].model.run_folder(inputs) is None
    return count
