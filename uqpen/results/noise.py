"""Noise of a model in words: what was seen when runs were made again, and how much it is."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import NOISE, REPEAT, RUN, STATUS
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.results.digits import count_text, number_text, percent_text
from uqpen.results.table import first_runs, shown_unit
from uqpen.results.texts import unit_suffix

# What begins the text of a model whose runs were the same.
_SAME = "equal bits"


def noise_text(model: xr.DataTree) -> str:
    """Return what was seen of the noise of a model; empty where its runs were the same."""
    text = str(model.attrs.get(NOISE, ""))
    return "" if text.startswith(_SAME) else text


def noise_lines(model: xr.DataTree) -> Iterator[str]:
    """Yield what was seen of the noise of a model, and of each number how much it is."""
    if text := noise_text(model):
        yield f"noise of the model: {text.removeprefix('noise: ')}"
    for design in group_names(model, NOISE):
        pairs, runs = read_group(model, NOISE, design), first_runs(model)
        for name in pairs.data_vars:
            values = pairs[name]
            is_number = values.dims == (RUN, REPEAT) and "display_units" in values.attrs
            if not is_number:  # a status, a category, a field
                continue
            ok = (pairs[STATUS].values == Status.OK).all(axis=1)
            differences = np.diff(values.values[ok], axis=1)[:, 0]
            if differences.size < 2 or not differences.any():
                continue
            yield f"noise of {name}: {_amount(values.attrs, differences, runs.get(name))}"


def _amount(attributes: dict[str, str], differences: FloatArray, runs: xr.DataArray | None) -> str:
    """Return the standard deviation of noise in words, and its share of the variance."""
    unit, pairs = shown_unit(attributes), count_text(len(differences), "pair")
    variance = float((differences**2).mean()) / 2
    shown = number_text(scale(unit).difference_from_si(math.sqrt(variance)), 2)
    text = f"a standard deviation of about {shown}{unit_suffix(unit)}, from {pairs} of runs"
    whole = math.nan if runs is None or runs.size < 2 else float(np.nanvar(runs.values))
    if not whole > variance:
        return text
    return f"{text}: some {percent_text(round(variance / whole, 2))} of the variance"
