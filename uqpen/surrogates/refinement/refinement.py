"""Settings of a refinement: how many further runs, and which estimates they are to sharpen."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.settings import choice, count

__all__ = ["FOR_MEAN", "FOR_PROBABILITIES", "RefinedOutput", "Refinement"]

FOR_MEAN, FOR_PROBABILITIES = "mean", "probabilities"


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """Further runs of the design that a surrogate is fitted to.

    Parameters
    ----------
    refine : int, optional
        Number of further runs; without it, there are none.
    refine_for : str
        What they sharpen: ``"mean"``, the corrected means of all outputs, or ``"probabilities"``,
        those of the thresholds of the study.
    """

    refine: int | None = count(minimum=10, maximum=100_000, default=None)
    refine_for: str = choice(FOR_MEAN, FOR_PROBABILITIES, default=FOR_MEAN)


@dataclass(frozen=True)
class RefinedOutput:
    """An output whose estimates are to be sharpened.

    Parameters
    ----------
    output : str
        Its name.
    limits : tuple of float
        Thresholds whose probabilities are meant, in its SI unit; its mean where there are none.
    """

    output: str
    limits: tuple[float, ...] = ()
