"""Designs: which runs to make. Each yields rounds of points; none knows of a model."""

from __future__ import annotations

__all__ = ["DESIGNS"]

DESIGNS = {
    "monte-carlo": "uqpen.designs.monte_carlo:MonteCarlo",
    "latin-hypercube": "uqpen.designs.latin_hypercube:LatinHypercube",
    "sobol-sequence": "uqpen.designs.quasi_monte_carlo:SobolSequence",
    "halton": "uqpen.designs.quasi_monte_carlo:Halton",
    "table": "uqpen.designs.table:Table",
}
