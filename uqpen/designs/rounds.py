"""Points of a design, round by round, with a clear error where a user's own design fails."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.errors import StudyError, UqpenError
from uqpen.core.labels import RUN, WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.models.python_function import error_text

__all__ = ["draw_rounds", "weight_fault"]


def draw_rounds(design: Design, joint: JointDistribution, stream: Stream) -> Rounds:
    """Yield the rounds of a design as `Design.rounds` does.

    Raises
    ------
    StudyError
        If a design from outside the package raises an error, or yields anything but points.
    """
    rounds = design.rounds(joint, stream)
    runs: xr.Dataset | None = None
    while True:
        try:
            points = rounds.send(runs)  # type: ignore[arg-type]
        except StopIteration:
            if runs is None:
                raise _error(design, "it yields no points") from None
            return
        except Exception as error:
            if isinstance(error, UqpenError) or type(design).__module__.startswith("uqpen."):
                raise
            raise _error(design, error_text(error)) from error
        fault = _fault(points, joint) or weight_fault(points, design.sampling)
        if not fault and runs is not None and (WEIGHT in points.coords) != (WEIGHT in runs.coords):
            fault = f"some of its rounds have a {WEIGHT}, others none"
        if fault:
            raise _error(design, fault)
        runs = yield points


def _fault(points: object, joint: JointDistribution) -> str:
    """Return why what a design yields is no points; empty where it is."""
    if not isinstance(points, xr.Dataset):
        return f"it yields an object of class {type(points).__name__}, not a dataset"
    names = [each.variable.name for each in joint.inputs if isinstance(each, RandomInput)]
    absent = [name for name in names if name not in points]
    if RUN not in points.dims or absent:
        return f"its points lack {', '.join(absent) or 'the dimension run'}"
    return ""


def weight_fault(points: xr.Dataset, sampling: Sampling) -> str:
    """Return what is wrong with the weights of points; empty where nothing is."""
    if WEIGHT not in points.coords:
        return ""
    if sampling not in (Sampling.INDEPENDENT, Sampling.USER_SUPPLIED):
        return f"it weights points that are {sampling}, and weights are of independent draws"
    weights = points[WEIGHT]
    if weights.dims != (RUN,) or weights.dtype.kind not in "iuf":
        return f"its {WEIGHT} is not a number for each run"
    if not (np.isfinite(weights) & (weights >= 0)).all() or not (weights > 0).any():
        return f"its {WEIGHT} is not finite, below 0, or 0 everywhere"
    return ""


def _error(design: Design, reason: str) -> StudyError:
    return StudyError(f"the design {type(design).__name__} fails: {reason}")
