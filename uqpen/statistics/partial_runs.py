"""Sample from the first runs of a design that is still being run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import FAILED_RUN, REPLICATE, RUN, SAMPLING
from uqpen.core.sampling import Sampling
from uqpen.statistics.convergence import reason_without_parts

_IN_BLOCKS = "its points form blocks, and a part of them is no sample of the inputs"
_NO_REPLICATE = (
    "it has fewer than two complete replicates, and a part of a stratified set is no such set"
)
# Fewer draws say little, and the interval of a mean relies on more.
_FEWEST = 20
_FEW = f"fewer than {_FEWEST} of its first runs are finished"


class SampleSoFar(NamedTuple):
    """First runs that are a sample as the whole design will be, or why there are none yet."""

    runs: xr.Dataset | None  # the runs; None where there is a reason
    reason: str = ""  # empty where there are runs


def first_runs(finished: xr.Dataset) -> xr.Dataset:
    """Return the runs before the first that is not finished.

    A run that takes long is finished late. So slow runs are too rare among the finished runs of
    several workers, but not among the first runs.

    Parameters
    ----------
    finished : Dataset
        The finished runs of a round with their numbers along ``run``, in ascending order.
    """
    numbers = finished[RUN].values
    end = int(np.cumprod(numbers == np.arange(numbers.size)).sum())
    first = finished.isel({RUN: slice(end)})
    if FAILED_RUN not in finished:
        return first
    return first.isel({FAILED_RUN: finished[FAILED_RUN].values < end})


def sample_so_far(runs: xr.Dataset, *, is_complete: bool) -> SampleSoFar:
    """Return the first runs of a design as a sample, or the reason why they are none.

    Of a design of replicates, this is those that are complete.

    Parameters
    ----------
    runs : Dataset
        The result of `first_runs`, with the attribute on the sampling of the design.
    is_complete : bool
        Whether these are all runs of the design.
    """
    sampling = Sampling(runs.attrs[SAMPLING])
    if is_complete:
        reason = "" if sampling.is_sample else reason_without_parts(runs)
        return SampleSoFar(None, reason) if reason else SampleSoFar(runs)
    if sampling is Sampling.PICK_FREEZE:
        return SampleSoFar(None, _IN_BLOCKS)
    if not runs.sizes[RUN]:
        return SampleSoFar(None, _FEW)
    if not sampling.is_sample or sampling is Sampling.GIVEN:
        return SampleSoFar(None, reason_without_parts(runs))
    if sampling is Sampling.INDEPENDENT:
        is_enough = runs.sizes[RUN] >= _FEWEST
        return SampleSoFar(runs) if is_enough else SampleSoFar(None, _FEW)
    if REPLICATE not in runs.coords:
        return SampleSoFar(None, reason_without_parts(runs))
    # One may not be complete. Where replicates grow, those before it are larger than those behind.
    replicates, sizes = np.unique(runs[REPLICATE].values, return_counts=True)
    shared, times = np.unique(sizes, return_counts=True)
    complete = replicates[sizes == shared[(shared * times).argmax()]]
    if len(complete) < 2:
        return SampleSoFar(None, _NO_REPLICATE)
    return SampleSoFar(runs.isel({RUN: np.isin(runs[REPLICATE].values, complete)}))
