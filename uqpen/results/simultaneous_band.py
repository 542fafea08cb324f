"""Simultaneous band of a distribution function, for any outcome of the failed runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.status import Status

__all__ = ["SimultaneousBand"]


@dataclass(frozen=True)
class SimultaneousBand:
    """Band around the share of the completed runs at or below each value.

    The estimate is of the completed runs. A failed run could have had any result, so for the lower
    end all of them lie above the value, and for the upper end all at or below it. The half-width is
    that of as many runs as there are of both. Requested probabilities allow for failed runs in the
    same way.

    Parameters
    ----------
    half_width : float
        Over the completed runs; NaN where no band is known.
    missing_share : float
        Share of the failed runs among the admissible ones, from 0 to below 1.

    Notes
    -----
    The two ends are functions of all n runs: with every failed run at plus infinity, and with every
    one at minus infinity. The one-sided inequality of Dvoretzky, Kiefer and Wolfowitz with
    Massart's constant (1990, Ann. Probab. 18, 1269-1283) holds for each, with a half-width that
    falls with the root of n. So the band covers with at least its level.
    """

    half_width: float
    missing_share: float = 0.0

    @classmethod
    def from_estimates(cls, band: xr.DataArray) -> SimultaneousBand:
        """Return the band of an archive's ``cdf_band``, which is of the completed runs alone.

        Parameters
        ----------
        band : DataArray
            Along ``rank`` and ``bound``, with at least one rank; the same width at all of them.
            Its attributes count the runs.
        """
        estimate, lower, _ = band.values[-1]
        # Nearest to 1 no probability cuts the lower side off.
        return cls(float(estimate - lower), _missing_share(band.attrs))

    def around(self, share: FloatArray) -> FloatArray:
        """Return the band around shares of the completed runs.

        Parameters
        ----------
        share : ndarray
            From 0 to 1.

        Returns
        -------
        ndarray, shape (..., bound)
            The share itself, and the ends of the band, which are NaN where none is known.
        """
        kept = 1.0 - self.missing_share
        half = self.half_width * math.sqrt(kept)
        lower = np.maximum(kept * share - half, 0.0)
        upper = np.minimum(kept * share + self.missing_share + half, 1.0)
        return np.stack([share, lower, upper], axis=-1)


def _missing_share(counts: Mapping[Any, Any]) -> float:
    """Return the share of failed runs among the admissible ones, from an estimate's attributes."""
    used = int(counts.get("runs_used", 0))
    inadmissible = int(counts.get(f"runs_{Status.INADMISSIBLE.meaning}", 0))
    admissible = int(counts.get("runs", used)) - inadmissible
    return 1 - used / admissible if used else 0.0
