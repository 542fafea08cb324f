"""Surrogate of a model with fields: it predicts their scores, and puts the fields together."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import xarray as xr

from uqpen.core.arrays import Arrays
from uqpen.core.labels import NOT_FITTED
from uqpen.core.model import Input, Model, Output, Results
from uqpen.surrogates.diagnostics import DIAGNOSTICS, shown_diagnostics
from uqpen.surrogates.field_fit import FieldFit, ScoreModel, field_components, scored_runs
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.principal_components import PrincipalComponents, score_name
from uqpen.surrogates.surrogate import Surrogate


@dataclass(frozen=True, eq=False)
class FieldSurrogate(FittedSurrogate):
    """Surrogate that predicts fields by the scores of their principal components."""

    name: str  # its name in the study
    inputs: tuple[Input, ...]  # those of the model that it stands for
    outputs: tuple[Output, ...]  # those that could be fitted
    scalars: FittedSurrogate  # a surrogate of any kind, of the scalar outputs and of the scores
    fields: Mapping[str, FieldFit]  # the components of each field
    reasons: Mapping[str, str]  # as in `FittedSurrogate`
    fixed: Mapping[str, float]  # as in `FittedSurrogate`
    original: Model | None = None  # as in `FittedSurrogate`

    @property
    def random_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that varied in the training runs."""
        return self.scalars.random_inputs

    @property
    def without_fields(self) -> FittedSurrogate:
        """The surrogate of its scalar outputs, and of the scores of its fields."""
        return self.scalars

    @property
    def logarithms(self) -> frozenset[str]:
        """Outputs that were fitted as their logarithm."""
        return self.scalars.logarithms

    def predict(self, inputs: Arrays) -> dict[str, Prediction]:
        """Predict its outputs, fields in shape (run, *dims); see `FittedSurrogate.predict`."""
        found = self.scalars.predict(inputs)
        fields = {name: each.prediction(found) for name, each in self.fields.items()}
        ends = {end.name: found[score] for score, end in self.ends.items()}
        return ends | {
            each.name: fields.get(each.name) or found[each.name] for each in self.outputs
        }

    @property
    def ends(self) -> dict[str, Output]:
        """The ends of its curves that end, as outputs, by the names of their scores."""
        known = {output.name for output in self.outputs}
        found = {each.names[-1]: end for each in self.fields.values() if (end := each.end)}
        return {score: end for score, end in found.items() if end.name not in known}

    def evaluate(self, inputs: Arrays) -> Results:
        """Return the predicted values without their deviations; see `Model.evaluate`."""
        scalars = self.scalars.evaluate(inputs)
        fields = {name: each.fields(scalars.outputs) for name, each in self.fields.items()}
        values = {**scalars.outputs, **fields}
        return Results({each.name: values[each.name] for each in self.outputs}, scalars.status)

    def training_range(self, output: str) -> tuple[float, float]:
        """Return the smallest and the largest value of an output in the training runs."""
        if output in self.fields:
            return self.fields[output].smallest, self.fields[output].largest
        return self.scalars.training_range(output)

    def with_check(self, runs: xr.Dataset) -> Self:
        """Return a copy with its prediction errors at runs that it was not fitted to."""
        inputs, completed = self.completed_runs(runs)
        predicted = self.scalars.evaluate(inputs).outputs
        fields = {
            name: each.with_check(predicted, completed[name].values.astype(np.float64))
            for name, each in self.fields.items()
        }
        scored = scored_runs(runs, {name: each.components for name, each in self.fields.items()})
        return replace(self, scalars=self.scalars.with_check(scored), fields=fields)

    def identity(self) -> dict[str, str]:
        """Return the identity of the surrogate of the scores, and a hash of the components."""
        digest = hashlib.sha256()
        for each in self.fields.values():
            digest.update(each.components.mean.tobytes() + each.components.components.tobytes())
        return {**self.scalars.identity(), "components_sha256": digest.hexdigest()}

    def to_tree(self) -> xr.DataTree:
        """Return the group of an archive; see `FittedSurrogate.to_tree`.

        The group of a field has its components, and a group for the fit to each of their scores.
        """
        groups = _moved(self.scalars.to_tree(), _paths(self.fields))
        outputs = " ".join(output.name for output in self.outputs)
        groups["/"] = groups["/"].assign_attrs(outputs=outputs)
        for name, each in self.fields.items():
            groups[f"/{name}"], groups[f"/{name}/{DIAGNOSTICS}"] = each.to_groups()
        for output, reason in self.reasons.items():
            groups[f"/{output}"] = xr.Dataset(attrs={NOT_FITTED: reason})
        return xr.DataTree.from_dict(groups)

    @classmethod
    def from_tree(
        cls,
        tree: xr.DataTree,
        name: str,
        original: Model | None,
        kind: type[Surrogate] = Surrogate,
    ) -> Self:
        """Restore it from `to_tree`; its scores are predicted by a surrogate of some kind."""
        outputs = str(tree.attrs["outputs"]).split()
        fields = {
            output: FieldFit.from_group(output, tree.children[output])
            for output in outputs
            if _is_field(tree.children[output])
        }
        groups = _moved(tree, {path: score for score, path in _paths(fields).items()})
        for output in fields:
            del groups[f"/{output}"], groups[f"/{output}/{DIAGNOSTICS}"]
        scalars = [
            each for key in outputs for each in (fields[key].names if key in fields else [key])
        ]
        groups["/"] = groups["/"].assign_attrs(outputs=" ".join(scalars))
        components = {key: each.components for key, each in fields.items()}
        scored = ScoreModel(original, components) if original else None
        fitted = kind.restore(xr.DataTree.from_dict(groups), name, scored)
        known = {output.name: output for output in fitted.outputs}
        known |= {key: each.output for key, each in fields.items()}
        return cls(
            name=name,
            inputs=fitted.inputs,
            outputs=tuple(known[output] for output in outputs),
            scalars=fitted,
            fields=fields,
            reasons=fitted.reasons,
            fixed=fitted.fixed,
            original=original,
        )


