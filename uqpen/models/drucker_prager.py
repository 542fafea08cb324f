"""A target whose yield limit rises with pressure, and the cavity expansion in it.

The numbers in brackets are those of the equations in docs/drucker_prager.md.

References
----------
Bishop, R. F., Hill, R. & Mott, N. F. (1945). Proc. Phys. Soc. 57, 147-159: cavity expansion.
Drucker, D. C. & Prager, W. (1952). Quart. Appl. Math. 10, 157-165: yield limit and pressure.
Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48: the momentum balance.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray

__all__ = ["effective_yield_limit", "plastic_extent"]


def plastic_extent(
    crater_radius: FloatArray, yield_limit: FloatArray, shear_modulus: FloatArray
) -> FloatArray:
    """Return the outer radius S of plastic flow around a cavity opened from nothing, m.

    Parameters
    ----------
    crater_radius : ndarray, shape (run,)
        R, m.
    yield_limit : ndarray
        At zero pressure, Y0, Pa.
    shear_modulus : ndarray
        G, Pa, above Y0/6.
    """
    strain = yield_limit / (6 * shear_modulus)  # (8)
    return crater_radius / special.cbrt(strain * (3 - strain * (3 - strain)))  # (9)


def effective_yield_limit(
    logarithm: FloatArray, lowest: FloatArray, highest: FloatArray, slope: FloatArray
) -> FloatArray:
    """Return the constant yield limit with the same resistance, Pa.

    Parameters
    ----------
    logarithm : ndarray, shape (run,)
        ln(S/R).
    lowest, highest : ndarray
        Yield limit at zero pressure and at high pressure, Y0 ≤ Y1, Pa.
    slope : ndarray
        Its rise per pressure between them, k.
    """
    growth = 7 * slope / (3 + 2 * slope)  # (5)
    # From the outer boundary inwards the limit rises over this part of ln(S/R).
    ratio = special.log1p((highest - lowest) / lowest)
    with np.errstate(divide="ignore", invalid="ignore"):
        rising = np.fmin(logarithm, ratio / growth)
    mean = lowest * special.exprel(growth * rising)  # (6)
    return (mean * rising + highest * (logarithm - rising)) / logarithm  # (7)
