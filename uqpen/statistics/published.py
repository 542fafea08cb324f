"""Published estimates, in the same groups as uqpen's own for comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from uqpen.core.model import Output
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.sensitivity.input_measures import input_array

__all__ = ["Publication", "PublishedEstimates", "published_estimates"]


@dataclass(frozen=True)
class PublishedEstimates:
    """Estimates that a publication gives for one output.

    Parameters
    ----------
    output : Output
    moments : mapping of str to float
        ``"mean"`` and ``"std"``, in the output's SI unit.
    response : mapping of str to float
        By input: the relative response of the output, dimensionless.
    largest_contribution : str
        The input whose contribution to the uncertainty it calls the largest; empty for none.
    """

    output: Output
    moments: Mapping[str, float] = field(default_factory=dict)
    response: Mapping[str, float] = field(default_factory=dict)
    largest_contribution: str = ""


@dataclass(frozen=True)
class Publication:
    """Publication, by its reference, with its estimates of some outputs."""

    source: str
    estimates: tuple[PublishedEstimates, ...]


def published_estimates(publication: Publication) -> dict[str, OutputStatistics]:
    """Return a publication's estimates by output and statistic, without intervals of ours."""
    reason = texts.PUBLISHED.format(source=publication.source)
    found: dict[str, OutputStatistics] = {}
    for estimates in publication.estimates:
        name, title = estimates.output.name, estimates.output.title
        found[name] = {
            moment: Estimate.without_bounds(value, reason).to_array(
                units=estimates.output.unit, long_name=f"{moment} of {title}, published"
            )
            for moment, value in estimates.moments.items()
        }
        if estimates.response:
            found[name]["response"] = input_array(
                [Estimate.without_bounds(value, reason) for value in estimates.response.values()],
                [*estimates.response],
                f"relative response of {title}, published",
            )
    return found
