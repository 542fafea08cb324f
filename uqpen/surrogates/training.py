"""The runs that a surrogate is fitted to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.labels import QUADRATURE_WEIGHT, ROLE, RUN, STATUS, Status
from uqpen.core.model import Model
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import status_counts

__all__ = ["TrainingRuns"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrainingRuns:
    """The runs of a design that came back.

    Parameters
    ----------
    inputs, outputs : mapping of str to ndarray, shape (run,)
        The random inputs, and the outputs that have numbers, in SI units.
    fixed : mapping of str to float
        The other inputs, each with its one value.
    weights : ndarray, shape (run,), or None
        Of an integration rule, all of whose nodes came back.
    is_quadrature : bool
        Whether the runs are the nodes of a rule.
    counts : mapping of Status to int
        How many of the design's runs ended with each status.
    problem : str
        Why nothing can be fitted to these runs, if so.
    """

    inputs: Mapping[str, FloatArray]
    outputs: Mapping[str, FloatArray]
    fixed: Mapping[str, float]
    weights: FloatArray | None
    is_quadrature: bool
    counts: Mapping[Status, int]
    problem: str

    @classmethod
    def from_runs(cls, runs: xr.Dataset, model: Model, joint: JointDistribution) -> TrainingRuns:
        """The runs of a design, as far as they came back."""
        came_back = runs[STATUS].values == Status.OK
        random = {entry.variable.name for entry in joint.random}
        inputs: dict[str, FloatArray] = {}
        fixed: dict[str, float] = {}
        problem = "" if random else "no input is random"
        for name, variable in runs.data_vars.items():
            if variable.attrs.get(ROLE) != "input":
                continue
            values = np.broadcast_to(variable.values, runs.sizes[RUN])
            if name in random:
                inputs[str(name)] = values[came_back]
            elif (values == values[0]).all():
                fixed[str(name)] = float(values[0])
            else:
                problem = f"its design varies {name}, which has no distribution"
        is_rule = QUADRATURE_WEIGHT in runs.coords
        return cls(
            inputs=inputs,
            outputs={
                output.name: runs[output.name].values[came_back].astype(np.float64)
                for output in model.outputs
                if not output.categories
            },
            fixed=fixed,
            weights=runs[QUADRATURE_WEIGHT].values if is_rule and came_back.all() else None,
            is_quadrature=is_rule,
            counts=status_counts(runs),
            problem=problem if came_back.any() else "none of its runs came back",
        )

    @property
    def size(self) -> int:
        """How many runs came back."""
        return self.counts[Status.OK]

    @property
    def failed(self) -> int:
        """How many did not."""
        return sum(self.counts.values()) - self.size
