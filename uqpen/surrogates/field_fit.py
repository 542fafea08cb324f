"""Fit to a field: its principal components, and how much of its variance a surrogate leaves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
import xarray as xr

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.labels import PRINCIPAL_COMPONENT, QUADRATURE_WEIGHT, RUN, STATUS
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.core.processors import one_blas_thread
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS
from uqpen.core.variables import field_coordinates
from uqpen.surrogates.diagnostics import (
    DIAGNOSTICS,
    Diagnostic,
    describe,
    description,
    diagnostics_dataset,
)
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.training import size_problem

# Principal components of a field: its mean and the few shapes that its runs scatter in.
#
# A field is its mean plus a sum of components, each times a score. The scores are plain numbers of
# a run, so a surrogate fits them as it fits scalar outputs. The components are orthonormal for the
# mean over the grid by the trapezoidal rule. So they are of the field, not of its grid: a finer
# part of the grid counts no more than its length.
#
# References
# ----------
# Ramsay, J. O. & Silverman, B. W. (2005). Functional Data Analysis. 2nd ed., Springer. Chapter 8.
# Campbell, K., McKay, M. D. & Williams, B. J. (2006). Reliab. Eng. Syst. Saf. 91, 1468-1472.


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """Mean of a field and its leading principal components."""

    weights: FloatArray  # (place,): see `uqpen.core.variables.Output.place_weights`
    mean: FloatArray  # (place,): mean of the training runs, in the SI unit of the field
    # (component, place): plain numbers, orthonormal under the weights, those of the largest
    # variance first.
    components: FloatArray
    variances: FloatArray  # (component,): variance of each score over the training runs
    truncated: FloatArray  # (place,): variance at each place that the components leave

    @classmethod
    @one_blas_thread()
    def of_runs(
        cls,
        values: FloatArray,
        weights: FloatArray,
        wanted: float,
        run_weights: FloatArray | None = None,
    ) -> PrincipalComponents:
        """Find the components of a field over some runs.

        Parameters
        ----------
        values : ndarray, shape (run, place)
            Finite, and not the same in all runs.
        weights : ndarray, shape (place,)
            See `uqpen.core.variables.Output.place_weights`.
        wanted : float or int
            The share of the variance that the components have at least, below 1; or their number.
        run_weights : ndarray, shape (run,), optional
            Weights of an integration rule, above 0; equal ones by default.
        """
        shares = np.ones(len(values)) if run_weights is None else run_weights
        shares = shares / shares.sum()
        mean = shares @ values
        roots = np.sqrt(shares)[:, None]
        left, sizes, shapes = scipy.linalg.svd(
            roots * (values - mean) * np.sqrt(weights), full_matrices=False, check_finite=False
        )
        rank = int((sizes > sizes[0] * max(values.shape) * np.finfo(float).eps).sum())
        kept = _kept(sizes[:rank] ** 2, wanted)
        components = shapes[:kept] / np.sqrt(weights)
        # The largest value of each is above 0.
        largest = np.abs(components).argmax(axis=1)
        components *= np.sign(components[np.arange(kept), largest])[:, None]
        is_constant = (values == values[0]).all(axis=0)
        # No rounding may look like scatter.
        mean, components = np.where(is_constant, values[0], mean), components * ~is_constant
        beyond = slice(kept, rank)
        rest = (left[:, beyond] * sizes[beyond]) @ shapes[beyond] / np.sqrt(weights)
        return cls(weights, mean, components, sizes[:kept] ** 2, (rest**2).sum(axis=0))

    @property
    def count(self) -> int:
        """Number of the components."""
        return len(self.components)

    @property
    def variance(self) -> float:
        """Variance of the field over the training runs, as a mean over its places."""
        return float(self.variances.sum() + self.weights @ self.truncated)

    @property
    def truncation(self) -> float:
        """Share of that variance that the components leave."""
        return float(self.weights @ self.truncated) / self.variance

    def at(self, places: slice) -> PrincipalComponents:
        """Return them at some of the places."""
        return replace(
            self,
            weights=self.weights[places],
            mean=self.mean[places],
            components=self.components[:, places],
            truncated=self.truncated[places],
        )

    def scores(self, values: FloatArray) -> FloatArray:
        """Return the scores of some runs, shape (run, component), from their fields."""
        return ((values - self.mean) * self.weights) @ self.components.T

    def fields(self, scores: FloatArray) -> FloatArray:
        """Return the fields of some runs, shape (run, place), from their scores.

        The sum goes by components, so a run has the same bits in any batch.
        """
        values = np.tile(self.mean, (len(scores), 1))
        for score, component in zip(scores.T, self.components, strict=True):
            values += score[:, None] * component
        return values


def _kept(variances: FloatArray, wanted: float) -> int:
    """Return the number of components to keep."""
    if isinstance(wanted, int):
        return min(wanted, len(variances))
    shares = np.cumsum(variances) / variances.sum()
    return min(int(np.searchsorted(shares, wanted)) + 1, len(variances))


# A model with the scores of its fields in their place: scalars, which any surrogate fits.

# No name of an output has a dot.
_SCORE = ".score_"


def score_name(output: str, number: int) -> str:
    """Return the name of the score of a component, counted from 0."""
    return f"{output}{_SCORE}{number + 1}"


@dataclass(frozen=True, eq=False)
class ScoreModel(Model):
    """Model whose outputs are those of another one, with scores in place of its fields."""

    original: Model  # A model with fields
    # Those of each field; a field without any is left out.
    components: Mapping[str, PrincipalComponents]

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the original model."""
        return self.original.name

    @property
    def inputs(self) -> tuple[Input, ...]:  # type: ignore[override]
        """Inputs of the original model."""
        return self.original.inputs

    @property
    def outputs(self) -> tuple[Output, ...]:  # type: ignore[override]
        """Scalar outputs of the original model, and scores in place of each field."""
        found: list[Output] = []
        for output in self.original.all_outputs:
            if not output.dims:
                found.append(output)
            elif output.name in self.components:
                for number in range(self.components[output.name].count):
                    title = f"score {number + 1} of {output.title}"
                    found.append(Output(score_name(output.name, number), output.unit, title))
        return tuple(found)

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the results of the original model with scores; see `Model.evaluate`."""
        results = self.original.evaluate(inputs)
        outputs = self.original.derive(results.outputs, results.status, inputs)
        fields = {output.name for output in self.original.outputs if output.dims}
        scalars = {name: values for name, values in outputs.items() if name not in fields}
        return replace(results, outputs=scalars | _scores(outputs, self.components))

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        """Yield the conditions of the original model."""
        return self.original.conditions(inputs)

    def identity(self) -> dict[str, str]:
        """Return the identity of the original model."""
        return self.original.identity()


def scored_runs(runs: xr.Dataset, components: Mapping[str, PrincipalComponents]) -> xr.Dataset:
    """Return runs of a model with scores in place of its fields."""
    fields = {name: runs[name].values for name in components}
    scores = {name: (RUN, values) for name, values in _scores(fields, components).items()}
    return runs.drop_vars(list(components)).assign(scores)


def _scores(fields: Arrays, components: Mapping[str, PrincipalComponents]) -> dict[str, FloatArray]:
    return {
        score_name(name, number): score
        for name, each in components.items()
        for number, score in enumerate(each.scores(fields[name].reshape(len(fields[name]), -1)).T)
    }


def field_components(output: Output, runs: xr.Dataset, wanted: float) -> PrincipalComponents | str:
    """Find the components of a field over the completed runs of a design.

    The result is the reason where that is not possible. `wanted` is as `PrincipalComponents`
    takes it.
    """
    if output.may_end:
        return "its curves may end, and principal components are of whole curves"
    completed = runs[STATUS].values == Status.OK
    if not completed.any():
        return "none of its runs came back"
    values = runs[output.name].values[completed].astype(np.float64)
    if (values == values[0]).all():
        return "it does not vary: it is the same in every run"
    if problem := size_problem(values):
        return problem
    weights = None
    if QUADRATURE_WEIGHT in runs.coords:
        weights = runs[QUADRATURE_WEIGHT].values[completed]
        # Sparse grids and rules with lost nodes are no distribution of runs.
        weights = weights if completed.all() and (weights > 0).all() else None
    matrix = values.reshape(len(values), -1)
    return PrincipalComponents.of_runs(matrix, output.place_weights, wanted, weights)


# Attribute of the group of a field: what the components and the surrogate leave, in words.
FIT_TEXT = "fit"

# A smaller share of a variance is rounding, which differs from one processor to another.
_ROUNDING = 1e-20


@dataclass(frozen=True, eq=False)
class FieldCheck:
    """Errors of a surrogate of a field at runs that it was not fitted to."""

    runs: int  # number of completed runs
    left: float  # mean square error over the field, as a share of its variance in these runs
    truncation: float  # the part of `left` that no surrogate of the scores can predict
    # (place,): one minus the mean square error at each place over the variance there.
    q2: FloatArray

    @classmethod
    def of_runs(
        cls, components: PrincipalComponents, scores: FloatArray, truth: FloatArray
    ) -> FieldCheck:
        """Compare predicted scores with the fields of some runs, each of shape (run, …)."""
        if len(truth) < 2:
            return cls(len(truth), math.nan, math.nan, np.full(truth.shape[1], math.nan))
        projected = components.fields(components.scores(truth))
        errors, rest = ((truth - each) ** 2 for each in (components.fields(scores), projected))
        with np.errstate(all="ignore"):
            variances = truth.var(axis=0, ddof=1)
            whole = components.weights @ variances
            return cls(
                runs=len(truth),
                left=_known_share(components.weights @ errors.mean(axis=0) / whole),
                truncation=_known_share(components.weights @ rest.mean(axis=0) / whole),
                q2=np.where(variances > 0, 1 - errors.mean(axis=0) / variances, math.nan),
            )


@dataclass(frozen=True, eq=False)
class FieldFit:
    """Principal components of a field, whose scores a surrogate predicts."""

    output: Output  # the field
    components: PrincipalComponents
    smallest: float  # with largest: the range of the field in the training runs
    largest: float
    # Share of the variance predicted at training runs left out; NaN if unknown.
    q2: float = math.nan
    check: FieldCheck | None = None

    @classmethod
    def of_runs(cls, output: Output, components: PrincipalComponents, runs: xr.Dataset) -> FieldFit:
        """Describe a field by its components and its training runs."""
        completed = runs[output.name].values[runs[STATUS].values == Status.OK]
        return cls(output, components, float(completed.min()), float(completed.max()))

    @property
    def scores(self) -> list[str]:
        """Names of the scores as outputs."""
        return [score_name(self.output.name, each) for each in range(self.components.count)]

    def prediction(self, scores: Mapping[str, Prediction]) -> Prediction:
        """Return the prediction of the field from those of its scores.

        Standard deviations are of independent errors of the scores, and contain the truncation.
        """
        mean = self.fields({name: scores[name].mean for name in self.scores})
        deviations = [each.std for name in self.scores if (each := scores[name]).std is not None]
        if len(deviations) < len(self.scores):
            return Prediction(mean)
        variances = np.tile(self.components.truncated, (len(mean), 1))
        for deviation, component in zip(deviations, self.components.components, strict=True):
            variances += deviation[:, None] ** 2 * component**2
        return Prediction(mean, np.sqrt(variances).reshape(mean.shape))

    def fields(self, scores: Mapping[str, FloatArray]) -> FloatArray:
        """Return the fields of scores by name, shape (run, *dims)."""
        found = self.components.fields(np.column_stack([scores[name] for name in self.scores]))
        return found.reshape(-1, *self.output.shape)

    def with_q2_of_scores(self, q2: Mapping[str, float]) -> FieldFit:
        """Return it with the Q² of the field at runs left out, from those of its scores."""
        known = np.array([q2.get(name, math.nan) for name in self.scores])
        return replace(self, q2=float(known @ self.components.variances / self.components.variance))

    def with_check(self, scores: Mapping[str, FloatArray], truth: FloatArray) -> FieldFit:
        """Return it with its errors at other runs, of shape (run, *dims)."""
        found = np.column_stack([scores[name] for name in self.scores])
        check = FieldCheck.of_runs(self.components, found, truth.reshape(len(truth), -1))
        return replace(self, check=check)

    @property
    def text(self) -> str:
        """Sentence on the share of the variance that the components and the surrogate leave."""
        count, truncation = self.components.count, self.components.truncation
        verb = "component leaves" if count == 1 else "components leave"
        found = f"{count} principal {verb} {_share_text(truncation)} of the variance of the field"
        if truncation > _ROUNDING:
            found += f" ({100 * math.sqrt(truncation):.2g} % of its standard deviation)"
        check = self.check
        if check is not None and math.isfinite(check.left):
            found += f"; at {check.runs} check runs the surrogate leaves {_share_text(check.left)}"
            if check.left > _ROUNDING:
                share = 100 * check.truncation / check.left
                found += f", {share:.0f} % of that by the truncation"
        elif math.isfinite(self.q2):
            found += f"; at runs left out the surrogate leaves {_share_text(1 - self.q2)}"
        return found

    def to_groups(self) -> tuple[xr.Dataset, xr.Dataset]:
        """Return its group of an archive, and that of its diagnostics."""
        numbers = np.arange(1, self.components.count + 1)
        described = {"units": "1", "long_name": "number of the component"}
        coordinates = {
            PRINCIPAL_COMPONENT: (PRINCIPAL_COMPONENT, numbers, described),
            **field_coordinates(self.output.dims),
        }
        attributes = {
            **describe(self.output, "of_"),
            "training_minimum": self.smallest,
            "training_maximum": self.largest,
            FIT_TEXT: self.text,
        }
        if self.check is not None:
            attributes |= {
                "check_runs": self.check.runs,
                "check_left": self.check.left,
                "check_truncation": self.check.truncation,
            }
        q2 = math.nan if self.check is None else 1 - self.check.left
        diagnostics = [
            Diagnostic("components", self.components.count, "components"),
            Diagnostic("truncation", self.components.truncation, "truncation"),
            Diagnostic("q2", self.q2, "Q², runs left out"),
            Diagnostic("check_q2_of_output", q2, "Q², check runs"),
        ]
        found = xr.Dataset(dict(self._variables()), coordinates, attributes)
        return found, diagnostics_dataset(diagnostics)

    def _variables(self) -> Iterator[tuple[str, tuple[Any, ...]]]:
        parts, output = self.components, self.output
        unit, title = output.unit, output.title
        square = unit if unit == DIMENSIONLESS else f"({unit})2"
        yield "mean_field", self._along(parts.mean, unit, f"mean of {title} in the training runs")
        yield "grid_weight", self._along(parts.weights, "1", "weight in the mean over the field")
        left = "variance in the training runs that the components leave"
        yield "truncated_variance", self._along(parts.truncated, square, left)
        described = {"units": "1", "long_name": f"principal components of {title}"}
        dims = (PRINCIPAL_COMPONENT, *(each.name for each in output.dims))
        yield "component_field", (dims, parts.components.reshape(-1, *output.shape), described)
        described = {"units": square, "long_name": "variance of the scores in the training runs"}
        yield "score_variance", (PRINCIPAL_COMPONENT, parts.variances, described)
        if self.check is not None:
            yield "check_q2", self._along(self.check.q2, "1", "Q² at each place, check runs")

    def _along(self, values: FloatArray, unit: str, title: str) -> tuple[Any, ...]:
        dims = [each.name for each in self.output.dims]
        return dims, values.reshape(self.output.shape), {"units": unit, "long_name": title}

    @classmethod
    def from_group(cls, name: str, group: xr.DataTree) -> FieldFit:
        """Restore the fit to a field from its groups."""
        dataset, attributes = group.to_dataset(inherit=False), group.attrs
        dims = tuple(_dimension(dataset[name]) for name in dataset["mean_field"].dims)
        values = {
            key: np.asarray(dataset[key].values, dtype=np.float64) for key in dataset.data_vars
        }
        found = {
            str(key): float(each.values)
            for key, each in group.children[DIAGNOSTICS].data_vars.items()
        }
        check = None
        if "check_q2" in values:
            left, truncation = (float(attributes[f"check_{key}"]) for key in ("left", "truncation"))
            runs, q2 = int(attributes["check_runs"]), values["check_q2"].ravel()
            check = FieldCheck(runs, left, truncation, q2)
        return cls(
            output=Output(name, *description(attributes, "of_"), dims=dims),
            components=PrincipalComponents(
                weights=values["grid_weight"].ravel(),
                mean=values["mean_field"].ravel(),
                components=values["component_field"].reshape(len(values["component_field"]), -1),
                variances=values["score_variance"],
                truncated=values["truncated_variance"].ravel(),
            ),
            smallest=float(attributes["training_minimum"]),
            largest=float(attributes["training_maximum"]),
            q2=found["q2"],
            check=check,
        )


def _known_share(share: float) -> float:
    return float(share) if not share <= _ROUNDING else 0.0


def _share_text(share: float) -> str:
    return f"{share:.2g}" if share > _ROUNDING else "none"


def _dimension(coordinate: xr.DataArray) -> Dimension:
    values = tuple(map(float, coordinate.values))
    return Dimension(str(coordinate.name), *description(coordinate.attrs), values=values)
