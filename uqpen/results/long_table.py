"""All estimates of an archive as one long table."""

from __future__ import annotations

import pandas as pd
import xarray as xr

from uqpen.archive.read import group_names, model_trees
from uqpen.core.labels import DIFFERENCES
from uqpen.results.estimate_rows import rows_frame
from uqpen.results.source_statistics import SourceStatistics

__all__ = ["long_table"]


def long_table(tree: xr.DataTree, *, functions: bool = False) -> pd.DataFrame:
    """Return the estimates of all models of an archive, and of the differences between them.

    Parameters
    ----------
    tree : DataTree
        An archive of a study.
    functions : bool
        Whether to list distribution functions, percentiles and convergence as well.

    Returns
    -------
    DataFrame
        The columns of `SourceStatistics.to_frame`. The model is empty where an archive has one
        alone and for the shares of model form, and such as ``fine minus coarse`` for a difference.

    Examples
    --------
    >>> tree = uqpen.open_archive("archives/rods.nc")  # doctest: +SKIP
    >>> table = long_table(tree)  # doctest: +SKIP
    >>> means = table[table["statistic"] == "mean"]  # doctest: +SKIP
    >>> means.pivot(index="output", columns="source")["estimate"]  # doctest: +SKIP
    """
    rows = [
        row
        for name, model in model_trees(tree).items()
        for row in SourceStatistics(model).rows(name, functions=functions)
    ]
    for other in group_names(tree, DIFFERENCES):
        differences = SourceStatistics.of_differences(tree, other)
        rows += differences.rows(other, functions=functions)
    rows += SourceStatistics.of_model_form(tree).rows(functions=functions)
    return rows_frame(rows)
