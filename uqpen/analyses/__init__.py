"""Analyses: from runs to statistics, each with the interval that covers on its design.

Every analysis takes one output's sample and the questions that a study asks of that output; it
yields named estimates for the group of its own name. All of them are made of every design.
What became of the runs themselves is told by `uqpen.analyses.probabilities.statuses`.
"""

from __future__ import annotations

__all__ = ["ANALYSES"]

ANALYSES = {
    "moments": "uqpen.analyses.moments:moments",
    "quantiles": "uqpen.analyses.quantiles:quantiles",
    "holds": "uqpen.analyses.quantiles:holds",
    "exceedance": "uqpen.analyses.probabilities:exceedance",
    "cdfs": "uqpen.analyses.cdfs:cdf",
    "shares": "uqpen.analyses.probabilities:shares",
}
