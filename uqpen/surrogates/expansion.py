"""Expansion of one output: its terms and their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import INPUT
from uqpen.core.model import Output
from uqpen.surrogates.basis import NestedSums, nested_sums
from uqpen.surrogates.fit_noise import FitNoise
from uqpen.surrogates.prediction_error import predictive_q2
from uqpen.surrogates.storage import describe, description

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Expansion", "PredictionCheck"]


_LOGARITHM, _NO_TRANSFORM = "logarithm", "none"


@dataclass(frozen=True)
class PredictionCheck:
    """Prediction error of an expansion at runs that it was not fitted to.

    Parameters
    ----------
    runs : int
        Number of completed runs.
    q2 : float
        One minus the mean square error over the variance, of the variable that was fitted.
    q2_of_output : float
        The same of the output itself; NaN where the expansion is not finite at a run.
    """

    runs: int = 0
    q2: float = math.nan
    q2_of_output: float = math.nan


@dataclass(frozen=True, eq=False)
class Expansion:
    """One output as a sum of orthonormal terms.

    Parameters
    ----------
    output : Output
        The model output that it approximates.
    indices : ndarray of int, shape (term, input)
        The degrees of each term; the constant is one of them.
    coefficients : ndarray, shape (term,)
        In the output's SI unit, or of its logarithm.
    is_logarithm : bool
        Whether it is the output's natural logarithm that is expanded.
    order : int
        The highest order of the terms that it was chosen from.
    truncation : float
        The truncation of these terms; see `uqpen.surrogates.basis.multi_indices`.
    method : str
        How the coefficients were found, in words.
    leave_one_out : float
        Mean square of each training run's error when it is left out and the terms stay, as a share
        of the variance; NaN where there is none.
    cross_validation : float
        The same at runs that took no part in choosing the terms either. Infinite where it
        cannot be estimated, as where one run alone decides a coefficient.
    smallest, largest : float
        The range of the output in the training runs.
    noise : FitNoise
        The scatter of estimates from refitting.
    check : PredictionCheck
        The prediction error at runs of another design.
    """

    output: Output
    indices: IntArray
    coefficients: FloatArray
    is_logarithm: bool
    order: int
    truncation: float
    method: str
    leave_one_out: float
    cross_validation: float
    smallest: float
    largest: float
    noise: FitNoise
    check: PredictionCheck = PredictionCheck()

    @property
    def q2(self) -> float:
        """Share of the variance predicted at runs left out, by cross-validation; NaN if unknown."""
        return 1 - self.cross_validation if math.isfinite(self.cross_validation) else math.nan

    @cached_property
    def nested(self) -> NestedSums:
        """Nested form of the sum, for evaluation."""
        return nested_sums(self.indices, self.coefficients)

    def output_values(self, fitted: FloatArray) -> FloatArray:
        """Return the output from the variable that was fitted; infinite where it overflows."""
        with np.errstate(over="ignore"):
            return np.exp(fitted) if self.is_logarithm else fitted

    def prediction_check(self, fitted: FloatArray, truth: FloatArray) -> PredictionCheck:
        """Compare the expansion with an output's true values at some runs.

        Parameters
        ----------
        fitted : ndarray, shape (run,)
            The variable that was fitted, by the expansion.
        truth : ndarray, shape (run,)
            The output, by the model.
        """
        of_output = predictive_q2(self.output_values(fitted), truth)
        if not self.is_logarithm:
            return PredictionCheck(len(truth), of_output, of_output)
        with np.errstate(divide="ignore", invalid="ignore"):
            return PredictionCheck(len(truth), predictive_q2(fitted, np.log(truth)), of_output)

    def to_dataset(self) -> xr.Dataset:
        """Return the terms for an archive, with the diagnostics of the fit as attributes."""
        import xarray as xr

        output, noise, check = self.output, self.noise, self.check
        logarithm = "the logarithm of " if self.is_logarithm else ""
        degrees = {"long_name": f"degrees of the terms of {output.title}", "units": "1"}
        coefficients = {
            "long_name": f"coefficients of {logarithm}{output.title}",
            "units": "1" if self.is_logarithm else output.unit,
        }
        scatter = {"long_name": f"fit noise of {output.title}'s first-order indices", "units": "1"}
        return xr.Dataset(
            {
                "degree": (("term", INPUT), self.indices.astype(np.int32), degrees),
                "coefficient": ("term", self.coefficients, coefficients),
                "fit_noise": (INPUT, noise.first, scatter),
            },
            attrs={
                **describe(output, "of_"),
                "transform": _LOGARITHM if self.is_logarithm else _NO_TRANSFORM,
                "order": self.order,
                "truncation": self.truncation,
                "terms": len(self.coefficients),
                "method": self.method,
                "leave_one_out_error": self.leave_one_out,
                "cross_validation_error": self.cross_validation,
                "q2": self.q2,
                "check_runs": check.runs,
                "check_q2": check.q2,
                "check_q2_of_output": check.q2_of_output,
                "training_minimum": self.smallest,
                "training_maximum": self.largest,
                "fit_noise_refits": noise.refits,
                "fit_noise_mean": noise.mean,
                "fit_noise_std": noise.std,
            },
        )

    @classmethod
    def from_dataset(cls, name: str, dataset: xr.Dataset) -> Expansion:
        """Restore the expansion of an output from `to_dataset`."""
        attributes = dataset.attrs
        first = np.asarray(dataset["fit_noise"].values, dtype=np.float64)
        return cls(
            output=Output(name, *description(attributes, "of_")),
            indices=dataset["degree"].values.astype(np.int64),
            coefficients=np.asarray(dataset["coefficient"].values, dtype=np.float64),
            is_logarithm=attributes["transform"] == _LOGARITHM,
            order=int(attributes["order"]),
            truncation=float(attributes["truncation"]),
            method=str(attributes["method"]),
            leave_one_out=float(attributes["leave_one_out_error"]),
            cross_validation=float(attributes["cross_validation_error"]),
            smallest=float(attributes["training_minimum"]),
            largest=float(attributes["training_maximum"]),
            noise=FitNoise(
                int(attributes["fit_noise_refits"]),
                float(attributes["fit_noise_mean"]),
                float(attributes["fit_noise_std"]),
                first,
            ),
            check=PredictionCheck(
                int(attributes["check_runs"]),
                float(attributes["check_q2"]),
                float(attributes["check_q2_of_output"]),
            ),
        )
