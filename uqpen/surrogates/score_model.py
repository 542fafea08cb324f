"""A model with the scores of its fields in their place: scalars, which any surrogate fits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.labels import QUADRATURE_WEIGHT, RUN, STATUS
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.surrogates.principal_components import PrincipalComponents
from uqpen.surrogates.training import size_problem

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ScoreModel", "field_components", "score_name", "scored_runs"]

# No name of an output has a dot.
_SCORE = ".score_"


def score_name(output: str, number: int) -> str:
    """Return the name of the score of a component, counted from 0."""
    return f"{output}{_SCORE}{number + 1}"


@dataclass(frozen=True, eq=False)
class ScoreModel(Model):
    """Model whose outputs are those of another one, with scores in place of its fields.

    Parameters
    ----------
    original : Model
        A model with fields.
    components : mapping of str to PrincipalComponents
        Those of each field; a field without any is left out.
    """

    original: Model
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
        return tuple(each for output in self.original.all_outputs for each in self._scalars(output))

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the results of the original model with scores; see `Model.evaluate`."""
        results = self.original.evaluate(inputs)
        outputs = self.original.derive(results.outputs, results.status)
        fields = {output.name for output in self.original.outputs if output.dims}
        scalars = {name: values for name, values in outputs.items() if name not in fields}
        return replace(results, outputs=scalars | _scores(outputs, self.components))

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        """Yield the conditions of the original model."""
        return self.original.conditions(inputs)

    def identity(self) -> dict[str, str]:
        """Return the identity of the original model."""
        return self.original.identity()

    def _scalars(self, output: Output) -> Iterator[Output]:
        if not output.dims:
            yield output
        elif output.name in self.components:
            for number in range(self.components[output.name].count):
                title = f"score {number + 1} of {output.title}"
                yield Output(score_name(output.name, number), output.unit, title)


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
