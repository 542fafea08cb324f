"""Noise of a model in words: what was seen when runs were made again, and how much it is."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
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
    for each in _of_numbers(model):
        yield f"noise of {each.name}: {each.text}"


def is_little(model: xr.DataTree) -> bool:
    """Check that noise which was seen is of numbers, and a thousandth of the variance at most."""
    shares = [each.share for each in _of_numbers(model)]
    pairs = (read_group(model, NOISE, design) for design in group_names(model, NOISE))
    others = (x for each in pairs for x in each.data_vars.values() if not _is_number(x))
    return bool(shares) and max(shares) <= _LITTLE and not any(map(_varies, others))


# Share of the variance up to which noise changes no figure of a study visibly.
_LITTLE = 0.001


class _OfNumber(NamedTuple):
    """Noise of a number, from pairs of runs."""

    name: str
    units: Mapping[str, str]  # the attributes of the output
    pairs: int
    variance: float
    share: float  # of the variance of the output; not a number where that is not known

    @property
    def text(self) -> str:
        unit, pairs = shown_unit(self.units), count_text(self.pairs, "pair")
        shown = number_text(scale(unit).difference_from_si(math.sqrt(self.variance)), 2)
        text = f"a standard deviation of about {shown}{unit_suffix(unit)}, from {pairs} of runs"
        if math.isnan(self.share):
            return text
        little = f"less than {percent_text(_LITTLE)}"
        share = little if self.share < _LITTLE else f"some {percent_text(round(self.share, 2))}"
        return f"{text}: {share} of the variance"


def _of_numbers(model: xr.DataTree) -> Iterator[_OfNumber]:
    """Yield the noise of each number that differs between runs at the same inputs."""
    for design in group_names(model, NOISE):
        pairs, runs = read_group(model, NOISE, design), first_runs(model)
        ok = (pairs[STATUS].values == Status.OK).all(axis=1)
        for name, values in pairs.data_vars.items():
            if not _is_number(values):
                continue
            differences = np.diff(values.values[ok], axis=1)[:, 0]
            if differences.size < 2 or not differences.any():
                continue
            variance, of_all = float((differences**2).mean()) / 2, runs.get(name)
            whole = math.nan
            if of_all is not None and of_all.size > 1:
                whole = float(np.nanvar(of_all.values))
            share = variance / whole if whole > variance else math.nan
            yield _OfNumber(str(name), values.attrs, differences.size, variance, share)


def _is_number(values: xr.DataArray) -> bool:
    """Check for a number, and no status, category or field."""
    return values.dims == (RUN, REPEAT) and "display_units" in values.attrs


def _varies(values: xr.DataArray) -> bool:
    """Check that values of runs at the same inputs differ."""
    one, other = (values.isel({REPEAT: at}).values for at in (0, 1))
    return not np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
