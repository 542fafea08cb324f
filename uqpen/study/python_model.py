"""Declarations of a model and of an output for a study made in Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from uqpen.core.catalogue import REQUESTED

__all__ = ["OutputSpec", "PythonModel"]

# Settings of an output with dimensions, which belong to the model.
_OF_MODEL = ("along", "may_end", "on", "interpolation")

_Class = TypeVar("_Class", bound=type)

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
        `unit`, `along`, `may_end`, `on` and `interpolation`.
    vectorized : bool
        True if it takes arrays of shape ``(run,)`` and returns arrays of shape ``(run, *dims)``,
        False for the inputs and outputs of one run.
    time_limit, memory_limit : str, optional
        Limits of one run, such as ``"5 min"`` and ``"2 GB"``.
    replaced : mapping of str to str or float, optional
        In a study with several models: values of inputs that replace the study's own.
    dimensions : mapping of str to mapping, optional
        Dimensions that several outputs have, for the names in their `along`.
    """

    function: Callable[..., Mapping[str, Any]]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str | OutputSpec]
    vectorized: bool = False
    time_limit: str | None = None
    memory_limit: str | None = None
    replaced: Mapping[str, str | float] = field(default_factory=dict)
    dimensions: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file, with the function itself."""
        return {
            "object": self.function,
            "vectorized": self.vectorized or None,
            "time_limit": self.time_limit,
            "memory_limit": self.memory_limit,
            "with": self.replaced or None,
            "dimensions": self.dimensions or None,
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


def _take_requests(declared: _Class) -> _Class:
    """Add an argument for each statistic of the catalogue that declares its request."""
    for statistic in REQUESTED:
        if statistic.asked.declared_by:
            declared.__annotations__[statistic.asked.key] = "Sequence[float]"
            setattr(declared, statistic.asked.key, ())
    return declared


@dataclass(frozen=True)
@_take_requests
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
    expected_shortfall, return_periods, … : sequence of float
        Entries of the other statistics that a study file can ask for, by its keys.
    scale : str, optional
        ``"log"``: charts and indices are of the logarithm of the output.
    along : mapping of str to mapping or sequence of str, optional
        Dimensions of an output of a Python function, such as
        ``{"time": {"unit": "s", "from": 0, "to": 10, "size": 101}}``,
        ``{"time": {"unit": "s", "values": [0, 1, 3]}}`` or
        ``{"time": {"file": "times.csv", "column": "time"}}``; or the names of `dimensions` of a
        `PythonModel`. Each run has values along them, in place of a number. Its
        statistics are those at each place.
    on : mapping of str to str, optional
        By dimension, the name under which each run returns coordinates of its own, such as
        ``{"time": "t"}``. Its values are then interpolated to the declared ones.
    interpolation : str, optional
        How: ``"linear"`` (default), ``"cubic"`` (monotone), ``"previous"``, or ``"none"`` if both
        have to be the same.
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
    scale: str | None = None
    along: Mapping[str, Mapping[str, Any]] | Sequence[str] | None = None
    may_end: bool = False
    on: Mapping[str, str] | None = None
    interpolation: str | None = None
    of: str | None = None
    take: str | None = None
    at: Mapping[str, str | float] | None = None
    threshold: str | float | None = None

    def model_part(self) -> dict[str, Any]:
        """Return the settings that the model declares, if it has any of them."""
        return {name: value for name in _OF_MODEL if (value := getattr(self, name))}

    def without_model_part(self) -> OutputSpec:
        """Return the same without what the model declares."""
        return replace(self, along=None, may_end=False, on=None, interpolation=None)

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file."""
        threshold = {} if self.threshold is None else {"threshold": self.threshold}  # may be 0
        return {name: value for name, value in vars(self).items() if value} | threshold
