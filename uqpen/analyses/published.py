"""Figures from elsewhere, in the same groups as our own so that they stand beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import xarray as xr

from uqpen.analyses.estimate import Estimate
from uqpen.analyses.given_inputs import along_inputs
from uqpen.labels import INPUT, LARGEST_CONTRIBUTION, MOMENTS, SENSITIVITY
from uqpen.model import Output

__all__ = ["Published", "PublishedFigures", "published"]


@dataclass(frozen=True)
class PublishedFigures:
    """What a publication says of one output.

    Parameters
    ----------
    output : Output
        Of which.
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
class Published:
    """A publication whose figures a study is compared with.

    Parameters
    ----------
    source : str
        Where they stand.
    figures : tuple of PublishedFigures
        One for each output that it tells of.
    """

    source: str
    figures: tuple[PublishedFigures, ...]


def published(publication: Published) -> dict[str, xr.Dataset]:
    """A publication's figures as groups of an archive, each figure without an interval of ours."""
    reason = f"published in {publication.source}"
    moments: dict[str, xr.DataArray] = {}
    sensitivity: dict[str, xr.DataArray] = {}
    attributes = {"source": publication.source}
    claims = {}
    for figures in publication.figures:
        name, title = figures.output.name, figures.output.title
        for moment, value in figures.moments.items():
            estimate = Estimate.without_bounds(value, reason)
            moments[f"{name}_{moment}"] = estimate.to_array(
                units=figures.output.unit, long_name=f"{moment} of {title}, published"
            )
        if figures.response:
            variable = f"{name}_response"
            estimates = [Estimate.without_bounds(v, reason) for v in figures.response.values()]
            described = f"relative response of {title}, published"
            array = Estimate.stack(estimates, INPUT, units="1", long_name=described, name=variable)
            sensitivity[variable] = array.assign_coords(along_inputs(list(figures.response)))
        if figures.largest_contribution:
            claims[f"{name}_{LARGEST_CONTRIBUTION}"] = figures.largest_contribution
    groups = {
        MOMENTS: xr.Dataset(moments, attrs=attributes),
        SENSITIVITY: xr.Dataset(sensitivity, attrs=attributes | claims),
    }
    return {name: group for name, group in groups.items() if group or len(group.attrs) > 1}
