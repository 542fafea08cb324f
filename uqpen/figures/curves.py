"""A distribution function, and its drawing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from uqpen.archive.estimates import interval_text
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL, NOTE
from uqpen.core.units import Scale
from uqpen.figures.panel import Axes
from uqpen.results.digits import percent_text
from uqpen.results.empirical_cdf import FEW_DISTINCT, SimultaneousBand
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.source_style import SourceStyle
from uqpen.results.texts import plain_text

__all__ = ["Curve", "draw_band", "draw_curve"]


# A thin line shows one rank in this many, and the first and the last.
_STRIDE = 4


@dataclass(frozen=True)
class Curve:
    """A distribution function of one source.

    Parameters
    ----------
    name : str
        Of the source, or the model.
    values : ndarray of shape (rank,)
        In the unit that is shown.
    band : ndarray of shape (rank, bound)
        The function there, with its simultaneous bounds for any outcome of failed runs.
    limits : SimultaneousBand
        The band around any other share of the runs.
    level : float
        Of the band; NaN without one.
    note : str
        Reason why there is no band.
    runs : int
        Number of its runs.
    is_stepped : bool
        True if steps can be seen, as there are few distinct values.
    """

    name: str
    values: FloatArray
    band: FloatArray
    limits: SimultaneousBand
    level: float
    note: str
    runs: int
    is_stepped: bool

    @classmethod
    def from_source(
        cls, name: str, statistics: SourceStatistics, source: str, output: str, measure: Scale
    ) -> Curve | None:
        """Return the function of an output, which is shown in the unit of a scale.

        None where the source has no such function, or none of its values is finite.
        """
        values = statistics.get(source, output, "cdf_value")
        band = statistics.get(source, output, "cdf_band")
        if values is None or band is None or not np.isfinite(values.values).any():
            return None
        limits = SimultaneousBand.from_estimates(band)
        runs = int(band.attrs.get("runs_used", 0))
        return cls(
            name,
            np.asarray(measure.from_si(values.values), dtype=np.float64),
            limits.around(np.asarray(band.values[:, 0], dtype=np.float64)),
            limits,
            float(band.attrs.get(INTERVAL_LEVEL, np.nan)),
            interval_text(band[0], NOTE),
            runs,
            runs < FEW_DISTINCT or np.unique(values.values).size < FEW_DISTINCT,
        )

    def extended(self, lower: float, upper: float) -> Curve:
        """Return the curve and its band continued to both ends of an axis."""
        values, band = self.values, self.band
        if lower < values[0]:
            values = np.concatenate([[lower], values])
            band = np.concatenate([self.limits.around(np.zeros(1)), band])
        if values[-1] < upper:
            values = np.concatenate([values, [upper]])
            band = np.concatenate([band, band[-1:]])
        return replace(self, values=values, band=band)

    def thinned(self) -> Curve:
        """Return the curve at fewer ranks, as a thin line needs no more."""
        if self.is_stepped:
            return self
        return replace(self, values=self.values[::_STRIDE], band=self.band[::_STRIDE])

    def complement(self) -> Curve:
        """Return the probabilities of exceeding its values."""
        return replace(self, band=1 - self.band)

    @property
    def has_band(self) -> bool:
        """True if the curve has a confidence band."""
        return bool(np.isfinite(self.band[:, 1:]).any())


def draw_curve(axes: Axes, curve: Curve, appearance: SourceStyle, *, is_thick: bool) -> None:
    """Draw a function, thick as the leading one or thin."""
    axes.plot(
        curve.values,
        curve.band[:, 0],
        color=appearance.colour,
        linestyle="-" if is_thick else appearance.line,
        linewidth=1.5 if is_thick else 0.9,
        drawstyle="steps-post" if curve.is_stepped else "default",
        label=plain_text(curve.name, 40),
    )


def draw_band(axes: Axes, curve: Curve, colour: str) -> Iterator[str]:
    """Draw the simultaneous band, or yield why there is none."""
    if not curve.has_band:
        reason = plain_text(curve.note or "no reason is known")
        yield f"no band of {plain_text(curve.name, 40)}: {reason}"
        return
    axes.fill_between(
        curve.values,
        curve.band[:, 1],
        curve.band[:, 2],
        step="post" if curve.is_stepped else None,
        color=colour,
        alpha=0.35,
        linewidth=0,
        label=f"simultaneous {percent_text(curve.level)} band of {plain_text(curve.name, 40)}",
    )
