"""Trial run: one run of each model at the nominal point, before a study is started."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uqpen.core.arrays import Arrays
from uqpen.core.model import Results, RunWarning
from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.study.study import ValidatedStudy

__all__ = ["TrialRun", "trial_run"]


@dataclass(frozen=True)
class TrialRun:
    """Run of a model at the nominal point.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (1,)
        The nominal point in SI units.
    results : Results
        What the model has returned there.
    folder : Path or None
        Folder in which its files are kept.
    warnings : tuple of str
        Warnings of the model about it.
    seconds : float
        Its duration.
    """

    inputs: Arrays
    results: Results
    folder: Path | None
    warnings: tuple[str, ...]
    seconds: float

    @property
    def status(self) -> Status:
        """Status of the run."""
        return Status(int(self.results.status[0]))

    @property
    def reason(self) -> str:
        """Reason of a failed run; empty for another."""
        return self.results.reasons.get(0, "")


def trial_run(study: ValidatedStudy, name: str) -> TrialRun:
    """Run a model of a study, given its name, at the nominal point.

    Random inputs are at their medians.
    """
    variant = study.models[name]
    model = variant.model
    model.prepare()
    nominal = {**study.joint.nominal(), **variant.given}
    columns = {name: np.array([value]) for name, value in nominal.items()}
    began = time.monotonic()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = Evaluator(model, study.constraints)(columns)
    seconds = time.monotonic() - began
    of_run = [each.message for each in caught if isinstance(each.message, RunWarning)]
    return TrialRun(
        columns,
        results,
        model.run_folder(nominal),
        tuple(dict.fromkeys(warning.of_one_run for warning in of_run)),
        seconds,
    )
