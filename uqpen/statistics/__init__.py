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

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import Statistic, of_field

__all__ = [
    "ANALYSES",
    "ANALYSES_IN_MEMORY",
    "ANALYSES_OF_DESIGNS",
    "ANALYSES_OF_REPEATS",
    "FIELD_ANALYSES",
    "FIELD_ANALYSES_OF_DESIGNS",
    "INPUT_ANALYSES",
    "SALIB_ANALYSES",
    "WEIGHTED_ANALYSES",
]


def _analyses(of: str) -> Mapping[str, Sequence[str]]:
    """Return references to the functions that estimate statistics of something, by their group."""
    found: dict[str, dict[str, None]] = {}
    for statistic in CATALOGUE.values():
        if of in statistic.by:
            found.setdefault(statistic.group, {})[statistic.by[of]] = None
    return MappingProxyType({group: tuple(references) for group, references in found.items()})


def _groups(is_meant: Callable[[Statistic], bool]) -> frozenset[str]:
    return frozenset(each.group for each in CATALOGUE.values() if each.group and is_meant(each))


ANALYSES = _analyses("sample")

# The analyses that are right for weighted runs. The others would count every run the same.
WEIGHTED_ANALYSES = _groups(lambda each: each.takes_weights)

# The analyses of a field, by the group of their results: functions of a `FieldSample`. The
# statistics of a field have its dimensions before their own.
FIELD_ANALYSES = _analyses("field")

# The analyses of points that have several runs each, functions of a `RepeatedSample`. Their results
# take the places of those of the first runs.
ANALYSES_OF_REPEATS = _analyses("repeats")

# The analyses of a sample that take all of its values at once. They yield nothing unless a study
# requests it.
ANALYSES_IN_MEMORY = _groups(lambda each: each.takes_all_values)

# The analyses of a sample that read its inputs. The others read its values, weights and replicates
# alone, except where the error is that of one stratified set: it follows from the inputs, too. An
# analysis of a design's own takes all its runs as one dataset.
INPUT_ANALYSES = _groups(lambda each: bool(each.measure.label))

ANALYSES_OF_DESIGNS = MappingProxyType(
    {each: found for each in Sampling if (found := _analyses(each))}
)

# The same for fields: functions of all runs.
FIELD_ANALYSES_OF_DESIGNS = MappingProxyType(
    {each: found for each in Sampling if (found := _analyses(of_field(each)))}
)

# The analyses of SALib that a study can ask for by ``"salib:<name>"``: classes of their settings.
_SALIB = "uqpen.statistics.sensitivity.salib_analyses"
SALIB_ANALYSES = MappingProxyType(
    {
        "rbd_fast": f"{_SALIB}:RbdFast",
        "pawn": f"{_SALIB}:Pawn",
        "delta": f"{_SALIB}:Delta",
        "rsa": f"{_SALIB}:Rsa",
        "enhanced_hdmr": f"{_SALIB}:EnhancedHdmr",
    }
)
