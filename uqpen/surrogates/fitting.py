"""Fit of a surrogate, with a reason in its place where a user-defined surrogate fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import REFINED_FOR, REPLICATE, RUN, SAMPLING, STATUS, WEIGHT
from uqpen.core.model import Model
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import mean_repeats
from uqpen.models.user_code import error_text
from uqpen.surrogates.ending_curves import EndingComponents, best_way
from uqpen.surrogates.field_fit import FieldCheck, ScoreModel, field_components, scored_runs
from uqpen.surrogates.field_surrogate import fit_fields
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.output_surrogate import unfitted
from uqpen.surrogates.principal_components import PrincipalComponents
from uqpen.surrogates.surrogate import Surrogate

if TYPE_CHECKING:
    import xarray as xr

# Attributes that every reader of an archive needs.
_NEEDED = ("kind", "design", "outputs", "runs_used")


def is_built_in(surrogate: Surrogate) -> bool:
    """Check for a surrogate of the package itself: an error in it is no matter of the study."""
    return type(surrogate).__module__.startswith("uqpen.")


@one_blas_thread()
def fit_surrogate(
    surrogate: Surrogate,
    name: str,
    runs: xr.Dataset,
    model: Model,
    joint: JointDistribution,
    stream: Stream,
    *,
    has_ending_curves: bool = True,
) -> FittedSurrogate:
    """Fit a surrogate as `Surrogate.fit` does, and to fields by their principal components.

    Curves that end take further fits, to parts of the runs, and can be left out. Where a
    user-defined surrogate raises an error, or gives what is no fitted surrogate, that is the reason
    why no output is fitted. Of runs that a design repeats it gets the means at the points.
    """
    runs = mean_repeats(runs)

    def fit(runs: xr.Dataset, model: Model) -> FittedSurrogate:
        if is_built_in(surrogate):
            return surrogate.fit(name, runs, model, joint, stream)
        try:
            fitted = surrogate.fit(name, runs, model, joint, stream)
            fault = _fault(surrogate, fitted, runs)
        except (Exception, SystemExit) as error:  # a user-defined class can raise anything
            fault = error_text(error)
        if not fault:
            return fitted
        return unfitted(surrogate, name, runs, model, joint, f"its fit fails: {fault}")

    if any(output.dims for output in model.all_outputs):
        ending: Mapping[str, PrincipalComponents | str] = {
            output.name: "its curves may end" for output in model.all_outputs if output.may_end
        }
        if has_ending_curves and ending:

            def leave_out(runs: xr.Dataset, model: Model) -> CrossFit:
                again = surrogate.for_refits(fit(runs, model))
                return cross_fit(again, name, runs, model, joint, stream)

            ending = _chosen_ways(model, runs, surrogate.components, leave_out)
        return fit_fields(name, runs, model, surrogate.components, fit, ending)
    return fit(runs, model)


# Curves that end: the way to take them that predicts runs left out best.


def _chosen_ways(
    model: Model,
    runs: xr.Dataset,
    wanted: float,
    leave_out: Callable[[xr.Dataset, Model], CrossFit],
) -> dict[str, PrincipalComponents | str]:
    """Return the components of curves that may end, or the reasons why there are none.

    Those up to the place that all reach and those along the scaled coordinate each predict runs
    that their fits have not seen; the errors up to that place decide, see `best_way`. The
    components are of all runs.
    """
    outputs = [output for output in model.all_outputs if output.may_end]
    common, scaled = (
        {each.name: field_components(each, runs, wanted, is_scaled=is_scaled) for each in outputs}
        for is_scaled in (False, True)
    )
    errors = [_errors_left_out(ways, model, runs, leave_out) for ways in (common, scaled)]
    return {
        name: best_way(common[name], scaled[name], *(e.get(name) for e in errors))
        for name in common
    }


def _errors_left_out(
    ways: Mapping[str, PrincipalComponents | str],
    model: Model,
    runs: xr.Dataset,
    leave_out: Callable[[xr.Dataset, Model], CrossFit],
) -> dict[str, tuple[float, float]]:
    """Return shares of the variance of each curve that fits leave at runs they have not seen.

    They are up to the place that all curves reach, and of the whole; without those that no fold
    can predict.
    """
    ending = {name: each for name, each in ways.items() if isinstance(each, EndingComponents)}
    if not ending:
        return {}
    scored = scored_runs(runs, ending)
    folds = leave_out(scored, ScoreModel(model, ending, has_scalars=False))
    names = {name: each.names(name) for name, each in ending.items()}
    predicted = folds.predictions(scored, [score for each in names.values() for score in each])
    completed = runs[STATUS].values == Status.OK
    found = {}
    for name, each in ending.items():
        if predicted.keys() >= set(names[name]):
            scores = np.column_stack([predicted[score] for score in names[name]])
            truth = runs[name].values[completed].astype(np.float64)
            whole = FieldCheck.of_runs(each, scores, truth).left
            found[name] = (each.left_in_common(scores, truth), whole)
    return found


def _fault(surrogate: Surrogate, fitted: object, runs: xr.Dataset) -> str:
    """Return why what a fit returns is no fitted surrogate; empty where it is one."""
    if not isinstance(fitted, FittedSurrogate):
        return f"it returns an object of class {type(fitted).__name__}, not a FittedSurrogate"
    tree = fitted.to_tree()
    if absent := [key for key in _NEEDED if key not in tree.attrs]:
        return f"its group of the archive has no {', '.join(absent)}"
    restored = surrogate.restore(tree, fitted.name, fitted.original)
    if not fitted.outputs:
        return ""
    inputs, completed = fitted.completed_runs(runs)
    found, again = fitted.predict(inputs), restored.predict(inputs)
    size = len(next(iter(inputs.values())))
    for output in fitted.outputs:
        if output.name not in found or output.name not in completed:
            return f"it has no prediction of {output.name}"
        if fault := _prediction_fault(found[output.name], size):
            return f"{output.name}: {fault}"
        if not np.array_equal(found[output.name].mean, again[output.name].mean):
            return f"{output.name}: predictions differ after to_tree and restore"
    return ""


def _prediction_fault(found: Prediction, size: int) -> str:
    if np.shape(found.mean) != (size,):
        return f"a mean of shape {np.shape(found.mean)}, not {(size,)}"
    if found.std is not None and np.shape(found.std) != (size,):
        return f"a std of shape {np.shape(found.std)}, not {(size,)}"
    return "" if np.isfinite(found.mean).all() else "a prediction that is not finite"


# Cross-fitting: a surrogate fitted again without each fold of its training runs.
#
# Each training run then has a prediction of a fit that has not seen it. So its error there is that
# of a fresh run.

# With ten, intervals were 4 to 15 % narrower, at twice the fits.
FOLDS = 5

# Folds with fewer runs are noise.
_FEWEST_RUNS = 2 * FOLDS

_NO_SAMPLE = "the training runs are no sample of the input distribution"
_UNKNOWN = "the training runs are not declared independent (independent = true)"
_BLOCKS = "the training runs share coordinates, so that none is independent of a fit to the others"
_WEIGHTED = "the training runs are weighted"
_FEW = "{runs} training runs are too few for {folds} folds"


@dataclass(frozen=True, eq=False)
class CrossFit:
    """Fits of a surrogate, each without one fold of its training runs."""

    fold: IntArray  # (run,): the fold of each training run
    models: tuple[FittedSurrogate, ...]  # by fold, the fit to the other ones; none with a reason
    reason: str = ""  # reason why there are no folds; empty where there are

    def predictions(self, runs: xr.Dataset, outputs: Iterable[str]) -> dict[str, FloatArray]:
        """Return predictions at the completed runs by the fits that have not seen them.

        They are of the outputs that all fits have.
        """
        completed = np.flatnonzero(runs[STATUS].values == Status.OK)
        values = {
            output: np.empty(len(completed))
            for output in outputs
            if self.models and not any(output in model.reasons for model in self.models)
        }
        for number, model in enumerate(self.models):
            at = np.flatnonzero(self.fold[completed] == number)
            inputs, _ = model.completed_runs(runs.isel({RUN: completed[at]}))
            predicted = model.predict(inputs)
            for output, array in values.items():
                array[at] = predicted[output].mean
        return values

    @classmethod
    def without_folds(cls, runs: int, reason: str) -> CrossFit:
        """Return no fits, for a reason."""
        return cls(np.zeros(runs, dtype=np.int64), (), reason)


def cross_fit(
    surrogate: Surrogate,
    name: str,
    runs: xr.Dataset,
    model: Model,
    joint: JointDistribution,
    stream: Stream,
) -> CrossFit:
    """Fit a surrogate with its own settings, without each fold of its training runs in turn.

    Parameters
    ----------
    surrogate : Surrogate
        Of any kind. An output that one of the fits does not have is in its `reasons`.
    stream : Stream
        That of the fit to all runs; the division and each fit have streams of their own below it.

    Returns
    -------
    CrossFit
        Of runs that a design repeats, `mean_repeats` has those that are divided: all repeats of a
        point are in one fold.
    """
    runs = mean_repeats(runs)
    size = runs.sizes[RUN]
    if reason := _reason_without_folds(runs):
        return CrossFit.without_folds(size, reason)
    # Whole replicates are dealt, or runs without any. Runs of a replicate avoid each other:
    # the rest of it would give a hint at one that is left out.
    unit = np.arange(size)
    if REPLICATE in runs.coords and np.unique(runs[REPLICATE].values).size > 1:
        _, unit = np.unique(runs[REPLICATE].values, return_inverse=True)
    units = int(unit.max()) + 1
    rng = stream.generator("cross_fitting")
    fold = (rng.permutation(units) % min(FOLDS, units))[unit].astype(np.int64)
    fits = (
        fit_surrogate(
            surrogate,
            name,
            runs.isel({RUN: np.flatnonzero(fold != left_out)}),
            model,
            joint,
            stream.child("cross_fitting", left_out),
            has_ending_curves=False,
        )
        for left_out in range(int(fold.max()) + 1)
    )
    return CrossFit(fold, tuple(fits))


def _reason_without_folds(runs: xr.Dataset) -> str:
    sampling = Sampling(runs.attrs[SAMPLING])
    if not sampling.is_sample:
        return _NO_SAMPLE
    if sampling is Sampling.GIVEN:
        return _UNKNOWN
    if sampling is Sampling.PICK_FREEZE:
        return _BLOCKS
    if WEIGHT in runs.coords and REFINED_FOR not in runs.attrs:
        return _WEIGHTED
    size = runs.sizes[RUN]
    return _FEW.format(runs=size, folds=FOLDS) if size < _FEWEST_RUNS else ""
