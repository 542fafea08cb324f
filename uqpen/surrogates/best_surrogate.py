"""Surrogate of the kind that best predicts runs left out, chosen for each output by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN, STATUS
from uqpen.core.lookup import resolve
from uqpen.core.model import Model
from uqpen.core.settings import name
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.chosen_surrogates import ChosenSurrogates
from uqpen.surrogates.cross_fitting import CrossFit, cross_fit
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.surrogates.model_race import ModelRace
from uqpen.surrogates.output_surrogate import training_record
from uqpen.surrogates.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.principal_components import DEFAULT_COMPONENTS, components_setting
from uqpen.surrogates.surrogate import Surrogate
from uqpen.surrogates.training import TrainingRuns, known_inputs

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["BestSurrogate", "FixedChoice"]

_EXPANSION, _LOGARITHM, _PROCESS = "polynomial-chaos", "polynomial-chaos-log", "gaussian-process"

_ABSENT = "no kind of surrogate could be fitted to all parts of the runs"


@dataclass(frozen=True)
class BestSurrogate(Surrogate):
    """Race of polynomial chaos, polynomial chaos of the logarithm, and a Gaussian process.

    Each predicts the runs of folds that it has not seen. For each output, the one with the least
    mean square error there is fitted to all runs.

    Parameters
    ----------
    design : str
        The design whose runs it is fitted to; a sample.
    check : str, optional
        A design whose runs show how good it is.
    components : float or int
        The principal components of a field that are kept: the share of its variance that they have
        at least, or their number.
    """

    design: str = name()
    check: str | None = name(default=None)
    components: float = components_setting()

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> ChosenSurrogates:
        """Fit the best kind to every output that has numbers; see `Surrogate.fit`."""
        training = TrainingRuns.from_runs(runs, model, joint)
        reasons = {each.name: training.output_problem(each) for each in model.all_outputs}
        outputs = [output for output, reason in reasons.items() if not reason]
        candidates = _candidates(self, training, outputs)
        fits = {
            kind: cross_fit(each, name, runs, model, joint, stream)
            for kind, each in candidates.items()
        }
        predictions = {kind: _predictions(each, runs, outputs) for kind, each in fits.items()}
        races = {}
        for output in outputs:
            found = {kind: each[output] for kind, each in predictions.items() if output in each}
            if found:
                races[output] = ModelRace.of_predictions(training.outputs[output], found)
            else:
                reasons[output] = next((each.reason for each in fits.values()), "") or _ABSENT
        chosen = FixedChoice(self.design, {key: race.winner for key, race in races.items()})
        fitted = chosen.fit(name, runs, model, joint, stream)
        failed = {**{key: text for key, text in reasons.items() if text}, **fitted.reasons}
        return replace(fitted, races=races, reasons=failed)

    def for_refits(self, fitted: FittedSurrogate) -> Surrogate:
        """Return settings with the choice of a fit, so that there is no other race."""
        choice = fitted.choice if isinstance(fitted, ChosenSurrogates) else {}
        return FixedChoice(self.design, choice, components=self.components)

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> ChosenSurrogates:
        """Restore the surrogates that won; see `Surrogate.restore`."""
        return ChosenSurrogates.from_tree(tree, name, original)


@dataclass(frozen=True)
class FixedChoice(Surrogate):
    """Surrogate with a given kind for each output.

    Parameters
    ----------
    design : str
        The design whose runs it is fitted to.
    choice : mapping of str to str
        By output; others are not fitted.
    """

    design: str
    choice: Mapping[str, str]
    check: str | None = None
    components: float = DEFAULT_COMPONENTS

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> ChosenSurrogates:
        """Fit each output by its kind; see `Surrogate.fit`."""
        training = TrainingRuns.from_runs(runs, model, joint)
        members = {
            kind: each.fit(name, runs, model, joint, stream)
            for kind, each in _candidates(self, training, list(self.choice)).items()
            if kind in self.choice.values()
        }
        found = {
            output: members[kind].reasons.get(output, "") for output, kind in self.choice.items()
        }
        return ChosenSurrogates(
            name=name,
            inputs=known_inputs(model, joint),
            outputs=tuple(each for each in model.all_outputs if found.get(each.name) == ""),
            members=members,
            choice={output: kind for output, kind in self.choice.items() if not found[output]},
            reasons={output: reason for output, reason in found.items() if reason},
            fixed=training.fixed,
            training=training_record(self, training, joint),
            original=model,
        )

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> ChosenSurrogates:
        """Restore the surrogates; see `Surrogate.restore`."""
        return ChosenSurrogates.from_tree(tree, name, original)


def _candidates(
    surrogate: Surrogate, training: TrainingRuns, outputs: list[str]
) -> dict[str, Surrogate]:
    """Return the settings of each kind, all of them automatic."""
    positive = [output for output in outputs if (training.outputs[output] > 0).all()]
    logarithm = PolynomialChaos(surrogate.design, transform=dict.fromkeys(positive, "log"))
    return {
        _EXPANSION: PolynomialChaos(surrogate.design),
        **({_LOGARITHM: logarithm} if positive else {}),
        _PROCESS: resolve(SURROGATES[_PROCESS])(design=surrogate.design),
    }


def _predictions(found: CrossFit, runs: xr.Dataset, outputs: list[str]) -> dict[str, FloatArray]:
    """Return the predictions at the completed runs by the fits that have not seen them."""
    completed = np.flatnonzero(runs[STATUS].values == Status.OK)
    fold = found.fold[completed]
    values: dict[str, FloatArray] = {}
    for output in outputs:
        if not found.models or any(output in model.reasons for model in found.models):
            continue
        values[output] = np.empty(len(completed))
    for number, model in enumerate(found.models):
        at = np.flatnonzero(fold == number)
        inputs, _ = model.completed_runs(runs.isel({RUN: completed[at]}))
        predicted = model.predict(inputs)
        for output, array in values.items():
            array[at] = predicted[output].mean
    return values
