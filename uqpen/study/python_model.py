"""Declarations of a model and of an output for a study made in Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

__all__ = ["OutputSpec", "PythonModel"]


@dataclass(frozen=True)
class PythonModel:
    """Python function as a model, with the units of its inputs and outputs.

    Parameters
    ----------
    function : callable
        Takes a keyword argument for each input and returns a mapping with each output. It may be
        defined in a notebook or inside another function.
    inputs, outputs : mapping of str to str
        The unit in which it takes each input and returns each output, such as ``"cm"``; ``"1"``
        for a number without a unit.
    vectorized : bool
        True if it takes and returns arrays of shape (run,), False for one number each.
    time_limit, memory_limit : str, optional
        Limits of one run, such as ``"5 min"`` and ``"2 GB"``.
    replaced : mapping of str to str or float, optional
        In a study with several models: values of inputs that replace the study's own.
    """

    function: Callable[..., Mapping[str, Any]]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    vectorized: bool = False
    time_limit: str | None = None
    memory_limit: str | None = None
    replaced: Mapping[str, str | float] = field(default_factory=dict)

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file, with the function itself."""
        return {
            "object": self.function,
            "vectorized": self.vectorized or None,
            "time_limit": self.time_limit,
            "memory_limit": self.memory_limit,
            "with": self.replaced or None,
            "inputs": self.inputs,
            "outputs": self.outputs,
        }


@dataclass(frozen=True)
class OutputSpec:
    """Quantity of interest of an output.

    Parameters
    ----------
    unit : str, optional
        Unit for display; of a bare function, the unit in which it returns the output.
    quantiles : sequence of float
        Probabilities of further quantiles, beside 0.05, 0.5 and 0.95.
    exceeds : sequence of str
        Thresholds whose probability of exceedance is estimated, such as ``"60 cm"``.
    hold : sequence of float
        Contents of one-sided upper tolerance limits.
    """

    unit: str | None = None
    quantiles: Sequence[float] = ()
    exceeds: Sequence[str | float] = ()
    hold: Sequence[float] = ()

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file."""
        return {name: value for name, value in vars(self).items() if value}
