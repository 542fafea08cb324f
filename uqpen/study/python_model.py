"""Declarations of a model and of an output for a study made in Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

__all__ = ["OutputSpec", "PythonModel"]

Thresholds = Sequence[str | float] | Mapping[str, Mapping[str, str | float]]


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
        for a number without a unit. For an output with dimensions an `OutputSpec` with
        `unit`, `along` and `may_end`.
    vectorized : bool
        True if it takes arrays of shape (run,) and returns arrays of shape (run, *dims), False for
        the inputs and outputs of one run.
    time_limit, memory_limit : str, optional
        Limits of one run, such as ``"5 min"`` and ``"2 GB"``.
    replaced : mapping of str to str or float, optional
        In a study with several models: values of inputs that replace the study's own.
    """

    function: Callable[..., Mapping[str, Any]]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str | OutputSpec]
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
            "outputs": self._output_tables(),
        }

    def _output_tables(self) -> Mapping[str, str | OutputSpec]:
        """Return the outputs, all as tables if one is: TOML writes tables last."""
        if not any(isinstance(value, OutputSpec) for value in self.outputs.values()):
            return self.outputs
        return {
            name: OutputSpec(value) if isinstance(value, str) else value
            for name, value in self.outputs.items()
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
    exceeds : sequence of str or mapping
        Thresholds whose probability of exceedance is estimated, such as ``"60 cm"``. A mapping
        has the acceptance limits of each: ``{"60 cm": {"at_most": 0.05}}``.
    below : sequence of str or mapping
        Thresholds; the probability that the output lies below each is estimated.
    hold, hold_above, hold_between : sequence of float
        Contents of upper tolerance limits, of lower ones, and of two-sided tolerance intervals.
    along : mapping of str to mapping, optional
        Dimensions of an output of a Python function, such as
        ``{"time": {"unit": "s", "from": 0, "to": 10, "size": 101}}`` or
        ``{"time": {"unit": "s", "values": [0, 1, 3]}}``. Each run has values along them, in place
        of a number. Its statistics are those at each place.
    may_end : bool
        Whether a curve may end before its dimension does: NaN at its end is then no failure.
    of : str, optional
        An output with dimensions; this one is a number that follows from it, after each run.
    take : str, optional
        What is taken of it, such as ``"max"``; see the study file.
    at : mapping of str to str, optional
        In place of `take`: the place whose value is taken, such as ``{"time": "10 day"}``.
    threshold : str or float, optional
        Of ``take="first_above"`` and ``"first_below"``.
    """

    unit: str | None = None
    quantiles: Sequence[float] = ()
    exceeds: Thresholds = ()
    below: Thresholds = ()
    hold: Sequence[float] = ()
    hold_above: Sequence[float] = ()
    hold_between: Sequence[float] = ()
    along: Mapping[str, Mapping[str, Any]] | None = None
    may_end: bool = False
    of: str | None = None
    take: str | None = None
    at: Mapping[str, str | float] | None = None
    threshold: str | float | None = None

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file."""
        threshold = {} if self.threshold is None else {"threshold": self.threshold}  # may be 0
        return {name: value for name, value in vars(self).items() if value} | threshold
