"""Interface of a fit to one output, for surrogates that fit each output by itself."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Self

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.surrogates.diagnostics import Diagnostic
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.storage import FIELD

__all__ = ["OutputFit"]


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
