"""Model of a fitted polynomial chaos."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from uqpen.archive.groups import read_group
from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.labels import INPUT, NOT_FITTED, ROLE
from uqpen.core.model import Input, Model, Output
from uqpen.core.status import Status
from uqpen.surrogates.basis import ProductBasis
from uqpen.surrogates.closed_forms import (
    mean,
    shapley_effects,
    sobol_indices,
    standard_deviation,
)
from uqpen.surrogates.expansion import Expansion
from uqpen.surrogates.fitted_surrogate import (
    ClosedForms,
    FittedSurrogate,
    InputShares,
    Prediction,
)
from uqpen.surrogates.storage import describe, description, unfitted_outputs
from uqpen.surrogates.univariate_basis import UnivariateBasis

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PolynomialChaosModel"]

# The names of variables of the group ``input``.
_RECURRENCE, _FIXED = "_recurrence", "fixed_"


@dataclass(frozen=True, eq=False)
class PolynomialChaosModel(FittedSurrogate, ClosedForms):
    """A model's outputs, expanded in polynomials of its random inputs.

    Parameters
    ----------
    name : str
        Its name in the study.
    inputs : tuple of Input
        Those of the model that it stands for.
    outputs : tuple of Output
        Those that could be fitted.
    basis : ProductBasis
        The polynomials.
    expansions : mapping of str to Expansion
        One for each output.
    reasons : mapping of str to str
        The reason why each other output could not be fitted.
    fixed : mapping of str to float
        The values that the other inputs had in all training runs; it knows of no others.
    design : str
        To whose runs it was fitted.
    counts : mapping of Status to int
        Number of those runs with each status.
    is_independent : bool
        Whether the random inputs are.
    original : Model, optional
        The original model, which checks whether inputs are admissible; it is not in an archive.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    basis: ProductBasis
    expansions: Mapping[str, Expansion]
    reasons: Mapping[str, str]
    fixed: Mapping[str, float]
    design: str
    counts: Mapping[Status, int]
    is_independent: bool
    original: Model | None = None

    @property
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""
        return self.basis.names

    @property
    def logarithms(self) -> frozenset[str]:
        """Outputs whose logarithm was expanded."""
        return frozenset(name for name, each in self.expansions.items() if each.is_logarithm)

    def predict(self, inputs: Arrays) -> dict[str, Prediction]:
        """Evaluate the expansions; they have no predictive standard deviation."""
        return {
            name: Prediction(self.expansions[name].output_values(fitted))
            for name, fitted in self._fitted_values(inputs).items()
        }

    def training_range(self, output: str) -> tuple[float, float]:
        """Return the smallest and the largest value of an output in the training runs."""
        return self.expansions[output].smallest, self.expansions[output].largest

    def identity(self) -> dict[str, str]:
        """Return the identity of the original model, and a hash of its coefficients."""
        digest = hashlib.sha256()
        for expansion in self.expansions.values():
            digest.update(expansion.indices.tobytes() + expansion.coefficients.tobytes())
        coefficients = {"coefficients_sha256": digest.hexdigest()}
        return {"name": self.name, **coefficients, **super().identity()}

    def with_check(self, runs: xr.Dataset) -> PolynomialChaosModel:
        """Return a copy with its prediction errors at the completed runs of another design."""
        inputs, completed = self.completed_runs(runs)
        fitted = self._fitted_values(inputs)
        expansions = {}
        for name, expansion in self.expansions.items():
            truth = completed[name].values.astype(np.float64)
            expansions[name] = replace(
                expansion, check=expansion.prediction_check(fitted[name], truth)
            )
        return replace(self, expansions=expansions)

    @property
    def estimator(self) -> str:
        """Name of the estimator of moments and indices without draws."""
        return "from the coefficients"

    def closed_form_moments(self, output: str) -> tuple[float, float]:
        """Return mean and standard deviation of an expansion."""
        terms = self._terms(output)
        return mean(*terms), standard_deviation(*terms)

    def closed_form_indices(self, output: str) -> InputShares:
        """Return Sobol' indices and Shapley effects of an expansion."""
        terms = self._terms(output)
        indices = sobol_indices(*terms)
        return InputShares(indices.first, indices.total, shapley_effects(*terms))

    def closed_form_terms(self, outputs: Sequence[str]) -> tuple[IntArray, FloatArray]:
        """Return the terms of several expansions; see `ClosedForms.closed_form_terms`."""
        expansions = [self.expansions[output] for output in outputs]
        every = np.concatenate([expansion.indices for expansion in expansions])
        indices, rows = np.unique(every, axis=0, return_inverse=True)
        coefficients = np.zeros((len(indices), len(expansions)))
        columns = np.repeat(np.arange(len(expansions)), [len(e.coefficients) for e in expansions])
        coefficients[rows.ravel(), columns] = np.concatenate([e.coefficients for e in expansions])
        return indices, coefficients

    def closed_form_parts(self, output: str, inputs: Arrays) -> tuple[FloatArray, FloatArray]:
        """Return sums of an expansion's terms; see `ClosedForms.closed_form_parts`."""
        indices, coefficients = self._terms(output)
        values = self.basis.matrix(inputs, indices) * coefficients
        is_in = indices > 0
        is_alone = is_in & (is_in.sum(axis=1) == 1)[:, None]
        return values @ is_alone, values @ is_in

    def closed_form_problem(self, output: str) -> str:
        """Return the reason why the coefficients do not give the output's moments and indices.

        The text is empty if they do.

        Indices from the coefficients of a logarithm are those of the logarithm.
        """
        if not self.is_independent:
            return "the random inputs depend on each other"
        if self.counts[Status.INADMISSIBLE]:
            return "some draws are inadmissible, and the coefficients take no account of that"
        if self.expansions[output].is_logarithm:
            return "its logarithm was expanded"
        return ""

    def to_tree(self) -> xr.DataTree:
        """Return the group of an archive; see `FittedSurrogate.to_tree`.

        The group ``input`` has the polynomials of random inputs and the values of fixed ones. Its
        name is reserved, so no output has it.
        """
        import xarray as xr

        given = {variable.name: variable for variable in self.inputs}
        inputs: dict[str, Any] = {
            f"{basis.name}{_RECURRENCE}": basis.to_variable(given[basis.name])
            for basis in self.basis.univariate_bases
        }
        for name, value in self.fixed.items():
            inputs[f"{_FIXED}{name}"] = ((), value, describe(given[name]) | {ROLE: "input"})
        names = np.array(self.random_inputs, dtype=object)
        coordinates = {INPUT: (INPUT, names, {"long_name": "random input"})}
        attributes = {
            "kind": "polynomial-chaos",
            "design": self.design,
            "outputs": " ".join(self.expansions),
            "inputs": "independent" if self.is_independent else "dependent",
            "runs": sum(self.counts.values()),
            "runs_used": self.counts[Status.OK],
            **{f"runs_{status.meaning}": count for status, count in self.counts.items()},
        }
        groups = {"/": xr.Dataset(attrs=attributes), INPUT: xr.Dataset(inputs, coordinates)}
        for output, expansion in self.expansions.items():
            groups[output] = expansion.to_dataset().assign_coords(coordinates)
        for output, reason in self.reasons.items():
            groups[output] = xr.Dataset(attrs={NOT_FITTED: reason})
        return xr.DataTree.from_dict(groups)

    @classmethod
    def from_tree(cls, tree: xr.DataTree, name: str, original: Model | None) -> Self:
        """Restore it from `to_tree`."""
        group, attributes = read_group(tree, INPUT), tree.attrs
        recurrences = {str(entry): group[f"{entry}{_RECURRENCE}"] for entry in group[INPUT].values}
        fixed = {
            str(entry).removeprefix(_FIXED): variable
            for entry, variable in group.data_vars.items()
            if variable.attrs.get(ROLE) == "input"
        }
        inputs = [
            *(Input(key, *description(each.attrs, "of_")) for key, each in recurrences.items()),
            *(Input(key, *description(each.attrs)) for key, each in fixed.items()),
        ]
        expansions = {
            output: Expansion.from_dataset(output, read_group(tree, output))
            for output in str(attributes["outputs"]).split()
        }
        basis = ProductBasis(
            tuple(UnivariateBasis.from_variable(*each) for each in recurrences.items())
        )
        for output, expansion in expansions.items():
            if not basis.has_terms(expansion.indices):
                raise ValueError(f"terms of {output} that its polynomials do not have")
        return cls(
            name=name,
            inputs=original.inputs if original else tuple(inputs),
            outputs=tuple(expansion.output for expansion in expansions.values()),
            basis=basis,
            expansions=expansions,
            reasons=unfitted_outputs(tree),
            fixed={entry: float(variable.values) for entry, variable in fixed.items()},
            design=str(attributes["design"]),
            counts={status: int(attributes[f"runs_{status.meaning}"]) for status in Status},
            is_independent=attributes["inputs"] == "independent",
            original=original,
        )

    def _terms(self, output: str) -> tuple[IntArray, FloatArray]:
        expansion = self.expansions[output]
        return expansion.indices, expansion.coefficients

    def _fitted_values(self, inputs: Arrays) -> dict[str, FloatArray]:
        """Return the variables that were fitted, at some points."""
        every = list(self.expansions.values())
        if not every:
            return {}
        indices = np.concatenate([expansion.indices for expansion in every])
        sums = self.basis.evaluate(inputs, indices, [expansion.nested for expansion in every])
        return dict(zip(self.expansions, sums, strict=True))
