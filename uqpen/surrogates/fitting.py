"""Fit of a surrogate, with a reason in its place where a user-defined surrogate fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.model import Model
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.models.user_code import error_text
from uqpen.surrogates.field_surrogate import fit_fields
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.output_surrogate import unfitted
from uqpen.surrogates.surrogate import Surrogate

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fit_surrogate", "is_built_in"]

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
) -> FittedSurrogate:
    """Fit a surrogate as `Surrogate.fit` does, and to fields by their principal components.

    Where a user-defined surrogate raises an error, or gives what is no fitted
    surrogate, that is the reason why no output is fitted.
    """

    def fit(runs: xr.Dataset, model: Model) -> FittedSurrogate:
        return _fit_scalars(surrogate, name, runs, model, joint, stream)

    if any(output.dims for output in model.all_outputs):
        return fit_fields(name, runs, model, surrogate.components, fit)
    return fit(runs, model)


def _fit_scalars(
    surrogate: Surrogate,
    name: str,
    runs: xr.Dataset,
    model: Model,
    joint: JointDistribution,
    stream: Stream,
) -> FittedSurrogate:
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
