"""Intervals of a design whose runs decided their own number: those not certified get a note."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqpen.core.labels import BOUND, INTERVAL_LABEL, NOTE, STOPPING_STATISTICS
from uqpen.statistics import texts

__all__ = ["mark_uncertified"]

_Statistics = dict[str, xr.DataArray]


def mark_uncertified(
    outputs: Mapping[str, _Statistics], attributes: Mapping[str, Any]
) -> dict[str, _Statistics]:
    """Add a note to each interval whose statistic did not decide the number of runs.

    Parameters
    ----------
    outputs : mapping
        By output, estimate arrays by statistic.
    attributes : mapping
        Of the runs. Without the statistics of a stopping rule, nothing is marked.
    """
    certified = _certified(attributes.get(STOPPING_STATISTICS))
    if certified is None:
        return dict(outputs)
    return {
        output: {
            name: _marked(array, [each[2] for each in certified if each[:2] == [output, name]])
            for name, array in statistics.items()
        }
        for output, statistics in outputs.items()
    }


def _marked(array: xr.DataArray, certified: list[Any]) -> xr.DataArray:
    """Return an estimate array with the note at its intervals, but for entries of some labels."""
    if BOUND not in array.dims or INTERVAL_LABEL not in array.coords:
        return array
    is_marked = array.coords[INTERVAL_LABEL].values != "none"
    if array.ndim == 1:
        is_marked = is_marked & (not certified)
    elif certified:
        labels = array.coords[array.dims[0]].values.tolist()
        is_marked = is_marked & [label not in certified for label in labels]
    own = array.coords[NOTE]
    notes = own.values.copy()
    marked = {
        note: "; ".join(filter(None, [note, texts.NUMBER_DECIDED_BY_RUNS]))
        for note in set(notes[is_marked].tolist())
    }
    notes[is_marked] = [marked[note] for note in notes[is_marked].tolist()]
    return array.assign_coords({NOTE: (own.dims, notes)})


def _certified(written: object) -> list[list[Any]] | None:
    """Return output, statistic and label of each certified estimate; None for a fixed number.

    The attribute may come from any file: what cannot be read certifies nothing.
    """
    if written is None:
        return None
    try:
        entries = json.loads(str(written))
    except ValueError:
        return []
    entries = entries if isinstance(entries, list) else []
    return [each for each in entries if isinstance(each, list) and len(each) == 3]
