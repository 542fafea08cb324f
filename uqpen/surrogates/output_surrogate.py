"""Settings of a surrogate that fits each output by itself: the usual base of one's own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Model, Output
from uqpen.core.settings import name
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.models.user_code import error_text
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.separate_fits import FittedOutput, OutputFit, SeparateFits, predict_output
from uqpen.surrogates.surrogate import Surrogate, components_setting
from uqpen.surrogates.training import TrainingRuns

if TYPE_CHECKING:
    import xarray as xr

# Fits an output; its arguments are those of `OutputSurrogate.fit_output`, after the output itself.
Fit = Callable[[Output, FloatArray, FloatArray, np.random.Generator], OutputFit | str]


@dataclass(frozen=True, kw_only=True)
class OutputSurrogate(Surrogate):
    """Frozen settings of a surrogate that fits each output by itself.

    A subclass declares further settings and the class of its fits, and implements `fit_output`.

    Parameters
    ----------
    design : str
        The design whose runs it is fitted to.
    check : str, optional
        A design whose runs show how good it is.
    components : float or int
        The principal components of a field that are kept: the share of its variance that they have
        at least, or their number.

    Attributes
    ----------
    output_fit : type
        The class of what `fit_output` returns.
    """

    output_fit: ClassVar[type[OutputFit]]

    design: str = name()
    check: str | None = name(default=None)
    components: float = components_setting()

    @abstractmethod
    def fit_output(
        self, points: FloatArray, values: FloatArray, rng: np.random.Generator
    ) -> OutputFit | str:
        """Fit an output; return the reason where that is not possible.

        Parameters
        ----------
        points : ndarray, shape (run, input)
            The random inputs of the completed runs, in SI units.
        values : ndarray, shape (run,)
            The output, in its SI unit: finite and not constant.
        rng : Generator
            The only source of random numbers.
        """

    def fit(
        self, name: str, runs: xr.Dataset, model: Model, joint: JointDistribution, stream: Stream
    ) -> SeparateFits:
        """Fit every output that has numbers; see `Surrogate.fit`."""

        def fit_one(
            output: Output, points: FloatArray, values: FloatArray, rng: np.random.Generator
        ) -> OutputFit | str:
            fit = self.fit_output(points, values, rng)
            if not isinstance(fit, str | self.output_fit):
                wrong, expected = type(fit).__name__, self.output_fit.__name__
                raise TypeError(f"fit_output returns an object of class {wrong}, not {expected}")
            return fit

        return fit_separately(self, fit_one, name, runs, model, joint, stream)

    @classmethod
    def restore(cls, tree: xr.DataTree, name: str, original: Model | None) -> SeparateFits:
        """Restore a surrogate of this class; see `Surrogate.restore`."""
        return SeparateFits.from_tree(tree, name, original, cls.output_fit)


def fit_separately(
    surrogate: Surrogate,
    fit_one: Fit,
    name: str,
    runs: xr.Dataset,
    model: Model,
    joint: JointDistribution,
    stream: Stream,
) -> SeparateFits:
    """Fit every output that has numbers by itself.

    Parameters
    ----------
    surrogate : Surrogate
        The settings, for the record.
    fit_one : callable
        Fits an output, or returns the reason where that is not possible.
    name, runs, model, joint, stream
        As `Surrogate.fit` takes them.
    """
    training = TrainingRuns.from_runs(runs, model, joint)
    fitted: dict[str, FittedOutput] = {}
    reasons: dict[str, str] = {}
    for output in model.all_outputs:
        rng = stream.generator("fit", output.name)
        found: FittedOutput | str = training.output_problem(output)
        if not found:
            points = np.column_stack([training.inputs[each.variable.name] for each in joint.random])
            found = _fitted_output(output, fit_one, points, training.outputs[output.name], rng)
        if isinstance(found, FittedOutput):
            fitted[output.name] = found
        else:
            reasons[output.name] = found
    return _separate_fits(surrogate, training, name, fitted, reasons)


def _fitted_output(
    output: Output, fit_one: Fit, points: FloatArray, values: FloatArray, rng: np.random.Generator
) -> FittedOutput | str:
    """Return the fit to an output, or the reason why there is none."""
    try:
        fit = fit_one(output, points.copy(), values.copy(), rng)
        if isinstance(fit, str):
            return fit
        found = FittedOutput(output, fit, float(values.min()), float(values.max()))
        found.to_groups()
        predicted = predict_output(fit, points).mean
    except (Exception, SystemExit) as error:  # a user-defined class can raise anything
        return f"its fit fails: {error_text(error)}"
    if not np.isfinite(predicted).all():
        return "its fit fails: a prediction at the training runs is not finite"
    return found


def unfitted(
    surrogate: Surrogate,
    name: str,
    runs: xr.Dataset,
    model: Model,
    joint: JointDistribution,
    reason: str,
) -> SeparateFits:
    """Return a fitted surrogate without outputs, for the reason why the fit has failed."""
    training = TrainingRuns.from_runs(runs, model, joint)
    reasons = {output.name: reason for output in model.all_outputs}
    return _separate_fits(surrogate, training, name, {}, reasons)


def _separate_fits(
    surrogate: Surrogate,
    training: TrainingRuns,
    name: str,
    fitted: Mapping[str, FittedOutput],
    reasons: Mapping[str, str],
) -> SeparateFits:
    """Return fits under the name of a built-in kind, or the reference of a user-defined class."""
    reference = f"{type(surrogate).__module__}:{type(surrogate).__qualname__}"
    built_in = {each: kind for kind, each in SURROGATES.items()}
    return SeparateFits(
        **training.described(name, surrogate.design),
        outputs=tuple(each.output for each in fitted.values()),
        fitted=fitted,
        reasons=reasons,
        kind=built_in.get(reference, reference),
    )
