"""The response of an output to each input near the nominal point."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from uqpen.figures.measures import measure_series, measures_panel
from uqpen.figures.panel import Panel
from uqpen.results.archive_view import ArchiveView

__all__ = ["RESPONSES", "magnitudes", "response_panels"]

FloatArray = npt.NDArray[np.float64]

RESPONSES = (
    ("response", "response", "|response| [%]"),
    ("contribution", "response × uncertainty", "|response × uncertainty| [%]"),
)


def response_panels(view: ArchiveView) -> Iterator[Panel]:
    """Relative responses to the inputs, and × uncertainty."""
    for output in view.numeric_outputs:
        for name, label, axis in RESPONSES:
            if found := measure_series(view, output, ((name, "", "o"),)):
                title = view.title(f"{output}: {label}")
                yield measures_panel(view, title, axis, found, magnitudes)


def magnitudes(bounds: FloatArray) -> FloatArray:
    """In per cent; of a negative estimate the bounds change their places."""
    if bounds[0] < 0:
        bounds = -bounds[[0, 2, 1]]
    return 100 * bounds
