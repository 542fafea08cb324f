"""p-value of the fit of a generalised Pareto distribution, from a simulated table."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["P_VALUES", "SHAPES", "p_value"]

P_VALUES = (0.5, 0.25, 0.1, 0.05, 0.025, 0.01, 0.001)
SHAPES = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)

# Values that Anderson and Darling's statistic exceeds with the probabilities above, for each
# shape, by simulation (`benchmarks/tail_fit_table.py`). Choulakian, V. and Stephens, M. A. (2001).
# Technometrics 43, 478-484, have a table of such points.
_POINTS = (
    (0.456, 0.668, 0.961, 1.183, 1.421, 1.754, 2.685),  # -0.5
    (0.422, 0.614, 0.870, 1.075, 1.277, 1.569, 2.277),  # -0.25
    (0.395, 0.563, 0.793, 0.966, 1.155, 1.397, 2.031),  # 0
    (0.373, 0.526, 0.731, 0.889, 1.045, 1.268, 1.826),  # 0.25
    (0.354, 0.498, 0.682, 0.829, 0.983, 1.174, 1.753),  # 0.5
    (0.345, 0.481, 0.656, 0.798, 0.936, 1.127, 1.635),  # 0.75
    (0.337, 0.466, 0.632, 0.761, 0.897, 1.072, 1.537),  # 1
)


def p_value(statistic: float, shape: float) -> float:
    """Return the p-value of Anderson and Darling's statistic of a fit, from 0.001 to 0.5.

    Parameters
    ----------
    statistic : float
        Its value.
    shape : float
        Of the fitted distribution; outside of the table, that of its end is taken.
    """
    table = np.array(_POINTS)
    points = [float(np.interp(shape, SHAPES, column)) for column in table.T]
    logarithms = [math.log(each) for each in P_VALUES]
    return math.exp(float(np.interp(statistic, points, logarithms)))
