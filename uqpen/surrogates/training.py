"""The runs that a surrogate is fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INPUT, QUADRATURE_WEIGHT, ROLE, RUN, STATUS
from uqpen.core.model import Input, Model, Output
from uqpen.core.status import Status
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import status_counts
from uqpen.surrogates.diagnostics import describe, description

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TrainingRecord", "TrainingRuns", "known_inputs", "logarithm_problem", "size_problem"]

# Sums of squares of up to 1e8 values, and of their coefficients, are finite and not 0.
_LARGEST = 1e140


@dataclass(frozen=True, eq=False)
class TrainingRuns:
    """Completed runs of a design, for training.

    Parameters
    ----------
    inputs, outputs : mapping of str to ndarray, shape (run,)
        The random inputs, and the outputs that have numbers, in SI units.
    fixed : mapping of str to float
        The other inputs, each with its one value.
    weights : ndarray, shape (run,), or None
        Weights of an integration rule (`is_quadrature`), if all its nodes have completed.
    counts : mapping of Status to int
        Number of the design's runs with each status.
    problem : str
        The reason why nothing can be fitted to these runs; empty if something can.
    """

    inputs: Mapping[str, FloatArray]
    outputs: Mapping[str, FloatArray]
    fixed: Mapping[str, float]
    weights: FloatArray | None
    is_quadrature: bool
    counts: Mapping[Status, int]
    problem: str

    @classmethod
    def from_runs(cls, runs: xr.Dataset, model: Model, joint: JointDistribution) -> TrainingRuns:
        """Select the completed runs of a design."""
        came_back = runs[STATUS].values == Status.OK
        taken = {variable.name for variable in model.inputs}
        random = {entry.variable.name for entry in joint.random}
        inputs: dict[str, FloatArray] = {}
        fixed: dict[str, float] = {}
        problem = "" if random else "no input is random"
        for name in runs.data_vars:
            variable = runs.variables[name]
            if variable.attrs.get(ROLE) != "input":
                continue
            values = np.broadcast_to(variable.values, runs.sizes[RUN])
            if name in random:
                inputs[str(name)] = values[came_back]
            elif name not in taken:
                continue  # only other models of the study take it
            elif (values == values[0]).all():
                fixed[str(name)] = float(values[0])
            else:
                problem = f"its design varies {name}, which has no distribution"
        is_rule = QUADRATURE_WEIGHT in runs.coords
        return cls(
            inputs=inputs,
            outputs={
                output.name: runs[output.name].values[came_back].astype(np.float64)
                for output in model.all_outputs
                if output.is_number
            },
            fixed=fixed,
            weights=runs[QUADRATURE_WEIGHT].values if is_rule and came_back.all() else None,
            is_quadrature=is_rule,
            counts=status_counts(runs),
            problem=problem if came_back.any() else "none of its runs came back",
        )

    @property
    def all_counts(self) -> dict[Status, int]:
        """Number of the design's runs with each status, 0 included."""
        return {status: self.counts[status] for status in Status}

    def output_problem(self, output: Output) -> str:
        """Return the reason why nothing can be fitted to an output; empty if something can."""
        if output.categories:
            return "it has kinds, not numbers"
        if output.dims:
            return "it has dimensions, and is fitted by the scores of its principal components"
        if self.problem:
            return self.problem
        values = self.outputs[output.name]
        if output.absent and (absent := int(np.isnan(values).sum())):
            return f"some runs have no value of it ({output.absent} in {absent})"
        if not np.isfinite(values).all():
            return f"it is not finite in {int((~np.isfinite(values)).sum())} runs that came back"
        if (values == values[0]).all():
            return f"it does not vary: it is {values[0]:g} in every run"
        return size_problem(values)


