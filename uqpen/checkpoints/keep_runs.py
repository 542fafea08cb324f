"""Runs made outside a study, kept so that the study takes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uqpen.checkpoints.lock import lock_archive
from uqpen.checkpoints.parts import FinishedRuns
from uqpen.checkpoints.point_index import PointIndex
from uqpen.checkpoints.reused_runs import first_points
from uqpen.checkpoints.set_aside import add_set_aside
from uqpen.core.arrays import Arrays
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import MODELS
from uqpen.core.model import Results
from uqpen.study.fingerprint import model_fingerprint
from uqpen.study.study import ONLY_MODEL, ValidatedStudy

__all__ = ["keep_runs"]


def keep_runs(
    study: ValidatedStudy,
    path: str | Path,
    inputs: Arrays,
    results: Results,
    model: str = ONLY_MODEL,
) -> bool:
    """Keep finished runs beside an archive, where `make_archive` finds them by their inputs.

    Of a model whose versions cannot be distinguished, nothing is kept; nor are runs that are at no
    point of the study's designs.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    path : str or Path
        Its archive, which need not be there yet.
    inputs : mapping of str to ndarray, shape (run,)
        The points in SI units.
    results : Results
        Of the study's `Evaluator` at these points.
    model : str
        The name of the model in a study with several.

    Returns
    -------
    bool
        Whether they are kept.

    Raises
    ------
    ArchiveError
        If they cannot be written, or another process is making the archive.
    """
    if study.models[model].model.unknown_dependency or not _are_of_designs(study, inputs, model):
        return False
    path = Path(path).absolute()
    folder = path.with_name(f"{path.name}.parts")
    root = folder / MODELS / model if model else folder
    runs = FinishedRuns(np.arange(len(results.status)), dict(inputs), results)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with lock_archive(path):
            add_set_aside(root, model_fingerprint(study, model), runs)
    except ArchiveError:
        raise
    except OSError as error:
        raise ArchiveError(f"{folder}: runs cannot be kept: {error.strerror}") from None
    return True


def _are_of_designs(study: ValidatedStudy, inputs: Arrays, model: str) -> bool:
    """Check whether a design begins with points among which is one of these."""
    for design in study.designs:
        index = PointIndex(first_points(study, design, model))
        if (index.find(inputs, 0, len(next(iter(inputs.values())))) >= 0).any():
            return True
    return False
