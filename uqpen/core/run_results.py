"""Results of a batch of runs, and warnings of a model about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.status import Status
from uqpen.core.variables import Output

__all__ = ["Results", "RunWarning", "empty_outputs"]


@dataclass(frozen=True)
class Results:
    """Results of a batch of runs.

    Parameters
    ----------
    outputs : mapping of str to ndarray, shape (run, *dims)
        SI values, of shape (run,) for an output without dimensions; NaN where a run failed (any
        value for a categorical output).
    status : ndarray of int8, shape (run,)
        See `uqpen.core.status.Status`.
    reasons : mapping of int to str
        The reason why each failed run failed, by its position in the batch.
    files : set of str
        Own modules with which the runs were made, and what was seen in a run that was observed;
        each as `Dependency.line` (`uqpen.core.dependency`).
    """

    outputs: Arrays
    status: npt.NDArray[np.int8]
    reasons: Mapping[int, str] = field(default_factory=dict)
    files: frozenset[str] = frozenset()

    @classmethod
    def all_ok(cls, outputs: Arrays) -> Results:
        """Return the results of a batch in which no run failed."""
        runs = len(next(iter(outputs.values())))
        return cls(outputs, np.full(runs, Status.OK, dtype=np.int8))


class RunWarning(UserWarning):
    """Warning of a model about its runs, in words that name no line of code.

    Parameters
    ----------
    text : str
        The same in all runs that it is true of, so that it is shown once.
    of_one_run : str
        The same with the numbers of one run.
    """

    def __init__(self, text: str, of_one_run: str = "") -> None:
        super().__init__(text)
        self.of_one_run = of_one_run or text


def empty_outputs(outputs: Sequence[Output], runs: int) -> dict[str, FloatArray]:
    """Return an array of NaN for each output, of shape (run, *dims)."""
    return {output.name: np.full((runs, *output.shape), np.nan) for output in outputs}