def size_problem(values: FloatArray) -> str:
    """Return the reason why squares of values are too large or too small; empty if they are not."""
    size, width = float(np.abs(values).max()), float(np.ptp(values))
    if size > _LARGEST or width < 1 / _LARGEST:
        what = f"its largest size is {size:g}, its range {width:g}"
        return f"its squares are too large or too small for floating-point numbers: {what}"
    return ""


def logarithm_problem(values: FloatArray) -> str:
    """Return the reason why the logarithm of values cannot be fitted; empty if it can."""
    if (values > 0).all():
        return ""
    return f"it has no logarithm where it is not positive: its least value is {values.min():g}"


def known_inputs(model: Model, joint: JointDistribution) -> tuple[Input, ...]:
    """Return the model's inputs, and random ones that only other models of the study take."""
    taken = {variable.name for variable in model.inputs}
    others = (entry.variable for entry in joint.random if entry.variable.name not in taken)
    return (*model.inputs, *others)


# Record of the runs that a surrogate was fitted to, for its group of an archive.

_FIXED = "fixed_"
_TEXTS = ("units", "display_units", "long_name")


@dataclass(frozen=True, eq=False)
class TrainingRecord:
    """The design, the varied inputs and the statuses of the training runs.

    Parameters
    ----------
    design : str
        To whose runs a surrogate was fitted.
    random_inputs : tuple of str
        The inputs that varied.
    counts : mapping of Status to int
        Number of those runs with each status.
    is_independent : bool
        Whether the random inputs are.
    """

    design: str
    random_inputs: tuple[str, ...]
    counts: Mapping[Status, int]
    is_independent: bool

    def attributes(self) -> dict[str, Any]:
        """Return what an archive says of the runs."""
        return {
            "inputs": "independent" if self.is_independent else "dependent",
            "runs": sum(self.counts.values()),
            "runs_used": self.counts[Status.OK],
            **{f"runs_{status.meaning}": count for status, count in self.counts.items()},
        }

    @classmethod
    def from_attributes(cls, attributes: Mapping[Any, Any], inputs: xr.Dataset) -> Self:
        """Restore it from `attributes` and the group of `input_dataset`."""
        return cls(
            str(attributes["design"]),
            tuple(map(str, inputs[INPUT].values)),
            {status: int(attributes[f"runs_{status.meaning}"]) for status in Status},
            attributes["inputs"] == "independent",
        )

    def input_dataset(self, inputs: Sequence[Input], fixed: Mapping[str, float]) -> xr.Dataset:
        """Return descriptions of the random inputs, and the values of fixed ones."""
        import xarray as xr

        given = {variable.name: variable for variable in inputs}
        texts = [describe(given[name]) for name in self.random_inputs]
        variables: dict[str, Any] = {
            f"{INPUT}_{key}": (INPUT, np.array([text[key] for text in texts], dtype=object))
            for key in _TEXTS
        }
        for name, value in fixed.items():
            variables[f"{_FIXED}{name}"] = ((), value, describe(given[name]) | {ROLE: INPUT})
        names = np.array(self.random_inputs, dtype=object)
        return xr.Dataset(variables, {INPUT: (INPUT, names, {"long_name": "random input"})})

    @staticmethod
    def read_inputs(group: xr.Dataset) -> tuple[tuple[Input, ...], dict[str, float]]:
        """Return the inputs, and the values of fixed ones, from `input_dataset`."""
        names = [str(name) for name in group[INPUT].values]
        texts = [
            dict(zip(_TEXTS, each, strict=True))
            for each in zip(*(group[f"{INPUT}_{key}"].values for key in _TEXTS), strict=True)
        ]
        fixed = {
            str(entry).removeprefix(_FIXED): variable
            for entry, variable in group.data_vars.items()
            if variable.attrs.get(ROLE) == INPUT
        }
        inputs = [
            *(Input(name, *description(text)) for name, text in zip(names, texts, strict=True)),
            *(Input(name, *description(each.attrs)) for name, each in fixed.items()),
        ]
        return tuple(inputs), {name: float(each.values) for name, each in fixed.items()}
