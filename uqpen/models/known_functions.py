"""Functions whose statistics are known exactly, or nearly so."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.model import Arrays, Bounds, Dimension, Input, Output, Results
from uqpen.core.settings import number, validate
from uqpen.models.source import BuiltInModel

_RANGE = Bounds(-math.pi, math.pi, lower_included=True, upper_included=True)


@dataclass(frozen=True)
class Ishigami(BuiltInModel):
    """y = sin x1 + a sin² x2 + b x3⁴ sin x1, smooth, not monotonic, with an interaction.

    With x1, x2, x3 uniform over -π to π its mean is a / 2 and its variance
    1/2 + a²/8 + b π⁴/5 + b² π⁸/18.

    Parameters
    ----------
    a, b : float
        The function's coefficients.

    References
    ----------
    Ishigami, T. & Homma, T. (1990). Proc. First International Symposium on Uncertainty Modeling
    and Analysis, IEEE, 398-403.
    """

    a: float = number(default=7.0)
    b: float = number(default=0.1)

    name = "ishigami"
    inputs = tuple(Input(name, "1", bounds=_RANGE) for name in ("x1", "x2", "x3"))
    outputs = (Output("y", "1"),)

    def __post_init__(self) -> None:
        validate(self)

    def evaluate(self, inputs: Arrays) -> Results:
        x1, x2, x3 = inputs["x1"], inputs["x2"], inputs["x3"]
        y = np.sin(x1) + self.a * np.sin(x2) ** 2 + self.b * x3**4 * np.sin(x1)
        return Results.all_ok({"y": y})


_ANGLES = Dimension("theta", "1", values=tuple(range(-90, 91)))


@dataclass(frozen=True)
class Campbell(BuiltInModel):
    """A curve along the angle θ from -90 to 90, nonlinear in its inputs, with interactions.

    y(θ) = 10 + x1 exp(-(θ - 10 x2)² / (60 x1² + x3²)) + (x2 + x4) exp(0.002 x1 θ), at 181 angles.
    Its inputs are usually uniform over -1 to 5. Then x3 has next to no influence.

    References
    ----------
    Campbell, K., McKay, M. D. & Williams, B. J. (2006). Reliab. Eng. Syst. Saf. 91, 1468-1472.
    """

    name = "campbell-1d"
    inputs = tuple(Input(name, "1") for name in ("x1", "x2", "x3", "x4"))
    outputs = (Output("y", "1", dims=(_ANGLES,)),)

    def evaluate(self, inputs: Arrays) -> Results:
        x1, x2, x3, x4 = (inputs[entry.name][:, None] for entry in self.inputs)
        angles = np.array(_ANGLES.values)
        width = 60 * x1**2 + x3**2
        # A peak without a width has no height either.
        peak = x1 * np.exp(-((angles - 10 * x2) ** 2) / np.where(width > 0, width, 1.0))
        return Results.all_ok({"y": 10 + peak + (x2 + x4) * np.exp(0.002 * x1 * angles)})
