"""The sources of indices to show: a plain sample only where no other source has them as well."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import RUNS, SAMPLING
from uqpen.core.sampling import Sampling

__all__ = ["best_sources", "is_sample_design"]


def is_sample_design(tree: xr.DataTree, source: str) -> bool:
    """Return whether a source of a model is a design for no quantity of interest in particular."""
    runs = read_group(tree, RUNS, source)
    if not runs:
        return False
    sampling = Sampling(runs.attrs[SAMPLING])
    return sampling.is_sample and sampling is not Sampling.PICK_FREEZE


def best_sources(tree: xr.DataTree, found: Iterable[tuple[str, xr.DataArray]]) -> list[str]:
    """Return the sources whose indices of an output are shown: all but plain samples.

    Where there are only these, or no other has a value, the largest of them is shown, the first of
    equals. Where no other has an interval, the largest of those that have one is shown beside them.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    found : iterable of tuple
        A source and an array of its indices, which has their number of runs.
    """
    runs: dict[str, int] = {}
    with_values, with_intervals = set(), set()
    for source, array in found:
        runs.setdefault(source, int(array.attrs.get("runs", 0)))
        if np.isfinite(array.values).any():
            with_values.add(source)
        if np.isfinite(array.values[..., 1:]).any():
            with_intervals.add(source)
    samples = [source for source in runs if is_sample_design(tree, source)]
    dedicated = [source for source in runs if source not in samples]
    if not with_intervals.isdisjoint(dedicated):
        return dedicated
    if not with_values.isdisjoint(dedicated):
        samples = [source for source in samples if source in with_intervals]
    # Those without a value stay, as they say why.
    return dedicated + sorted(samples, key=lambda source: -runs[source])[:1]
