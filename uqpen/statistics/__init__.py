"""Analyses: from runs to statistics, each with an interval that suits its design.

An analysis of a sample takes the sample of one output and the quantity of interest that a study
defines for that output. It yields estimates, each with its name in `uqpen.core.catalogue`. Every
design whose points are a sample of the joint distribution gets all of these analyses, so that
designs can be compared. Designs made for one purpose (pick-freeze blocks, trajectories, a
quadrature rule) have analyses of their own, which take their runs. The probabilities of the
statuses of runs are estimated by
`uqpen.statistics.distribution_function.probabilities.status_probabilities`.

`ANALYSES` take scalar outputs. Fields, outputs with dimensions, have `FIELD_ANALYSES`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.sampling import Sampling

__all__ = [
    "ANALYSES",
    "ANALYSES_IN_MEMORY",
    "ANALYSES_OF_DESIGNS",
    "FIELD_ANALYSES",
    "FIELD_ANALYSES_OF_DESIGNS",
    "INPUT_ANALYSES",
    "WEIGHTED_ANALYSES",
]


def _analyses(of: str, further: Mapping[str, Sequence[str]]) -> Mapping[str, Sequence[str]]:
    """Return references to the functions that estimate statistics of something, by their group."""
    found: dict[str, list[str]] = {}
    for statistic in CATALOGUE.values():
        if of in statistic.by:
            found.setdefault(statistic.group, []).append(statistic.by[of])
    return MappingProxyType({**found, **further})


ANALYSES = _analyses(
    "sample",
    {
        "sensitivity": [
            "uqpen.statistics.sensitivity.given_data:first_order",
            "uqpen.statistics.sensitivity.correlations:correlations",
            "uqpen.statistics.sensitivity.delta:delta",
        ],
        "convergence": ["uqpen.statistics.convergence:convergence"],
    },
)

# The analyses that are right for weighted runs. The others would count every run the same.
WEIGHTED_ANALYSES = frozenset(
    {
        "moments",
        "quantiles",
        "percentiles",
        "exceedance",
        "cdfs",
        "shares",
        "convergence",
        "reached",
        "bands",
        "ranked_curves",
    }
)

# The analyses of a field, by the group of their results: functions of a `FieldSample`. The
# statistics of a field have its dimensions before their own.
FIELD_ANALYSES = _analyses(
    "field",
    {"sensitivity": ["uqpen.statistics.fields.given_data_at_places:first_order_at_places"]},
)

# The analyses of a sample that take all of its values at once. They yield nothing unless a study
# requests it.
ANALYSES_IN_MEMORY = frozenset(each.group for each in CATALOGUE.values() if each.takes_all_values)

# The analyses of a sample that read its inputs. The others read its values, weights and replicates
# alone, except where the error is that of one stratified set: it follows from the inputs, too. An
# analysis of a design's own takes all its runs as one dataset.
INPUT_ANALYSES = frozenset({"sensitivity"})

ANALYSES_OF_DESIGNS: Mapping[Sampling, Mapping[str, list[str]]] = MappingProxyType(
    {
        Sampling.PICK_FREEZE: {
            "sensitivity": ["uqpen.statistics.sensitivity.sobol_indices:sobol_indices"],
        },
        Sampling.QUADRATURE: {
            "moments": ["uqpen.statistics.moments.quadrature_moments:quadrature_moments"]
        },
        Sampling.TRAJECTORIES: {
            "sensitivity": ["uqpen.statistics.sensitivity.elementary_effects:elementary_effects"],
        },
        Sampling.ONE_AT_A_TIME: {
            "sensitivity": ["uqpen.statistics.sensitivity.responses:relative_responses"]
        },
        Sampling.TOWARDS_EVENT: {
            "quantiles": ["uqpen.statistics.rare_events.rare_quantiles:rare_quantiles"]
        },
    }
)

# The same for fields: functions of all runs.
FIELD_ANALYSES_OF_DESIGNS: Mapping[Sampling, Mapping[str, list[str]]] = MappingProxyType(
    {
        Sampling.PICK_FREEZE: {
            "sensitivity": ["uqpen.statistics.fields.sobol_at_places:sobol_indices_at_places"],
        },
        Sampling.TRAJECTORIES: {
            "sensitivity": ["uqpen.statistics.fields.effects_at_places:effects_at_places"],
        },
        Sampling.ONE_AT_A_TIME: {
            "sensitivity": ["uqpen.statistics.fields.effects_at_places:responses_at_places"],
        },
    }
)
