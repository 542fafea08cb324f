"""Runs as a dataset: points and results, with attributes by the CF conventions."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.coordinates import field_coordinates
from uqpen.core.labels import (
    ABSENT,
    CURVE_MAY_END,
    DERIVED_FROM,
    FAILED_RUN,
    FAILURE_REASON,
    REPLICATE,
    ROLE,
    RUN,
    STATUS,
    WEIGHT,
)
from uqpen.core.model import Category, Model, Output
from uqpen.core.status import Status

__all__ = ["runs_dataset"]

_END = {"comment": CURVE_MAY_END}


def runs_dataset(
    points: xr.Dataset,
    results: Mapping[str, Any],
    model: Model,
    display_units: Mapping[str, str],
) -> xr.Dataset:
    """Return points with the results of their runs.

    Parameters
    ----------
    points : Dataset
        A variable for each input.
    results : mapping of str to tuple
        Variables of the results: outputs, statuses and reasons of failed runs.
    model : Model
        The model that made the runs.
    display_units : mapping of str to str
        The unit to show an input or output in, where it is not the model's own.
    """
    dims = itertools.chain.from_iterable(output.dims for output in model.outputs)
    runs = points.assign(results).assign_coords(field_coordinates(dims))
    _add_attributes(runs, model, display_units)
    return runs


def _add_attributes(runs: xr.Dataset, model: Model, display_units: Mapping[str, str]) -> None:
    """Add attributes to every variable, following the CF conventions."""
    # As an array each would take time by the number of all variables.
    stored = runs.variables
    for role, variables in (("input", model.inputs), ("output", model.all_outputs)):
        for variable in variables:
            if variable.name in stored:
                shown = display_units.get(variable.name, variable.preferred_unit)
                measure = {"units": variable.unit, "display_units": shown}
                categories = variable.categories if isinstance(variable, Output) else ()
                stored[variable.name].attrs |= {
                    "long_name": variable.title,
                    ROLE: role,
                    **(_category_attributes(categories) if categories else measure),
                    **(_END if isinstance(variable, Output) and variable.may_end else {}),
                }
    for derived in model.derived:
        absent = {ABSENT: derived.output.absent} if derived.output.absent else {}
        runs[derived.output.name].attrs |= {DERIVED_FROM: derived.source, **absent}
    runs[STATUS].attrs = {"long_name": "what became of the run"}
    runs[STATUS].attrs |= _flag_attributes(list(Status), [status.meaning for status in Status])
    number = {"units": "1", "long_name": "number of the run"}
    runs[RUN].attrs = {"standard_name": "realization", **number}
    if WEIGHT in runs.coords:
        runs[WEIGHT].attrs = {"units": "1", "long_name": "relative weight of the run"}
    if REPLICATE in runs:
        runs[REPLICATE].attrs = {"units": "1", "long_name": "number of the run's replicate"}
    if FAILED_RUN in runs:
        runs[FAILED_RUN].attrs = {"long_name": "number of a lost run"}
        runs[FAILURE_REASON].attrs = {"long_name": "why the run was lost"}


def _category_attributes(categories: Sequence[Category]) -> dict[str, Any]:
    """Return the attributes of a categorical output; failed runs have a category of their own."""
    meanings = ["lost", *(category.flag for category in categories)]
    labels = ["lost", *(category.label for category in categories)]
    return {**_flag_attributes(range(-1, len(categories)), meanings), "flag_labels": labels}


def _flag_attributes(values: Sequence[int], meanings: Sequence[str]) -> dict[str, Any]:
    return {"flag_values": np.array(values, dtype=np.int8), "flag_meanings": " ".join(meanings)}
