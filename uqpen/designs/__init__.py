"""Designs: which runs to make. Each yields rounds of points; none knows of a model."""

from __future__ import annotations

__all__ = ["DESIGNS"]

DESIGNS = {
    "monte-carlo": "uqpen.designs.monte_carlo:MonteCarlo",
    "latin-hypercube": "uqpen.designs.latin_hypercube:LatinHypercube",
    "table": "uqpen.designs.table:Table",
}
