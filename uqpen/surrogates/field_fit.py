"""Fit to a field: its principal components, and how much of its variance a surrogate leaves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.labels import PRINCIPAL_COMPONENT, QUADRATURE_WEIGHT, RUN, STATUS
from uqpen.core.model import Dimension, Input, Model, Output, Results
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
from uqpen.surrogates.ending_curves import END, EndingComponents, has_ends
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.principal_components import ROUNDING, PrincipalComponents, share_text
from uqpen.surrogates.training import size_problem

# A model with the scores of its fields in their place: scalars, which any surrogate fits.


@dataclass(frozen=True, eq=False)
class ScoreModel(Model):
    """Model whose outputs are those of another one, with scores in place of its fields."""

    original: Model  # with fields
    # Those of each field; a field without any is left out.
    components: Mapping[str, PrincipalComponents]
    has_scalars: bool = True  # whether the scalar outputs are among its own

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
                found += [output] * self.has_scalars
            elif output.name in self.components:
                found.extend(self.components[output.name].score_outputs(output))
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
    found = {
        name: each.scores(fields[name].reshape(len(fields[name]), -1))
        for name, each in components.items()
    }
    return {
        key: score
        for name, each in components.items()
        for key, score in zip(each.names(name), found[name].T, strict=True)
    }


def field_components(
    output: Output, runs: xr.Dataset, wanted: float, *, is_scaled: bool = False
) -> PrincipalComponents | str:
    """Find the components of a field over the completed runs of a design.

    The result is the reason where that is not possible. `wanted` is as `PrincipalComponents`
    takes it. Of curves that end, the components are up to the place that all reach, or along the
    coordinate scaled by the end of each.
    """
    completed = runs[STATUS].values == Status.OK
    if not completed.any():
        return "none of its runs came back"
    values = runs[output.name].values[completed].astype(np.float64)
    if (values == values[0]).all():
        return "it does not vary: it is the same in every run"
    ends = output.may_end and has_ends(values)
    if not ends and (problem := size_problem(values)):
        return problem
    weights = None
    if QUADRATURE_WEIGHT in runs.coords:
        weights = runs[QUADRATURE_WEIGHT].values[completed]
        # Sparse grids and rules with lost nodes are no distribution of runs.
        weights = weights if completed.all() and (weights > 0).all() else None
    if ends:
        return EndingComponents.of_curves(output, values, wanted, weights, is_scaled=is_scaled)
    matrix = values.reshape(len(values), -1)
    return PrincipalComponents.of_runs(matrix, output.place_weights, wanted, weights)


# Attribute of the group of a field: what the components and the surrogate leave, in words.
FIT_TEXT = "fit"


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
        fields, weights = components.fields(scores), components.place_weights
        known = np.isfinite(truth) & np.isfinite(fields) & np.isfinite(projected)
        q2 = np.full(truth.shape[1], math.nan)
        # Curves have ended where a value is not known.
        compared = np.flatnonzero(known.sum(axis=0) >= 2)
        if not known.all():
            truth = np.where(known, truth, math.nan)
        truth, weights = truth[:, compared], weights[compared]
        errors, rest = ((truth - each[:, compared]) ** 2 for each in (fields, projected))
        with np.errstate(all="ignore"):
            variances = np.nanvar(truth, axis=0, ddof=1)
            whole = weights @ variances
            errors, rest = (np.nanmean(each, axis=0) for each in (errors, rest))
            q2[compared] = np.where(variances > 0, 1 - errors / variances, math.nan)
            return cls(
                runs=len(truth),
                left=_known_share(weights @ errors / whole),
                truncation=_known_share(weights @ rest / whole),
                q2=q2,
            )


@dataclass(frozen=True, eq=False)
class FieldFit:
    """Principal components of a field, whose scores a surrogate predicts."""

    output: Output  # the field
    components: PrincipalComponents
    smallest: float  # least value of the field in the training runs
    largest: float  # largest value there
    q2: float = math.nan  # share of the variance predicted at training runs left out, if known
    end_q2: float = math.nan  # that of the end of curves that end
    check: FieldCheck | None = None

    @classmethod
    def of_runs(cls, output: Output, components: PrincipalComponents, runs: xr.Dataset) -> FieldFit:
        """Describe a field by its components and its training runs."""
        completed = runs[output.name].values[runs[STATUS].values == Status.OK]
        return cls(output, components, float(np.nanmin(completed)), float(np.nanmax(completed)))

    @property
    def scores(self) -> list[str]:
        """Names of the scores as outputs."""
        return self.names[: self.components.count]

    @property
    def names(self) -> list[str]:
        """Names of the scores and, of curves that end, of the end."""
        return self.components.names(self.output.name)

    @property
    def end(self) -> Output | None:
        """The end of curves that end, as an output; None where it does not vary."""
        every = self.components.score_outputs(self.output)
        found = next(islice(every, self.components.count, None), None)
        return found and replace(found, name=f"{self.output.name}_{END}")

    def prediction(self, scores: Mapping[str, Prediction]) -> Prediction:
        """Return the prediction of the field from those of its scores.

        Standard deviations are of independent errors of the scores, and contain the truncation.
        """
        means = {name: scores[name].mean for name in self.names}
        mean = self.fields(means)
        deviations = [each.std for name in self.names if (each := scores[name]).std is not None]
        if len(deviations) < len(self.names):
            return Prediction(mean)
        variances = self.components.field_variances(
            np.column_stack([*means.values()]), np.column_stack(deviations)
        )
        return Prediction(mean, np.sqrt(variances).reshape(mean.shape))

    def fields(self, scores: Mapping[str, FloatArray]) -> FloatArray:
        """Return the fields of scores by name, shape (run, *dims)."""
        found = self.components.fields(np.column_stack([scores[name] for name in self.names]))
        return found.reshape(-1, *self.output.shape)

    def with_q2_of_scores(self, q2: Mapping[str, float]) -> FieldFit:
        """Return it with the Q² of the field at runs left out, from those of its scores."""
        known = np.array([q2.get(name, math.nan) for name in self.scores])
        found = float(known @ self.components.variances / self.components.variance)
        end = q2.get(self.names[-1], math.nan) if self.end else math.nan
        if isinstance(self.components, EndingComponents):
            stated = self.components.left
            found = found if math.isnan(stated) else 1 - stated
        return replace(self, q2=found, end_q2=end)

    def with_check(self, scores: Mapping[str, FloatArray], truth: FloatArray) -> FieldFit:
        """Return it with its errors at other runs, of shape (run, *dims)."""
        found = np.column_stack([scores[name] for name in self.names])
        check = FieldCheck.of_runs(self.components, found, truth.reshape(len(truth), -1))
        return replace(self, check=check)

    @property
    def text(self) -> str:
        """Sentence on the share of the variance that the components and the surrogate leave."""
        count, truncation = self.components.count, self.components.truncation
        verb = "component leaves" if count == 1 else "components leave"
        found = f"{count} principal {verb} {share_text(truncation)} of the variance of the field"
        if truncation > ROUNDING:
            found += f" ({100 * math.sqrt(truncation):.2g} % of its standard deviation)"
        found += self.components.text
        check = self.check
        if check is not None and math.isfinite(check.left):
            found += f"; at {check.runs} check runs the surrogate leaves {share_text(check.left)}"
            if check.left > ROUNDING:
                share = 100 * check.truncation / check.left
                found += f", {share:.0f} % of that by the truncation"
        elif math.isfinite(self.q2):
            found += f"; at runs left out the surrogate leaves {share_text(1 - self.q2)}"
        return found

    def to_groups(self) -> tuple[xr.Dataset, xr.Dataset]:
        """Return its group of an archive, and that of its diagnostics."""
        numbers = np.arange(1, self.components.count + 1)
        described = {"units": "1", "long_name": "number of the component"}
        coordinates = {
            PRINCIPAL_COMPONENT: (PRINCIPAL_COMPONENT, numbers, described),
            **field_coordinates(dict.fromkeys((*self._dims, *self.output.dims))),
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
        if isinstance(self.components, EndingComponents):
            attributes |= self.components.attributes()
            diagnostics.append(Diagnostic("end_q2", self.end_q2, "Q² of the end, runs left out"))
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
        dims = (PRINCIPAL_COMPONENT, *(each.name for each in self._dims))
        components = self._whole(parts.components).reshape(-1, *self._shape)
        yield "component_field", (dims, components, described)
        described = {"units": square, "long_name": "variance of the scores in the training runs"}
        yield "score_variance", (PRINCIPAL_COMPONENT, parts.variances, described)
        if self.check is not None:
            described = {"units": "1", "long_name": "Q² at each place, check runs"}
            whole = [each.name for each in output.dims]
            yield "check_q2", (whole, self.check.q2.reshape(output.shape), described)

    @property
    def _dims(self) -> tuple[Dimension, ...]:
        """The dimensions of the components in an archive."""
        if isinstance(self.components, EndingComponents):
            return self.components.archived_dims(self.output)
        return self.output.dims

    @property
    def _shape(self) -> tuple[int, ...]:
        return tuple(len(each.values) for each in self._dims)

    def _whole(self, values: FloatArray) -> FloatArray:
        """Return what the components have at each place as an archive has it."""
        parts = self.components
        return parts.archived(values) if isinstance(parts, EndingComponents) else values

    def _along(self, values: FloatArray, unit: str, title: str) -> tuple[Any, ...]:
        dims = [each.name for each in self._dims]
        found = self._whole(values).reshape(self._shape)
        return dims, found, {"units": unit, "long_name": title}

    @classmethod
    def from_group(cls, name: str, group: xr.DataTree) -> FieldFit:
        """Restore the fit to a field from its groups."""
        dataset, attributes = group.to_dataset(inherit=False), group.attrs
        dims = tuple(_dimension(dataset[name]) for name in dataset["mean_field"].dims)
        values = {
            key: np.asarray(dataset[key].values, dtype=np.float64) for key in dataset.data_vars
        }
        diagnostics = group.children[DIAGNOSTICS].data_vars
        found = {str(key): float(each.values) for key, each in diagnostics.items()}
        check = None
        if "check_q2" in values:
            left, truncation = (float(attributes[f"check_{key}"]) for key in ("left", "truncation"))
            runs, q2 = int(attributes["check_runs"]), values["check_q2"].ravel()
            check = FieldCheck(runs, left, truncation, q2)
        components = PrincipalComponents(
            weights=values["grid_weight"].ravel(),
            mean=values["mean_field"].ravel(),
            components=values["component_field"].reshape(len(values["component_field"]), -1),
            variances=values["score_variance"],
            truncated=values["truncated_variance"].ravel(),
        )
        if is_ending := EndingComponents.is_described(attributes):
            whole = (name for name in dataset.coords if name != PRINCIPAL_COMPONENT)
            every = [_dimension(dataset[name]) for name in whole]
            components, dims = EndingComponents.restored(components, attributes, dims[0], every)
        return cls(
            output=Output(name, *description(attributes, "of_"), dims=dims, may_end=is_ending),
            components=components,
            smallest=float(attributes["training_minimum"]),
            largest=float(attributes["training_maximum"]),
            q2=found["q2"],
            end_q2=found.get("end_q2", math.nan),
            check=check,
        )


def _known_share(share: float) -> float:
    return float(share) if not share <= ROUNDING else 0.0


def _dimension(coordinate: xr.DataArray) -> Dimension:
    values = tuple(map(float, coordinate.values))
    return Dimension(str(coordinate.name), *description(coordinate.attrs), values=values)
