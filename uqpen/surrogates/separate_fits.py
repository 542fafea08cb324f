"""Fitted surrogate made of a fit for each output."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import xarray as xr

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.model import Model, Output
from uqpen.core.processors import one_blas_thread
from uqpen.surrogates.diagnostics import (
    DIAGNOSTICS,
    FIELD,
    Diagnostic,
    describe,
    description,
    diagnostics_dataset,
    predictive_q2,
    shown_diagnostics,
)
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.training import TrainedSurrogate


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
        values = {}
        for each in dataclasses.fields(cls):  # type: ignore[arg-type]
            is_array = each.name in dataset
            value = dataset[each.name].values if is_array else dataset.attrs[f"{FIELD}{each.name}"]
            # A file gives a number as one of NumPy.
            values[each.name] = value.item() if isinstance(value, np.generic) else value
        return cls(**values)


# Prediction errors at runs of another design.
_CHECK_TITLES = {
    "check_runs": "check runs",
    "check_q2_of_output": "Q², check runs",
    "check_within_2_std": "check runs within 2 std",
}

# Points predicted at a time, so that memory suffices for a matrix of them and the training runs.
_ROWS = 4096


@dataclass(frozen=True, eq=False)
class FittedOutput:
    """Fit to an output, with what is known of its quality."""

    output: Output  # the model output that it approximates
    fit: OutputFit  # its predictions
    smallest: float  # least value of the output in the training runs
    largest: float  # largest value there
    checks: tuple[Diagnostic, ...] = ()  # prediction errors at runs of another design

    def with_check(self, points: FloatArray, truth: FloatArray) -> FittedOutput:
        """Return a copy with its prediction errors at other runs."""
        predicted = predict_output(self.fit, points)
        values = [float(len(truth)), predictive_q2(predicted.mean, truth)]
        if predicted.std is not None:
            is_within = np.abs(truth - predicted.mean) <= 2 * predicted.std
            values.append(float(is_within.mean()) if len(truth) else math.nan)
        pairs = zip(_CHECK_TITLES.items(), values, strict=False)
        return replace(
            self, checks=tuple(Diagnostic(key, value, title) for (key, title), value in pairs)
        )

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
        kept = shown_diagnostics(group) if DIAGNOSTICS in group.children else ()
        return cls(
            output=Output(name, *description(attributes, "of_")),
            fit=kind.from_dataset(group.to_dataset(inherit=False)),
            smallest=float(attributes["training_minimum"]),
            largest=float(attributes["training_maximum"]),
            checks=tuple(each for each in kept if each.name in _CHECK_TITLES),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class SeparateFits(TrainedSurrogate):
    """Surrogate with a fit of its own for each output."""

    fitted: Mapping[str, FittedOutput]  # the fit to each output
    kind: str  # the class of its settings, as an archive names it

    def predict(self, inputs: Arrays) -> dict[str, Prediction]:
        """Predict its outputs; see `FittedSurrogate.predict`."""
        points = self._points(inputs)
        return {name: predict_output(each.fit, points) for name, each in self.fitted.items()}

    def predict_means(self, inputs: Arrays) -> dict[str, FloatArray]:
        """Predict its outputs without their deviations."""
        points = self._points(inputs)
        return {
            name: predict_output(each.fit, points, with_std=False).mean
            for name, each in self.fitted.items()
        }

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
        fits = {}
        for output, each in self.fitted.items():
            fits[output], fits[f"{output}/{DIAGNOSTICS}"] = each.to_groups()
        return self._tree(self.kind, fits)

    @classmethod
    def from_tree(
        cls,
        tree: xr.DataTree,
        name: str,
        original: Model | None,
        output_fit: type[OutputFit] = OutputFit,
    ) -> Self:
        """Restore it from `to_tree`; its fits are of the class `output_fit`."""
        known = cls._restored(tree, name, original)
        fitted = {
            output: FittedOutput.from_group(output, tree.children[output], output_fit)
            for output in str(tree.attrs["outputs"]).split()
        }
        return cls(
            **known,
            outputs=tuple(each.output for each in fitted.values()),
            fitted=fitted,
            kind=str(tree.attrs["kind"]),
        )

    def _points(self, inputs: Arrays) -> FloatArray:
        return np.column_stack([inputs[name] for name in self.random_inputs])


@one_blas_thread()
def predict_output(fit: OutputFit, points: FloatArray, *, with_std: bool = True) -> Prediction:
    """Return the prediction of an output at some points, a part of them at a time.

    Raises
    ------
    TypeError, ValueError
        If the fit gives anything but a number for each point, and a standard deviation if any.
    """
    parts = []
    for start in range(0, len(points), _ROWS):
        some = points[start : start + _ROWS]
        found: object = fit.predict(some) if with_std else Prediction(fit.predict_mean(some))
        parts.append(_valid_prediction(found, len(some)))
    means = np.concatenate([np.empty(0), *(each.mean for each in parts)])
    return Prediction(
        means, _joined([each.std for each in parts]), _joined([each.mean_std for each in parts])
    )


def _joined(parts: Sequence[FloatArray | None]) -> FloatArray | None:
    """Return the deviations of all points; None where some or all points have none."""
    known = [each for each in parts if each is not None]
    return np.concatenate(known) if len(known) == len(parts) > 0 else None


def _valid_prediction(found: object, points: int) -> Prediction:
    if not isinstance(found, Prediction):
        raise TypeError(f"predict returns an object of class {type(found).__name__}")
    for label, values in vars(found).items():
        if values is None:
            continue
        if np.shape(values) != (points,):
            raise ValueError(
                f"predict returns a {label} of shape {np.shape(values)}, not {(points,)}"
            )
        if label != "mean" and not (np.asarray(values) >= 0).all():
            raise ValueError(f"predict returns a {label} that is negative or no number")
    arrays = (
        None if values is None else np.asarray(values, dtype=np.float64)
        for values in (found.std, found.mean_std)
    )
    return Prediction(np.asarray(found.mean, dtype=np.float64), *arrays)
