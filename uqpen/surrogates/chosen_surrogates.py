"""Fitted surrogate whose outputs are predicted by surrogates of several sorts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self, cast

import numpy as np
import xarray as xr

from uqpen.archive.groups import read_group
from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.labels import NOT_FITTED
from uqpen.core.lookup import resolve
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.diagnostics import DIAGNOSTICS, diagnostics_dataset, shown_diagnostics
from uqpen.surrogates.field_fit import FIT_TEXT
from uqpen.surrogates.fitted_surrogate import (
    ClosedForms,
    FittedSurrogate,
    InputShares,
    Prediction,
)
from uqpen.surrogates.model_race import ModelRace
from uqpen.surrogates.storage import unfitted_outputs
from uqpen.surrogates.training_record import TrainingRecord

__all__ = ["ChosenSurrogates"]

KIND = "best"
_CHOSEN = "chosen_kind"

_NO_CLOSED_FORM = "its kind, {kind}, has no closed forms"


@dataclass(frozen=True, eq=False)
class ChosenSurrogates(FittedSurrogate, ClosedForms):
    """Surrogates of several sorts; each predicts some outputs.

    Parameters
    ----------
    name : str
        Its name in the study.
    inputs : tuple of Input
        Those of the model that it stands for.
    outputs : tuple of Output
        Those that could be fitted.
    members : mapping of str to FittedSurrogate
        By kind. They may predict other outputs as well.
    choice : mapping of str to str
        The kind of each output.
    reasons, fixed, original
        As in `FittedSurrogate`.
    training : TrainingRecord
        The runs that it was fitted to.
    races : mapping of str to ModelRace
        By output, why that kind.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    members: Mapping[str, FittedSurrogate]
    choice: Mapping[str, str]
    reasons: Mapping[str, str]
    fixed: Mapping[str, float]
    training: TrainingRecord
    original: Model | None = None
    races: Mapping[str, ModelRace] = field(default_factory=dict)

    @property
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""
        return self.training.random_inputs

    @property
    def logarithms(self) -> frozenset[str]:
        """Outputs that were fitted as their logarithm."""
        return frozenset(each for each in self.choice if each in self._member(each).logarithms)

    def _member(self, output: str) -> FittedSurrogate:
        return self.members[self.choice[output]]

    def predict(self, inputs: Arrays) -> dict[str, Prediction]:
        """Predict its outputs; see `FittedSurrogate.predict`."""
        found = {kind: self.members[kind].predict(inputs) for kind in set(self.choice.values())}
        return {each.name: found[self.choice[each.name]][each.name] for each in self.outputs}

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the predicted values without their deviations; see `Model.evaluate`."""
        kinds, runs = set(self.choice.values()), len(inputs[self.random_inputs[0]])
        found = {kind: self.members[kind].evaluate(inputs).outputs for kind in kinds}
        values = {each.name: found[self.choice[each.name]][each.name] for each in self.outputs}
        return Results(values, np.full(runs, Status.OK, dtype=np.int8))

    def training_range(self, output: str) -> tuple[float, float]:
        """Return the smallest and the largest value of an output in the training runs."""
        return self._member(output).training_range(output)

    def with_check(self, runs: xr.Dataset) -> Self:
        """Return a copy with its prediction errors at runs that it was not fitted to."""
        members = {kind: each.with_check(runs) for kind, each in self.members.items()}
        return replace(self, members=members)

    def identity(self) -> dict[str, str]:
        """Return the identity of each member."""
        return {
            f"{kind}_{key}": text
            for kind, each in self.members.items()
            for key, text in each.identity().items()
        } | {"name": self.name}

    def to_tree(self) -> xr.DataTree:
        """Return the group of an archive; see `FittedSurrogate.to_tree`.

        Each member has the group of its kind. That is no name of an output, as it has a hyphen.
        """
        groups = {
            "/": xr.Dataset(
                attrs={
                    "kind": KIND,
                    "design": self.training.design,
                    "outputs": " ".join(self.choice),
                    **self.training.attributes(),
                }
            ),
            "/input": self.training.input_dataset(self.inputs, self.fixed),
        }
        for kind, member in self.members.items():
            tree = member.to_tree()
            for node in tree.subtree:
                groups[f"/{kind}{node.path}".rstrip("/")] = node.to_dataset(inherit=False)
            for output in (each for each, chosen in self.choice.items() if chosen == kind):
                own = shown_diagnostics(tree.children[output])
                race = self.races.get(output)
                text = {FIT_TEXT: race.text} if race else {}
                groups[f"/{output}"] = xr.Dataset(attrs={_CHOSEN: kind, **text})
                every = [*own, *(race.diagnostics() if race else ())]
                groups[f"/{output}/{DIAGNOSTICS}"] = diagnostics_dataset(every)
        for output, reason in self.reasons.items():
            groups[f"/{output}"] = xr.Dataset(attrs={NOT_FITTED: reason})
        return xr.DataTree.from_dict(groups)

    @classmethod
    def from_tree(cls, tree: xr.DataTree, name: str, original: Model | None) -> Self:
        """Restore it from `to_tree`."""
        group = read_group(tree, "input")
        inputs, fixed = TrainingRecord.read_inputs(group)
        members = {
            str(kind): resolve(SURROGATES[str(each.attrs["kind"])]).restore(each, name, original)
            for kind, each in tree.children.items()
            if "-" in str(kind)
        }
        names = str(tree.attrs["outputs"]).split()
        choice = {output: str(tree.children[output].attrs[_CHOSEN]) for output in names}
        known = {key: {each.name: each for each in m.outputs} for key, m in members.items()}
        races = {}
        for output in names:
            found = shown_diagnostics(tree.children[output])
            if FIT_TEXT in tree.children[output].attrs:
                values = {each.name: each.value for each in found}
                races[output] = ModelRace.from_diagnostics(choice[output], values)
        return cls(
            name=name,
            inputs=original.inputs if original else inputs,
            outputs=tuple(known[choice[output]][output] for output in names),
            members=members,
            choice=choice,
            reasons=unfitted_outputs(tree),
            fixed=fixed,
            training=TrainingRecord.from_attributes(tree.attrs, group),
            original=original,
            races=races,
        )

    # Closed forms are those of the member of an output, where it has any.

    @property
    def estimator(self) -> str:
        """Name of the estimator."""
        members = (each for each in self.members.values() if isinstance(each, ClosedForms))
        return next((each.estimator for each in members), "")

    def closed_form_problem(self, output: str) -> str:
        """Return why an output's moments and indices cannot follow; empty if they can."""
        member = self._member(output)
        if isinstance(member, ClosedForms):
            return member.closed_form_problem(output)
        return _NO_CLOSED_FORM.format(kind=self.choice[output])

    def closed_form_moments(self, output: str) -> tuple[float, float]:
        """Return mean and standard deviation of the variable that was fitted."""
        return self._closed_forms(output).closed_form_moments(output)

    def closed_form_indices(self, output: str) -> InputShares:
        """Return the indices of the variable that was fitted."""
        return self._closed_forms(output).closed_form_indices(output)

    def closed_form_terms(self, outputs: Sequence[str]) -> tuple[IntArray, FloatArray] | None:
        """Return the terms of outputs of one kind; None for others."""
        members = {self.choice[output] for output in outputs}
        if len(members) > 1 or any(map(self.closed_form_problem, outputs)):
            return None
        return self._closed_forms(outputs[0]).closed_form_terms(outputs)

    def closed_form_parts(
        self, output: str, inputs: Arrays
    ) -> tuple[FloatArray, FloatArray] | None:
        """Return what each input adds to an output; see `ClosedForms.closed_form_parts`."""
        if self.closed_form_problem(output):
            return None
        return self._closed_forms(output).closed_form_parts(output, inputs)

    def _closed_forms(self, output: str) -> ClosedForms:
        return cast(ClosedForms, self._member(output))
