"""Steps of an analysis, which are reported as they start."""

from __future__ import annotations

from uqpen.execution import Progress
from uqpen.study.study import ValidatedStudy

__all__ = ["AnalysisSteps"]

# Its fit, and its estimates.
_STEPS_OF_A_SURROGATE = 2


class AnalysisSteps:
    """Numbered steps of the analysis of a study.

    Parameters
    ----------
    study : ValidatedStudy
        The study whose runs are analysed.
    progress : Progress
        Receives a report at the start of each step.
    """

    def __init__(self, study: ValidatedStudy, progress: Progress) -> None:
        models, designs = len(study.models), len(study.designs)
        of_a_model = designs + _STEPS_OF_A_SURROGATE * len(study.surrogates) + 1
        self._total = models * of_a_model + (models - 1)
        self._progress = progress
        self._number = 0
        self._has_several_models = study.has_several_models

    def start(self, name: str, model: str = "") -> None:
        """Report the start of a step, of one model where there are several."""
        self._number += 1
        of = f" of {model}" if model and self._has_several_models else ""
        self._progress.start_step(f"{name}{of}", self._number, self._total)
