"""How an output responds to each input near the nominal point."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from uqpen.figures.measures import panel_of, series
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part

__all__ = ["RESPONSES", "magnitudes", "responses"]

FloatArray = npt.NDArray[np.float64]

RESPONSES = (
    ("response", "response", "|response| [%]"),
    ("contribution", "response × uncertainty", "|response × uncertainty| [%]"),
)


def responses(part: Part) -> Iterator[Panel]:
    """Relative responses to the inputs, and × uncertainty."""
    for output in part.numbers:
        for suffix, label, axis in RESPONSES:
            if found := series(part, output, ((suffix, "", "o"),)):
                title = part.titled(f"{output}: {label}")
                yield panel_of(part, title, axis, found, magnitudes)


def magnitudes(bounds: FloatArray) -> FloatArray:
    """In per cent; of a negative estimate the bounds change their places."""
    if bounds[0] < 0:
        bounds = -bounds[[0, 2, 1]]
    return 100 * bounds
