"""Interface of a fitted surrogate: predictions and, for some, closed forms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray, FloatArray, IntArray
from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Model, Results
from uqpen.core.status import Status

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction of an output at some points, in its SI unit.

    Parameters
    ----------
    mean : ndarray, shape (run,); of a field (run, *dims)
        The predicted values.
    std : ndarray of that shape, or None
        Their predictive standard deviations, of a run; None if the surrogate has none.
    mean_std : ndarray of that shape, or None
        Standard deviations of the mean of the output given the inputs, where the noise of runs is
        known from their repeats.
    """

    mean: FloatArray
    std: FloatArray | None = None
    mean_std: FloatArray | None = None


class FittedSurrogate(Model):
    """Model that approximates another one near the runs that it was fitted to.

    Its inputs and conditions are those of the original model. Its outputs are those that could be
    fitted; `reasons` explains the others.

    Attributes
    ----------
    reasons : mapping of str to str
        The reason why each missing output could not be fitted.
    fixed : mapping of str to float
        The values that the inputs without a distribution had in all training runs. It knows of no
        others.
    original : Model or None
        The original model, which checks whether inputs are admissible; it is not in an archive.
    """

    reasons: Mapping[str, str]
    fixed: Mapping[str, float]
    original: Model | None

    @property
    @abstractmethod
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""

    @abstractmethod
    def predict(self, inputs: Arrays) -> Mapping[str, Prediction]:
        """Predict its outputs at some points.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            SI values of its random inputs at least.
        """

    @abstractmethod
    def training_range(self, output: str) -> tuple[float, float]:
        """Return the smallest and the largest value of an output in the training runs."""

    @abstractmethod
    def with_check(self, runs: xr.Dataset) -> Self:
        """Return a copy with its prediction errors at runs that it was not fitted to."""

    @abstractmethod
    def to_tree(self) -> xr.DataTree:
        """Return the group of an archive: enough to predict, and the diagnostics of the fit.

        Its attribute ``kind`` is the one that a study names. The attributes ``design``, ``outputs``
        (names with spaces between) and ``runs_used`` are needed by readers. It has no variables,
        but a group for each output, with the diagnostics of the fit
        (`uqpen.surrogates.diagnostics`), or the reason why there is none. Other groups in it have
        reserved names.
        """

    @classmethod
    @abstractmethod
    def from_tree(cls, tree: xr.DataTree, name: str, original: Model | None) -> Self:
        """Restore it from `to_tree`; see `archived_surrogate.restore_surrogate`."""

    @property
    def without_fields(self) -> FittedSurrogate:
        """The surrogate of its scalar outputs, and of the scores of its fields."""
        return self

    @property
    def logarithms(self) -> frozenset[str]:
        """Outputs that were fitted as their logarithm."""
        return frozenset()

    def predict_means(self, inputs: Arrays) -> Mapping[str, FloatArray]:
        """Predict its outputs without standard deviations, which some kinds do faster."""
        return {name: prediction.mean for name, prediction in self.predict(inputs).items()}

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the predicted values; see `Model.evaluate`."""
        status = np.full(len(inputs[self.random_inputs[0]]), Status.OK, dtype=np.int8)
        return Results(self.predict_means(inputs), status)

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        """Yield the conditions of the original model, and that fixed inputs have their values."""
        for name, value in self.fixed.items():
            if name in inputs:
                yield inputs[name] == value, f"{name} = {value:g}, as in the runs it was fitted to"
        if self.original is not None:
            yield from self.original.conditions(inputs)

    def missing_inputs(self, given: Collection[str]) -> Iterator[str]:
        """Yield its random inputs that are not given; the other inputs have known values."""
        yield from (name for name in self.random_inputs if name not in given)

    def identity(self) -> dict[str, str]:
        """Return its name and the identity of the original model."""
        of = self.original.identity() if self.original else {}
        return {"name": self.name, **{f"of_{key}": value for key, value in of.items()}}

    def completed_runs(self, runs: xr.Dataset) -> tuple[dict[str, FloatArray], xr.Dataset]:
        """Return the random inputs of the completed runs of a design, and these runs."""
        completed = runs.isel({RUN: np.flatnonzero(runs[STATUS].values == Status.OK)})
        inputs = {
            name: np.broadcast_to(completed[name].values, completed.sizes[RUN])
            for name in self.random_inputs
        }
        return inputs, completed


@dataclass(frozen=True, eq=False)
class InputShares:
    """Shares of the variance of an output that the inputs have."""

    first: FloatArray  # (input,): first-order Sobol' indices
    total: FloatArray  # (input,): total-order Sobol' indices
    shapley: FloatArray  # (input,): Shapley effects; their sum is 1


class ClosedForms(ABC):
    """Fitted surrogate whose moments and indices follow from its parameters, without draws.

    They are those of the variable that was fitted: the output, or its logarithm. The inputs are
    independent.
    """

    @property
    @abstractmethod
    def estimator(self) -> str:
        """Name of the estimator, such as "from the coefficients"."""

    @abstractmethod
    def closed_form_problem(self, output: str) -> str:
        """Return why an output's moments and indices cannot follow; empty if they can."""

    def has_closed_form(self, output: str) -> bool:
        """Check that moments and indices of an output follow without draws."""
        return not self.closed_form_problem(output)

    @abstractmethod
    def closed_form_moments(self, output: str) -> tuple[float, float]:
        """Return mean and standard deviation of the variable that was fitted."""

    @abstractmethod
    def closed_form_indices(self, output: str) -> InputShares:
        """Return the indices of the variable that was fitted."""

    def closed_form_terms(self, outputs: Sequence[str]) -> tuple[IntArray, FloatArray] | None:
        """Return the orthonormal terms of several outputs; None if they are no such sums.

        Moments and indices of any sum of these outputs follow from them.

        Returns
        -------
        indices : ndarray of int, shape (term, input)
            The degrees of the terms, each once; all of degree 0 is the constant.
        coefficients : ndarray, shape (term, output)
        """
        return None

    def closed_form_parts(
        self, output: str, inputs: Arrays
    ) -> tuple[FloatArray, FloatArray] | None:
        """Return what each input adds to an output at some points; None if that is not known.

        Parameters
        ----------
        output : str
        inputs : mapping of str to ndarray, shape (run,)
            SI values of the random inputs at least.

        Returns
        -------
        alone, in_all : ndarray, shape (run, input)
            Sum of the terms in the input alone, and of all terms that it is in.
        """
        return None
