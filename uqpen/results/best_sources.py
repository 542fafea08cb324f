"""The sources of indices to show: a plain sample only where no other source has them."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import RUNS, SAMPLING
from uqpen.core.sampling import Sampling

__all__ = ["best_sources", "is_sample_design"]


def is_sample_design(tree: xr.DataTree, source: str) -> bool:
    """Return whether a source is a design for no quantity of interest in particular.

    Parameters
    ----------
    tree : DataTree
        What an archive has of one model.
    source : str
        The name of a design, surrogate or publication.
    """
    runs = read_group(tree, RUNS, source)
    if not runs:
        return False
    sampling = Sampling(runs.attrs[SAMPLING])
    return sampling.is_sample and sampling is not Sampling.PICK_FREEZE


def best_sources(tree: xr.DataTree, runs: Mapping[str, int]) -> list[str]:
    """Return the sources whose indices of an output are shown.

    Parameters
    ----------
    tree : DataTree
        What an archive has of one model.
    runs : mapping of str to int
        The sources that have indices, and how many runs these are of.

    Returns
    -------
    list of str
        All but plain samples. Where there are only these, the largest of them, the first of equals.
    """
    dedicated = [source for source in runs if not is_sample_design(tree, source)]
    if dedicated or not runs:
        return dedicated
    return [max(runs, key=lambda source: runs[source])]
