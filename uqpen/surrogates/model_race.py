"""A race of several surrogates by cross-validation: how far the best one leads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.surrogates.diagnostics import Diagnostic, quality_text

__all__ = ["ModelRace"]

# A lead is beyond the noise above this number of its standard errors.
_STANDARD_ERRORS = 2


@dataclass(frozen=True)
class ModelRace:
    """Errors of several surrogates of one output at the same runs, which none of them has seen.

    Parameters
    ----------
    winner : str
        The candidate with the least mean square error.
    q2 : mapping of str to float
        Share of the variance that each candidate predicts, the best one first.
    lead : float
        Q² of the winner minus that of the next one; NaN without a second.
    lead_error : float
        Standard error of the lead, over the runs; NaN without a second.
    """

    winner: str
    q2: Mapping[str, float]
    lead: float = math.nan
    lead_error: float = math.nan

    @classmethod
    def of_predictions(cls, values: FloatArray, predictions: Mapping[str, FloatArray]) -> ModelRace:
        """Compare predictions with an output.

        Parameters
        ----------
        values : ndarray, shape (run,)
            Not all the same.
        predictions : mapping of str to ndarray, shape (run,)
            By candidate, one at least.
        """
        variance = float(np.var(values))
        squares = {name: (values - found) ** 2 for name, found in predictions.items()}
        order = sorted(squares, key=lambda name: float(squares[name].mean()))
        q2 = {name: 1 - float(squares[name].mean()) / variance for name in order}
        winner, *others = order
        if not others:
            return cls(winner, q2)
        # Paired, as a run that is hard to predict is so for every candidate.
        more = (squares[others[0]] - squares[winner]) / variance
        error = float(more.std(ddof=1)) / math.sqrt(len(more))
        return cls(winner, q2, float(more.mean()), error)

    @property
    def is_decided(self) -> bool:
        """True if the lead is beyond the noise of the runs."""
        return self.lead > _STANDARD_ERRORS * self.lead_error

    @property
    def text(self) -> str:
        """Sentence on the winner, on the next one and on its lead."""
        (winner, best), *others = self.q2.items()
        start = f"{winner} predicts the runs left out (Q² {quality_text(best)})"
        if not others:
            return f"{start}; no other kind could be fitted"
        name, next_best = others[0]
        lead = f"the lead of {self.lead:.2g} ± {_STANDARD_ERRORS * self.lead_error:.2g}"
        noise = "is beyond the noise" if self.is_decided else "is within the noise"
        return f"{start} better than {name} ({quality_text(next_best)}); {lead} {noise}"

    def diagnostics(self) -> Iterator[Diagnostic]:
        """Yield the Q² of each candidate, and the lead of the winner."""
        for name, value in self.q2.items():
            title = f"Q² of {name}, runs left out"
            yield Diagnostic(f"race_q2_{name.replace('-', '_')}", value, title)
        yield Diagnostic("race_lead", self.lead, "lead in Q²")
        yield Diagnostic("race_lead_error", self.lead_error, "standard error of the lead")

    @classmethod
    def from_diagnostics(cls, winner: str, values: Mapping[str, float]) -> ModelRace:
        """Restore it from its `diagnostics`; `values` are in their order."""
        prefix = "race_q2_"
        q2 = {
            name.removeprefix(prefix).replace("_", "-"): value
            for name, value in values.items()
            if name.startswith(prefix)
        }
        return cls(winner, q2, values["race_lead"], values["race_lead_error"])
