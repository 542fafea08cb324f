"""Notes below charts, which tell what is drawn and nothing else."""

import numpy as np
import xarray as xr

from uqpen.charts.marks import hollow_note, interval_notes

NONE = np.nan


def figure(*bounds, level):
    return xr.DataArray(list(bounds), dims="bound", attrs={"interval_level": level})


def test_levels_are_reported_of_intervals_that_there_are():
    reported = [
        figure(1, 0.5, 1.5, level=0.95),
        figure(2, NONE, 2.5, level=0.9),
        figure(3, NONE, NONE, level=0.8),
        figure(1, 0.9, 1.1, level=0.95),
    ]
    assert list(interval_notes(reported)) == ["Bars: 90 % intervals.", "Bars: 95 % intervals."]
    assert list(interval_notes(reported[2:3])) == []


def test_what_is_no_estimate_is_not_hollow():
    rows = np.array([[1, 0.5, 1.5], [NONE, NONE, NONE]])
    assert list(hollow_note(rows)) == []
    rows[1, 0] = 2
    assert list(hollow_note(rows)) == ["Hollow: no interval; the table gives the reason."]
