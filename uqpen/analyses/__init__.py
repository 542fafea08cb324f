"""Analyses: from runs to statistics, each with the interval that covers on its design.

An analysis of a sample takes one output's sample of the input law and the questions that a study
asks of that output; it yields named estimates. Every design whose points are such a sample gets all
of them, so that designs can be compared. Designs that are made to answer one question (pick-freeze
blocks, trajectories, an integration rule) have analyses of their own, which take their runs. What
became of the runs themselves is told by `uqpen.analyses.probabilities.statuses`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from uqpen.labels import Sampling

__all__ = ["ANALYSES", "ANALYSES_OF_DESIGNS"]

# The group that the answers stand in, and who gives them.
ANALYSES = {
    "moments": ["uqpen.analyses.moments:moments"],
    "quantiles": ["uqpen.analyses.quantiles:quantiles"],
    "holds": ["uqpen.analyses.quantiles:holds"],
    "exceedance": ["uqpen.analyses.probabilities:exceedance"],
    "cdfs": ["uqpen.analyses.cdfs:cdf"],
    "shares": ["uqpen.analyses.probabilities:shares"],
    "sensitivity": [
        "uqpen.analyses.given_data:first_order",
        "uqpen.analyses.correlations:correlations",
        "uqpen.analyses.delta:delta",
    ],
}

ANALYSES_OF_DESIGNS: Mapping[Sampling, Mapping[str, list[str]]] = MappingProxyType(
    {
        Sampling.PICK_FREEZE: {
            "sensitivity": ["uqpen.analyses.sobol_indices:sobol_indices"],
        },
        Sampling.RULE: {"moments": ["uqpen.analyses.integration:rule_moments"]},
        Sampling.TRAJECTORIES: {
            "sensitivity": ["uqpen.analyses.elementary_effects:elementary_effects"],
        },
        Sampling.STEPS: {"sensitivity": ["uqpen.analyses.responses:responses"]},
    }
)
