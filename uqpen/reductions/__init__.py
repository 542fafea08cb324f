"""Reductions: from a field of a run to one number of that run.

A member takes the values of runs along the dimensions of an output, and returns a number for each
run. It is computed after the run, so another one costs no run.
"""

from __future__ import annotations

__all__ = ["REDUCTIONS"]

REDUCTIONS = {
    "max": "uqpen.reductions.of_fields:Maximum",
    "min": "uqpen.reductions.of_fields:Minimum",
    "mean": "uqpen.reductions.of_fields:Mean",
    "integral": "uqpen.reductions.of_fields:Integral",
    "first": "uqpen.reductions.of_curves:First",
    "last": "uqpen.reductions.of_curves:Last",
    "at": "uqpen.reductions.of_fields:At",
    "idxmax": "uqpen.reductions.of_fields:PlaceOfMaximum",
    "idxmin": "uqpen.reductions.of_fields:PlaceOfMinimum",
    "idxlast": "uqpen.reductions.of_fields:PlaceOfLast",
    "first_above": "uqpen.reductions.of_curves:FirstAbove",
    "first_below": "uqpen.reductions.of_curves:FirstBelow",
    "total_variation": "uqpen.reductions.of_curves:TotalVariation",
}
