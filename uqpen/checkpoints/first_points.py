"""First points of a design, for a comparison with runs that exist."""

from __future__ import annotations

import xarray as xr

from uqpen.core.arrays import Arrays
from uqpen.core.blocks import LoadedDataset
from uqpen.core.labels import RUN
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.rounds import first_round
from uqpen.study.study import ValidatedStudy

__all__ = ["first_points"]


def first_points(study: ValidatedStudy, design: str, model: str) -> Arrays:
    """Return the first points of a design, at most 65 536, as a model takes them.

    Returns
    -------
    mapping of str to ndarray, shape (run,)
        SI values by input.
    """
    stream = Stream(study.seed, "designs", design)
    drawn = first_round(study.designs[design], study.joint, stream)
    points = drawn.assign(study.models[model].given)
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    head = blocked.read(0, min(blocked.size, BLOCK))
    return {str(key): head[key].broadcast_like(head[RUN]).values for key in head.data_vars}
