"""The runs that a surrogate is fitted to, and what every surrogate fitted to such runs has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from uqpen.archive.groups import read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INPUT, NOT_FITTED, QUADRATURE_WEIGHT, ROLE, RUN, STATUS
from uqpen.core.model import Input, Model, Output
from uqpen.core.status import Status
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import status_counts
from uqpen.surrogates.diagnostics import describe, description, unfitted_outputs
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

if TYPE_CHECKING:
    import xarray as xr

# Sums of squares of up to 1e8 values, and of their coefficients, are finite and not 0.
_LARGEST = 1e140


@dataclass(frozen=True, eq=False)
class TrainingRuns:
    """Completed runs of a design, for training."""

    model: Model  # the model that made them
    joint: JointDistribution  # the distribution of its inputs
    inputs: Mapping[str, FloatArray]  # (run,): the random inputs, in SI units
    outputs: Mapping[str, FloatArray]  # (run,): those that have numbers, in SI units
    fixed: Mapping[str, float]  # the other inputs, each with its one value
    # (run,): weights of an integration rule (`is_quadrature`), if all its nodes have completed.
    weights: FloatArray | None
    is_quadrature: bool
    counts: Mapping[Status, int]  # number of the design's runs with each status
    problem: str  # the reason why nothing can be fitted to these runs; empty if something can

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
            model=model,
            joint=joint,
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

    def described(self, name: str, design: str) -> dict[str, Any]:
        """Return what a `TrainedSurrogate` has of its runs.

        Its inputs are those of the model, and random ones that only other models of the study take.
        """
        taken = {variable.name for variable in self.model.inputs}
        random = [entry.variable for entry in self.joint.random]
        return {
            "name": name,
            "inputs": (*self.model.inputs, *(each for each in random if each.name not in taken)),
            "fixed": self.fixed,
            "training": TrainingRecord(
                design,
                tuple(each.name for each in random),
                {status: self.counts[status] for status in Status},
                self.joint.is_independent,
            ),
            "original": self.model,
        }

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


# Record of the runs that a surrogate was fitted to, for its group of an archive.

_FIXED = "fixed_"
_TEXTS = ("units", "display_units", "long_name")


@dataclass(frozen=True, eq=False)
class TrainingRecord:
    """The design, the varied inputs and the statuses of the training runs."""

    design: str  # to whose runs a surrogate was fitted
    random_inputs: tuple[str, ...]  # the inputs that varied
    counts: Mapping[Status, int]  # number of those runs with each status
    is_independent: bool  # whether the random inputs are

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
        """Restore it from `attributes`, and from the group with the random inputs."""
        return cls(
            str(attributes["design"]),
            tuple(map(str, inputs[INPUT].values)),
            {status: int(attributes[f"runs_{status.meaning}"]) for status in Status},
            attributes["inputs"] == "independent",
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class TrainedSurrogate(FittedSurrogate):
    """Fitted surrogate that knows its training runs, and whose archive group says so."""

    name: str  # its name in the study
    inputs: tuple[Input, ...]  # those of the model that it stands for
    outputs: tuple[Output, ...]  # those that could be fitted
    reasons: Mapping[str, str]  # as in `FittedSurrogate`
    fixed: Mapping[str, float]  # as in `FittedSurrogate`
    training: TrainingRecord  # the runs that it was fitted to
    original: Model | None = None  # as in `FittedSurrogate`

    @property
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""
        return self.training.random_inputs

    def _input_variables(self, inputs: Mapping[str, Input]) -> dict[str, Any]:
        """Return the variables of the group ``input`` that describe the random inputs."""
        texts = [describe(inputs[name]) for name in self.random_inputs]
        return {
            f"{INPUT}_{key}": (INPUT, np.array([text[key] for text in texts], dtype=object))
            for key in _TEXTS
        }

    @staticmethod
    def _read_inputs(group: xr.Dataset) -> list[Input]:
        """Return the random inputs from `_input_variables`."""
        columns = (group[f"{INPUT}_{key}"].values for key in _TEXTS)
        texts = [dict(zip(_TEXTS, each, strict=True)) for each in zip(*columns, strict=True)]
        names = map(str, group[INPUT].values)
        return [Input(name, *description(text)) for name, text in zip(names, texts, strict=True)]

    def _tree(self, kind: str, fits: Mapping[str, xr.Dataset]) -> xr.DataTree:
        """Return the group of an archive with the groups of the fits, by their paths.

        The group ``input`` has the random inputs, and the values of fixed ones. Its name is
        reserved, so no output has it.
        """
        import xarray as xr

        given = {variable.name: variable for variable in self.inputs}
        variables = self._input_variables(given)
        for name, value in self.fixed.items():
            variables[f"{_FIXED}{name}"] = ((), value, describe(given[name]) | {ROLE: INPUT})
        names = np.array(self.random_inputs, dtype=object)
        attributes = {
            "kind": kind,
            "design": self.training.design,
            "outputs": " ".join(output.name for output in self.outputs),
            **self.training.attributes(),
        }
        coordinates = {INPUT: (INPUT, names, {"long_name": "random input"})}
        groups = {
            "/": xr.Dataset(attrs=attributes),
            f"/{INPUT}": xr.Dataset(variables, coordinates),
            **{f"/{path}": group for path, group in fits.items()},
        }
        for output, reason in self.reasons.items():
            groups[f"/{output}"] = xr.Dataset(attrs={NOT_FITTED: reason})
        return xr.DataTree.from_dict(groups)

    @classmethod
    def _restored(cls, tree: xr.DataTree, name: str, original: Model | None) -> dict[str, Any]:
        """Return what every such surrogate has, but for its outputs, from `_tree`."""
        group = read_group(tree, INPUT)
        fixed = {
            str(entry).removeprefix(_FIXED): variable
            for entry, variable in group.data_vars.items()
            if variable.attrs.get(ROLE) == INPUT
        }
        others = (Input(key, *description(each.attrs)) for key, each in fixed.items())
        return {
            "name": name,
            "inputs": original.inputs if original else (*cls._read_inputs(group), *others),
            "reasons": unfitted_outputs(tree),
            "fixed": {key: float(each.values) for key, each in fixed.items()},
            "training": TrainingRecord.from_attributes(tree.attrs, group),
            "original": original,
        }
