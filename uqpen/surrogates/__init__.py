"""Surrogates: cheap models fitted to the runs of a design.

A surrogate depends on the runs and the distributions of the inputs only.
"""

from __future__ import annotations

__all__ = ["ENTRY_POINTS", "SURROGATES"]

SURROGATES = {
    "polynomial-chaos": "uqpen.surrogates.chaos.polynomial_chaos:PolynomialChaos",
    "gaussian-process": "uqpen.surrogates.gaussian_process:GaussianProcess",
    "best": "uqpen.surrogates.best_surrogate:BestSurrogate",
}

# The group of entry points with which installed packages add kinds.
ENTRY_POINTS = "uqpen.surrogates"
