"""Published estimates, in the same groups as uqpen's own for comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from uqpen.core.model import Output
from uqpen.core.settings import difference, quantities, quantity, text, validate
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate

if TYPE_CHECKING:
    from uqpen.statistics.analyze import OutputStatistics


@dataclass(frozen=True)
class PublishedEstimates:
    """Estimates that a publication gives for one output."""

    output: Output
    mean: float | None = quantity(default=None)  # with std: in the output's SI unit
    std: float | None = difference(default=None)
    # By input: the relative response of the output, dimensionless.
    response: Mapping[str, float] = quantities(unit=DIMENSIONLESS)
    # The input whose contribution to the uncertainty it calls the largest; empty for none.
    largest_contribution: str = ""

    def __post_init__(self) -> None:
        validate(self)

    @property
    def moments(self) -> dict[str, float]:
        """Mean and standard deviation, as far as they are published."""
        moments = {"mean": self.mean, "std": self.std}
        return {name: value for name, value in moments.items() if value is not None}


@dataclass(frozen=True)
class Publication:
    """Publication, by its reference, with its estimates of some outputs."""

    source: str = text(expected="where the figures stand")
    estimates: tuple[PublishedEstimates, ...] = ()

    def __post_init__(self) -> None:
        validate(self)


def published_estimates(publication: Publication) -> dict[str, OutputStatistics]:
    """Return a publication's estimates by output and statistic, without intervals of ours."""
    from uqpen.statistics.sensitivity.input_measures import input_array

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
