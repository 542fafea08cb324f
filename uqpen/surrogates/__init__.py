"""Surrogates: cheap models fitted to the runs of a design. Each knows of runs and laws only."""

from __future__ import annotations

__all__ = ["SURROGATES"]

SURROGATES = {
    "polynomial-chaos": "uqpen.surrogates.polynomial_chaos:PolynomialChaos",
}
