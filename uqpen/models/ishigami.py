"""The Ishigami function, whose statistics are known exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.model import Arrays, Bounds, Input, Output, Results
from uqpen.core.settings import number, validate
from uqpen.models.source import BuiltInModel

__all__ = ["Ishigami"]

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
