"""Surrogate of the kind that best predicts runs left out, chosen for each output by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self, cast

import numpy as np
import xarray as xr

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.lookup import resolve
from uqpen.core.model import Model
from uqpen.core.settings import name
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos, label_problem
from uqpen.surrogates.diagnostics import (
    DIAGNOSTICS,
    Diagnostic,
    diagnostics_dataset,
    quality_text,
    shown_diagnostics,
)
from uqpen.surrogates.field_fit import FIT_TEXT
from uqpen.surrogates.fitted_surrogate import (
    ClosedForms,
    FittedSurrogate,
    InputShares,
    Prediction,
)
from uqpen.surrogates.fitting import cross_fit
from uqpen.surrogates.surrogate import Surrogate, components_setting
from uqpen.surrogates.training import TrainedSurrogate, TrainingRuns

# A race of several surrogates by cross-validation: how far the best one leads.

# A lead is beyond the noise above this number of its standard errors.
_STANDARD_ERRORS = 2


@dataclass(frozen=True)
class ModelRace:
    """Errors of several surrogates of one output at the same runs, which none of them has seen."""

    winner: str  # the candidate with the least mean square error
    # Share of the variance that each candidate predicts, the best one first.
    q2: Mapping[str, float]
    lead: float = math.nan  # q² of the winner minus that of the next one; NaN without a second
    lead_error: float = math.nan  # standard error of the lead, over the runs; NaN without a second

    @classmethod
    def of_predictions(cls, values: FloatArray, predictions: Mapping[str, FloatArray]) -> ModelRace:
        """Compare predictions with an output.

        Parameters
        ----------
        values : ndarray, shape (run,)
            Not all the same.
        predictions : mapping of str to ndarray, shape (run,)
            By candidate, one at least.
        """
        variance = float(np.var(values))
        squares = {name: (values - found) ** 2 for name, found in predictions.items()}
        order = sorted(squares, key=lambda name: float(squares[name].mean()))
        q2 = {name: 1 - float(squares[name].mean()) / variance for name in order}
        winner, *others = order
        if not others:
            return cls(winner, q2)
        # Paired, as a run that is hard to predict is so for every candidate.
        more = (squares[others[0]] - squares[winner]) / variance
        error = float(more.std(ddof=1)) / math.sqrt(len(more))
        return cls(winner, q2, float(more.mean()), error)

    @property
    def is_decided(self) -> bool:
        """True if the lead is beyond the noise of the runs."""
        return self.lead > _STANDARD_ERRORS * self.lead_error

    @property
    def text(self) -> str:
        """Sentence on the winner, on the next one and on its lead."""
        (winner, best), *others = self.q2.items()
        start = f"{winner} predicts the runs left out (Q² {quality_text(best)})"
        if not others:
            return f"{start}; no other kind could be fitted"
        name, next_best = others[0]
        lead = f"the lead of {self.lead:.2g} ± {_STANDARD_ERRORS * self.lead_error:.2g}"
        noise = "is beyond the noise" if self.is_decided else "is within the noise"
        return f"{start} better than {name} ({quality_text(next_best)}); {lead} {noise}"

    def diagnostics(self) -> Iterator[Diagnostic]:
        """Yield the Q² of each candidate, and the lead of the winner."""
        for kind, value in self.q2.items():
            title = f"Q² of {kind}, runs left out"
            yield Diagnostic(f"race_q2_{kind.replace('-', '_')}", value, title)
        yield Diagnostic("race_lead", self.lead, "lead in Q²")
        yield Diagnostic("race_lead_error", self.lead_error, "standard error of the lead")

    @classmethod
    def from_diagnostics(cls, winner: str, values: Mapping[str, float]) -> ModelRace:
        """Restore it from its `diagnostics`; `values` are in their order."""
        prefix = "race_q2_"
        q2 = {
            name.removeprefix(prefix).replace("_", "-"): value
            for name, value in values.items()
            if name.startswith(prefix)
        }
        return cls(winner, q2, values["race_lead"], values["race_lead_error"])


# Fitted surrogate whose outputs are predicted by surrogates of several sorts.

KIND = "best"
_CHOSEN = "chosen_kind"

_NO_CLOSED_FORM = "its kind, {kind}, has no closed forms"


@dataclass(frozen=True, eq=False, kw_only=True)
class ChosenSurrogates(TrainedSurrogate, ClosedForms):
    """Surrogates of several sorts; each predicts some outputs."""

    # By kind. They may predict other outputs as well.
    members: Mapping[str, FittedSurrogate]
    choice: Mapping[str, str]  # the kind of each output
    races: Mapping[str, ModelRace] = field(default_factory=dict)  # by output, why that kind

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

    def predict_means(self, inputs: Arrays) -> dict[str, FloatArray]:
        """Predict its outputs without their deviations."""
        kinds = set(self.choice.values())
        found = {kind: self.members[kind].predict_means(inputs) for kind in kinds}
        return {each.name: found[self.choice[each.name]][each.name] for each in self.outputs}

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
        groups: dict[str, xr.Dataset] = {}
        for kind, member in self.members.items():
            tree = member.to_tree()
            for node in tree.subtree:
                groups[f"{kind}{node.path}".rstrip("/")] = node.to_dataset(inherit=False)
            for output in (each for each, chosen in self.choice.items() if chosen == kind):
                own = shown_diagnostics(tree.children[output])
                race = self.races.get(output)
                text = {FIT_TEXT: race.text} if race else {}
                groups[output] = xr.Dataset(attrs={_CHOSEN: kind, **text})
                every = [*own, *(race.diagnostics() if race else ())]
                groups[f"{output}/{DIAGNOSTICS}"] = diagnostics_dataset(every)
        return self._tree(KIND, groups)

    @classmethod
    def from_tree(cls, tree: xr.DataTree, name: str, original: Model | None) -> Self:
        """Restore it from `to_tree`."""
        own = cls._restored(tree, name, original)
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
            **own,
            outputs=tuple(known[choice[output]][output] for output in names),
            members=members,
            choice=choice,
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
        predictions = {kind: each.predictions(runs, outputs) for kind, each in fits.items()}
        races = {}
        for output in outputs:
            found = {kind: each[output] for kind, each in predictions.items() if output in each}
            if found:
                races[output] = ModelRace.of_predictions(training.outputs[output], found)
            else:
                reasons[output] = next((each.reason for each in fits.values()), "") or _ABSENT
        chosen = FixedChoice(self.design, choice={key: race.winner for key, race in races.items()})
        fitted = chosen.fit(name, runs, model, joint, stream)
        failed = {**{key: text for key, text in reasons.items() if text}, **fitted.reasons}
        return replace(fitted, races=races, reasons=failed)

    def for_refits(self, fitted: FittedSurrogate) -> Surrogate:
        """Return settings with the choice of a fit, so that there is no other race."""
        choice = fitted.choice if isinstance(fitted, ChosenSurrogates) else {}
        return FixedChoice(self.design, choice=choice, components=self.components)

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> ChosenSurrogates:
        """Restore the surrogates that won; see `Surrogate.restore`."""
        return ChosenSurrogates.from_tree(tree, name, original)


@dataclass(frozen=True)
class FixedChoice(BestSurrogate):
    """Surrogate with a given kind for each output."""

    choice: Mapping[str, str] = field(default_factory=dict)  # by output; others are not fitted

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> ChosenSurrogates:
        """Fit each output by its kind; see `Surrogate.fit`."""
        training = TrainingRuns.from_runs(runs, model, joint)
        # Without curves that end, a model lacks their scores.
        choice = {key: kind for key, kind in self.choice.items() if key in training.outputs}
        members = {
            kind: each.fit(name, runs, model, joint, stream)
            for kind, each in _candidates(self, training, list(choice)).items()
            if kind in choice.values()
        }
        found = {output: members[kind].reasons.get(output, "") for output, kind in choice.items()}
        return ChosenSurrogates(
            **training.described(name, self.design),
            outputs=tuple(each for each in model.all_outputs if found.get(each.name) == ""),
            members=members,
            choice={output: kind for output, kind in choice.items() if not found[output]},
            reasons={output: reason for output, reason in found.items() if reason},
        )


def _candidates(
    surrogate: Surrogate, training: TrainingRuns, outputs: list[str]
) -> dict[str, Surrogate]:
    """Return the settings of each kind, all of them automatic."""
    process = resolve(SURROGATES[_PROCESS])(design=surrogate.design)
    if label_problem(training.joint):
        return {_PROCESS: process}
    positive = [output for output in outputs if (training.outputs[output] > 0).all()]
    logarithm = PolynomialChaos(surrogate.design, transform=dict.fromkeys(positive, "log"))
    return {
        _EXPANSION: PolynomialChaos(surrogate.design),
        **({_LOGARITHM: logarithm} if positive else {}),
        _PROCESS: process,
    }
