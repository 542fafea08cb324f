"""The inputs' part in an output as JSON."""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.core.labels import BOUND, INPUT, PAIR, SUFFIXES
from uqpen.results.estimate_json import estimate_json

__all__ = ["sensitivity_json"]

Figures = dict[str, dict[str, Any]]

# Keys of measures that are told of each of several events, what their names have before the
# measure, and the end of the dimension that the events lie along.
_EVENTS = (
    ("sensitivity_of_exceedance", "exceedance", "threshold"),
    ("sensitivity_of_shares", "category", "category"),
)


def sensitivity_json(answers: xr.Dataset, output: str) -> dict[str, Any]:
    """All measures that a source tells of an output; nothing for none.

    Parameters
    ----------
    answers : Dataset
        The source's group of sensitivity.
    output : str
        Which output.

    Returns
    -------
    dict
        ``sensitivity.<input>.<measure>``; ``sensitivity_of_exceedance.<threshold>`` and
        ``sensitivity_of_shares.<kind>`` likewise; ``sensitivity_of_pairs.<pair>.second_order``.
    """
    found: dict[str, Any] = {"sensitivity": _output_measures(answers, output)}
    for key, infix, ending in _EVENTS:
        found[key] = _event_measures(answers, f"{output}_{infix}_", f"{output}_{ending}")
    found["sensitivity_of_pairs"] = _pair_measures(answers, f"{output}_second_order")
    return {key: figures for key, figures in found.items() if figures}


def _output_measures(answers: xr.Dataset, output: str) -> Figures:
    """Each input's part in an output, by input and measure."""
    found: Figures = {}
    for variable, array in answers.data_vars.items():
        measure = str(variable).removeprefix(f"{output}_")
        if measure == variable or measure not in SUFFIXES or array.dims != (INPUT, BOUND):
            continue
        for position, name in enumerate(array[INPUT].values):
            found.setdefault(str(name), {})[measure] = estimate_json(array[position])
    return found


def _event_measures(answers: xr.Dataset, stem: str, dimension: str) -> dict[str, Figures]:
    """Each input's part in each of several events, by event, input and measure."""
    found: dict[str, Figures] = {}
    for variable, array in answers.data_vars.items():
        if not str(variable).startswith(stem) or array.dims != (dimension, INPUT, BOUND):
            continue
        measure = str(variable).removeprefix(stem)
        for row, event in enumerate(array[dimension].values):
            of_event = found.setdefault(str(event), {})
            for column, name in enumerate(array[INPUT].values):
                of_event.setdefault(str(name), {})[measure] = estimate_json(array[row, column])
    return found


def _pair_measures(answers: xr.Dataset, variable: str) -> Figures:
    """What pairs of inputs do together."""
    if variable not in answers:
        return {}
    array = answers[variable]
    return {
        str(pair): {"second_order": estimate_json(array[position])}
        for position, pair in enumerate(array[PAIR].values)
    }