def has_fields(tree: xr.DataTree) -> bool:
    """Check whether the group of a surrogate has the components of a field."""
    return any(map(_is_field, tree.children.values()))


def _is_field(group: xr.DataTree) -> bool:
    return score_name("", 0).removeprefix(".") in group.children


def _paths(fields: Mapping[str, FieldFit]) -> dict[str, str]:
    """Return the path of the group of each score in an archive, by the path of it as an output."""
    scores = (score for each in fields.values() for score in each.names)
    return {f"/{score}": f"/{score.replace('.', '/')}" for score in scores}


def _moved(tree: xr.DataTree, paths: Mapping[str, str]) -> dict[str, xr.Dataset]:
    """Return the groups of a tree, some of them with all below them at other paths."""
    groups = {}
    for node in tree.subtree:
        path = f"/{node.path.removeprefix(tree.path).lstrip('/')}"
        for old, new in paths.items():
            if path == old or path.startswith(f"{old}/"):
                path = new + path.removeprefix(old)
                break
        groups[path] = node.to_dataset(inherit=False)
    return groups


def fit_fields(
    name: str,
    runs: xr.Dataset,
    model: Model,
    wanted: float,
    fit: Callable[[xr.Dataset, Model], FittedSurrogate],
    ending: Mapping[str, PrincipalComponents | str],
) -> FieldSurrogate:
    """Fit a surrogate of any kind to the scalar outputs of a model and to the scores of its fields.

    Parameters
    ----------
    wanted : float or int
        How many components to keep, as `PrincipalComponents.of_runs` takes it.
    fit : callable
        Fits a surrogate to runs of a model with scalar outputs alone.
    ending : mapping of str to PrincipalComponents or str
        The components of curves that may end, or the reasons why there are none.
    """
    found = {
        each.name: ending.get(each.name) or field_components(each, runs, wanted)
        for each in model.all_outputs
        if each.dims
    }
    reasons = {key: each for key, each in found.items() if isinstance(each, str)}
    components = {k: each for k, each in found.items() if isinstance(each, PrincipalComponents)}
    while True:
        scalars = fit(scored_runs(runs, components), ScoreModel(model, components))
        lost = {key: _reason(key, each, scalars) for key, each in components.items()}
        reasons |= {key: reason for key, reason in lost.items() if reason}
        if not any(lost.values()):
            break
        # A field without one of its scores is none: the others are fitted again without it.
        components = {key: each for key, each in components.items() if not lost[key]}
    groups = scalars.to_tree().children
    q2 = {
        str(key): each.value
        for key, group in groups.items()
        for each in (shown_diagnostics(group) if key in {o.name for o in scalars.outputs} else ())
        if each.name == "q2"
    }
    fields = {
        key: FieldFit.of_runs(model.output(key), each, runs).with_q2_of_scores(q2)
        for key, each in components.items()
    }
    known = {output.name for output in scalars.outputs} | fields.keys()
    return FieldSurrogate(
        name=name,
        inputs=scalars.inputs,
        outputs=tuple(output for output in model.all_outputs if output.name in known),
        scalars=scalars,
        fields=fields,
        reasons={**scalars.reasons, **reasons},
        fixed=scalars.fixed,
        original=model,
    )


def _reason(field: str, components: PrincipalComponents, scalars: FittedSurrogate) -> str:
    """Return why one of the scores of a field could not be fitted; empty if all could."""
    for number, name in enumerate(components.names(field)):
        reason = scalars.reasons.get(name)
        if reason:
            what = f"principal component {number + 1}" if number < components.count else "its end"
            return f"{what}: {reason}"
    return ""
