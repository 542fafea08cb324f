"""Predictions of a surrogate at the inputs of failed runs, as a table of its own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.labels import (
    MISSING_BEYOND,
    MISSING_HIGHEST,
    MISSING_LOWEST,
    MISSING_PREDICTED,
    MISSING_SHARES,
    SURROGATES,
)
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.surrogate_fits import fitted_outputs
from uqpen.results.table import NOTHING, OutputTable, first_runs, label_with_unit

__all__ = ["missing_run_tables"]

_NO_RESULTS = "these are predictions of the surrogate, not results"


def missing_run_tables(tree: xr.DataTree, surrogate: str) -> Iterator[OutputTable]:
    """Yield the table of a surrogate's predictions at the inputs of failed runs, if there are any.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    surrogate : str
        Its name.
    """
    made, runs = tree.children[SURROGATES].children[surrogate], first_runs(tree)
    title = f"{surrogate}: predictions at the inputs of failed runs of {made.attrs['design']}"
    table = OutputTable(title, ["runs", "from", "to", "beyond"])
    for output in fitted_outputs(made):
        found = made.children[output].attrs
        if MISSING_PREDICTED not in found:
            continue
        unit = str(runs[output].attrs.get("display_units", DIMENSIONLESS))
        ends = scale(unit).from_si(np.array([found[MISSING_LOWEST], found[MISSING_HIGHEST]]))
        note = table.note_mark(_NO_RESULTS)
        predicted = int(found[MISSING_PREDICTED])
        count = grouped_number(predicted)
        cells = [f"{count}{note}", *(number_text(end) for end in ends), NOTHING]
        table.rows.append((label_with_unit(output, unit), cells))
        shares = np.atleast_1d(found.get(MISSING_SHARES, [])).tolist()
        beyond = np.atleast_1d(found.get(MISSING_BEYOND, [])).tolist()
        for text, share in zip(beyond, shares, strict=True):
            label = f"{output} {text}"
            number = f"{grouped_number(round(share * predicted))} of {count}"
            table.rows.append((label, [NOTHING, NOTHING, NOTHING, number]))
    if table.rows:
        yield table
