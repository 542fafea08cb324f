"""Reductions: from a field of a run to one number of that run.

A member takes the values of runs along the dimensions of an output, and returns a number for each
run. It is computed after the run, so another one costs no run.
"""

from __future__ import annotations

__all__ = ["REDUCTIONS"]

REDUCTIONS = {
    "max": "uqpen.reductions.extremes:Maximum",
    "min": "uqpen.reductions.extremes:Minimum",
    "mean": "uqpen.reductions.integrals:Mean",
    "integral": "uqpen.reductions.integrals:Integral",
    "first": "uqpen.reductions.ends:First",
    "last": "uqpen.reductions.ends:Last",
    "at": "uqpen.reductions.interpolation:At",
    "idxmax": "uqpen.reductions.extremes:PlaceOfMaximum",
    "idxmin": "uqpen.reductions.extremes:PlaceOfMinimum",
    "first_above": "uqpen.reductions.crossings:FirstAbove",
    "first_below": "uqpen.reductions.crossings:FirstBelow",
    "total_variation": "uqpen.reductions.variation:TotalVariation",
}
