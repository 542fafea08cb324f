"""Fitted surrogate made of a fit for each output."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import xarray as xr

from uqpen.archive.groups import read_group
from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.labels import NOT_FITTED
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.core.threads import one_blas_thread
from uqpen.surrogates.diagnostics import (
    DIAGNOSTICS,
    FIELD,
    Diagnostic,
    describe,
    description,
    diagnostics_dataset,
    predictive_q2,
    unfitted_outputs,
)
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.training import TrainingRecord

__all__ = ["FittedOutput", "OutputFit", "SeparateFits", "predict_mean", "predict_output"]


class OutputFit(ABC):
    """Fit to one output of a model: a frozen dataclass that predicts the output.

    Its fields are arrays of numbers, numbers and texts. An archive keeps them, and nothing else.
    """

    @abstractmethod
    def predict(self, points: FloatArray) -> Prediction:
        """Predict the output.

        Parameters
        ----------
        points : ndarray, shape (run, input)
            The random inputs in SI units, in the order of the fit.
        """

    @property
    def is_of_logarithm(self) -> bool:
        """True if it was fitted to the logarithm of the output."""
        return False

    def predict_mean(self, points: FloatArray) -> FloatArray:
        """Predict the output without its standard deviation, which a fit may do faster."""
        return self.predict(points).mean

    def diagnostics(self) -> Iterator[Diagnostic]:
        """Yield numbers that say something about the fit, each under a name of its own."""
        yield from ()

    def to_dataset(self) -> xr.Dataset:
        """Return its fields as variables and attributes of an archive.

        Raises
        ------
        TypeError
            If a field is no array of numbers, number or text.
        """
        variables, attributes = {}, {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
                dims = tuple(f"{field.name}_{axis}" for axis in range(value.ndim))
                variables[field.name] = (dims, value, {"long_name": field.name})
            elif isinstance(value, int | float | str | np.number):
                attributes[f"{FIELD}{field.name}"] = value
            else:
                found = f"{type(self).__name__}.{field.name} is an object of {type(value)}"
                raise TypeError(f"{found}, not an array of numbers, a number or a text")
        return xr.Dataset(variables, attrs=attributes)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """Restore it from `to_dataset`."""
        values = {
            field.name: dataset[field.name].values
            if field.name in dataset
            else _plain(dataset.attrs[f"{FIELD}{field.name}"])
            for field in dataclasses.fields(cls)  # type: ignore[arg-type]
        }
        return cls(**values)


def _plain(value: object) -> object:
    """Return a number of Python for one of NumPy, as which a file gives it."""
    return value.item() if isinstance(value, np.generic) else value


# Points predicted at a time, so that memory suffices for a matrix of them and the training runs.
_ROWS = 4096


@dataclass(frozen=True, eq=False)
class FittedOutput:
    """Fit to an output, with what is known of its quality.

    Parameters
    ----------
    output : Output
        The model output that it approximates.
    fit : OutputFit
        Its predictions.
    smallest, largest : float
        The range of the output in the training runs.
    checks : tuple of Diagnostic
        Prediction errors at runs of another design.
    """

    output: Output
    fit: OutputFit
    smallest: float
    largest: float
    checks: tuple[Diagnostic, ...] = ()

    def with_check(self, points: FloatArray, truth: FloatArray) -> FittedOutput:
        """Return a copy with its prediction errors at other runs."""
        return replace(self, checks=tuple(_checks(predict_output(self.fit, points), truth)))

    def to_groups(self) -> tuple[xr.Dataset, xr.Dataset]:
        """Return its group of an archive, and that of its diagnostics."""
        names = [each.name for each in self.fit.diagnostics()]
        if len({*names, *_CHECK_TITLES}) < len(names) + len(_CHECK_TITLES):
            raise ValueError(f"the diagnostics {', '.join(names)} do not have names of their own")
        limits = {"training_minimum": self.smallest, "training_maximum": self.largest}
        dataset = self.fit.to_dataset().assign_attrs(describe(self.output, "of_") | limits)
        return dataset, diagnostics_dataset([*self.fit.diagnostics(), *self.checks])

    @classmethod
    def from_group(cls, name: str, group: xr.DataTree, kind: type[OutputFit]) -> FittedOutput:
        """Restore the fit to an output from its groups."""
        attributes = group.attrs
        kept = group.children[DIAGNOSTICS].data_vars if DIAGNOSTICS in group.children else {}
        checks = tuple(
            Diagnostic(
                str(key), float(each.values), str(each.attrs["long_name"]), str(each.attrs["units"])
            )
            for key, each in kept.items()
            if str(key) in _CHECK_TITLES
        )
        return cls(
            output=Output(name, *description(attributes, "of_")),
            fit=kind.from_dataset(group.to_dataset(inherit=False)),
            smallest=float(attributes["training_minimum"]),
            largest=float(attributes["training_maximum"]),
            checks=checks,
        )


@dataclass(frozen=True, eq=False)
class SeparateFits(FittedSurrogate):
    """Surrogate with a fit of its own for each output.

    Parameters
    ----------
    name : str
        Its name in the study.
    inputs : tuple of Input
        Those of the model that it stands for.
    outputs : tuple of Output
        Those that could be fitted.
    fitted : mapping of str to FittedOutput
        The fit to each of them.
    reasons, fixed, original
        As in `FittedSurrogate`.
    training : TrainingRecord
        The runs that it was fitted to.
    kind : str
        The class of its settings, as an archive names it.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    fitted: Mapping[str, FittedOutput]
    reasons: Mapping[str, str]
    fixed: Mapping[str, float]
    training: TrainingRecord
    kind: str
    original: Model | None = None

    @property
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""
        return self.training.random_inputs

    def predict(self, inputs: Arrays) -> dict[str, Prediction]:
        """Predict its outputs; see `FittedSurrogate.predict`."""
        points = self._points(inputs)
        return {name: predict_output(each.fit, points) for name, each in self.fitted.items()}

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the predicted values without their deviations; see `Model.evaluate`."""
        points = self._points(inputs)
        values = {name: predict_mean(each.fit, points) for name, each in self.fitted.items()}
        return Results(values, np.full(len(points), Status.OK, dtype=np.int8))

    @property
    def logarithms(self) -> frozenset[str]:
        """Outputs that were fitted as their logarithm."""
        return frozenset(name for name, each in self.fitted.items() if each.fit.is_of_logarithm)

    def training_range(self, output: str) -> tuple[float, float]:
        """Return the smallest and the largest value of an output in the training runs."""
        return self.fitted[output].smallest, self.fitted[output].largest

    def with_check(self, runs: xr.Dataset) -> Self:
        """Return a copy with its prediction errors at the completed runs of another design."""
        inputs, completed = self.completed_runs(runs)
        points = self._points(inputs)
        fitted = {
            name: each.with_check(points, completed[name].values.astype(np.float64))
            for name, each in self.fitted.items()
        }
        return replace(self, fitted=fitted)

    def identity(self) -> dict[str, str]:
        """Return the identity of the original model, and a hash of its fits."""
        digest = hashlib.sha256()
        for each in self.fitted.values():
            dataset = each.fit.to_dataset()
            digest.update(repr(dataset.attrs).encode())
            for variable in dataset.variables.values():
                digest.update(np.ascontiguousarray(variable.values).tobytes())
        return {"name": self.name, "fits_sha256": digest.hexdigest(), **super().identity()}

    def to_tree(self) -> xr.DataTree:
        """Return the group of an archive; see `FittedSurrogate.to_tree`."""
        attributes = {
            "kind": self.kind,
            "design": self.training.design,
            "outputs": " ".join(self.fitted),
            **self.training.attributes(),
        }
        groups = {
            "/": xr.Dataset(attrs=attributes),
            "input": self.training.input_dataset(self.inputs, self.fixed),
        }
        for output, each in self.fitted.items():
            groups[output], groups[f"{output}/{DIAGNOSTICS}"] = each.to_groups()
        for output, reason in self.reasons.items():
            groups[output] = xr.Dataset(attrs={NOT_FITTED: reason})
        return xr.DataTree.from_dict(groups)

    @classmethod
    def from_tree(
        cls,
        tree: xr.DataTree,
        name: str,
        original: Model | None,
        output_fit: type[OutputFit] = OutputFit,
    ) -> Self:
        """Restore it from `to_tree`; its fits are of the class `output_fit`."""
        group = read_group(tree, "input")
        inputs, fixed = TrainingRecord.read_inputs(group)
        fitted = {
            output: FittedOutput.from_group(output, tree.children[output], output_fit)
            for output in str(tree.attrs["outputs"]).split()
        }
        return cls(
            name=name,
            inputs=original.inputs if original else inputs,
            outputs=tuple(each.output for each in fitted.values()),
            fitted=fitted,
            reasons=unfitted_outputs(tree),
            fixed=fixed,
            training=TrainingRecord.from_attributes(tree.attrs, group),
            kind=str(tree.attrs["kind"]),
            original=original,
        )

    def _points(self, inputs: Arrays) -> FloatArray:
        return np.column_stack([inputs[name] for name in self.random_inputs])


@one_blas_thread()
def predict_output(fit: OutputFit, points: FloatArray) -> Prediction:
    """Return the prediction of an output at some points, a part of them at a time.

    Raises
    ------
    TypeError, ValueError
        If the fit gives anything but a number for each point, and a standard deviation if any.
    """
    parts = _in_parts(fit.predict, points)
    deviations = [part.std for part in parts if part.std is not None]
    return Prediction(
        _joined_means(parts),
        np.concatenate(deviations) if deviations and len(deviations) == len(parts) else None,
    )


@one_blas_thread()
def predict_mean(fit: OutputFit, points: FloatArray) -> FloatArray:
    """Return the prediction without deviations; otherwise as `predict_output`."""
    return _joined_means(_in_parts(lambda some: Prediction(fit.predict_mean(some)), points))


def _in_parts(predict: Callable[[FloatArray], Prediction], points: FloatArray) -> list[Prediction]:
    parts = (points[start : start + _ROWS] for start in range(0, len(points), _ROWS))
    return [_valid_prediction(predict(part), part) for part in parts]


def _joined_means(parts: list[Prediction]) -> FloatArray:
    return np.concatenate([part.mean for part in parts]) if parts else np.empty(0)


def _valid_prediction(found: object, points: FloatArray) -> Prediction:
    if not isinstance(found, Prediction):
        raise TypeError(f"predict returns an object of class {type(found).__name__}")
    for label, values in (("mean", found.mean), ("std", found.std)):
        if values is not None and np.shape(values) != (len(points),):
            raise ValueError(
                f"predict returns a {label} of shape {np.shape(values)}, not {(len(points),)}"
            )
    if found.std is not None and not (np.asarray(found.std) >= 0).all():
        raise ValueError("predict returns a std that is negative or no number")
    std = None if found.std is None else np.asarray(found.std, dtype=np.float64)
    return Prediction(np.asarray(found.mean, dtype=np.float64), std)


_CHECK_TITLES = {
    "check_runs": "check runs",
    "check_q2_of_output": "Q², check runs",
    "check_within_2_std": "check runs within 2 std",
}


def _checks(predicted: Prediction, truth: FloatArray) -> Iterator[Diagnostic]:
    """Yield the errors of predictions."""
    values = [float(len(truth)), predictive_q2(predicted.mean, truth)]
    if predicted.std is not None:
        is_within = np.abs(truth - predicted.mean) <= 2 * predicted.std
        values.append(float(is_within.mean()) if len(truth) else math.nan)
    for (name, title), value in zip(_CHECK_TITLES.items(), values, strict=False):
        yield Diagnostic(name, value, title)
