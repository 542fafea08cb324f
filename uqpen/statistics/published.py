"""Figures from elsewhere, in the same groups as our own so that they stand beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import xarray as xr

from uqpen.core.labels import INPUT, LARGEST_CONTRIBUTION, MOMENTS, SENSITIVITY
from uqpen.core.model import Output
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.sensitivity.input_measures import input_names_coordinate

__all__ = ["Publication", "PublishedEstimates", "published_estimates"]


@dataclass(frozen=True)
class PublishedEstimates:
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
class Publication:
    """A publication whose figures a study is compared with.

    Parameters
    ----------
    source : str
        Where they stand.
    estimates : tuple of PublishedEstimates
        One for each output that it tells of.
    """

    source: str
    estimates: tuple[PublishedEstimates, ...]


def published_estimates(publication: Publication) -> dict[str, xr.Dataset]:
    """A publication's figures as groups of an archive, each figure without an interval of ours."""
    reason = f"published in {publication.source}"
    moments: dict[str, xr.DataArray] = {}
    sensitivity: dict[str, xr.DataArray] = {}
    attributes = {"source": publication.source}
    claims = {}
    for output_estimates in publication.estimates:
        name, title = output_estimates.output.name, output_estimates.output.title
        for moment, value in output_estimates.moments.items():
            estimate = Estimate.without_bounds(value, reason)
            moments[f"{name}_{moment}"] = estimate.to_array(
                units=output_estimates.output.unit, long_name=f"{moment} of {title}, published"
            )
        if output_estimates.response:
            variable = f"{name}_response"
            estimates = [
                Estimate.without_bounds(v, reason) for v in output_estimates.response.values()
            ]
            described = f"relative response of {title}, published"
            array = Estimate.stack(estimates, INPUT, units="1", long_name=described, name=variable)
            sensitivity[variable] = array.assign_coords(
                input_names_coordinate(list(output_estimates.response))
            )
        if output_estimates.largest_contribution:
            claims[f"{name}_{LARGEST_CONTRIBUTION}"] = output_estimates.largest_contribution
    groups = {
        MOMENTS: xr.Dataset(moments, attrs=attributes),
        SENSITIVITY: xr.Dataset(sensitivity, attrs=attributes | claims),
    }
    return {name: group for name, group in groups.items() if group or len(group.attrs) > 1}
