"""Univariate basis: polynomials that are orthonormal for the distribution of one input.

They are functions of a standardised variable: the input itself or its logarithm, shifted and
scaled so that its size is about one. A normal distribution has Hermite's polynomials, a uniform one
Legendre's, a gamma distribution Laguerre's and a beta distribution Jacobi's; any other distribution
has polynomials of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Input
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.surrogates.storage import describe

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["UnivariateBasis", "univariate_basis"]


_LINEAR, _LOGARITHM = "linear", "logarithm"


@dataclass(frozen=True, eq=False)
class UnivariateBasis:
    """Standardised variable of an input, and the recurrence of the polynomials in it.

    With ξ = (x - location) / scale, x the input or its logarithm, the orthonormal polynomials are
    √b_{n+1} p_{n+1} = (ξ - a_n) p_n - √b_n p_{n-1}, from p_0 = 1.

    Parameters
    ----------
    name : str
        The input's.
    is_logarithm : bool
        Whether x is the input's logarithm.
    location, scale : float
        Parameters of the standardised variable ξ of x.
    centres, ratios : ndarray, shape (degree + 1,)
        a_n and b_n from n = 0; b_0 is 1 and has no meaning.
    """

    name: str
    is_logarithm: bool
    location: float
    scale: float
    centres: FloatArray
    ratios: FloatArray

    @property
    def highest_degree(self) -> int:
        """Highest degree of the polynomials."""
        return len(self.ratios) - 1

    def polynomials(self, values: FloatArray, degree: int) -> FloatArray:
        """Evaluate the polynomials up to a degree, shape (degree + 1, run).

        Parameters
        ----------
        values : ndarray, shape (run,)
            In the input's SI unit; the result is NaN where the logarithm does not exist.
        degree : int
            At most `highest_degree`.
        """
        # Contiguous, so that NumPy's logarithm takes the same path for every batch.
        x = np.ascontiguousarray(values, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.log(x) if self.is_logarithm else x
        xi = (x - self.location) / self.scale
        roots = np.sqrt(self.ratios)
        table = np.ones((degree + 1, len(xi)))
        for n in range(degree):
            following = (xi - self.centres[n]) * table[n]
            if n:
                following -= roots[n] * table[n - 1]
            table[n + 1] = following / roots[n + 1]
        return table

    def to_variable(self, variable: Input) -> tuple[tuple[str, str], FloatArray, dict[str, Any]]:
        """Return dimensions, values and attributes of a variable of an archive."""
        attributes = {
            "long_name": f"recurrence coefficients of the polynomials in {variable.title}",
            "units": "1",
            "germ": _LOGARITHM if self.is_logarithm else _LINEAR,
            "location": self.location,
            "scale": self.scale,
            **describe(variable, "of_"),
        }
        dimensions = (f"{self.name}_coefficient", f"{self.name}_degree")
        return dimensions, np.stack([self.centres, self.ratios]), attributes

    @classmethod
    def from_variable(cls, name: str, array: xr.DataArray) -> UnivariateBasis:
        """Restore it from `to_variable`."""
        centres, ratios = np.asarray(array.values, dtype=np.float64)
        is_logarithm = array.attrs["germ"] == _LOGARITHM
        location, scale = float(array.attrs["location"]), float(array.attrs["scale"])
        return cls(name, is_logarithm, location, scale, centres, ratios)


def univariate_basis(
    name: str, distribution: Distribution, degree: int, *, logarithms: bool = True
) -> UnivariateBasis:
    """Build the univariate basis of an input, with polynomials up to a degree.

    Parameters
    ----------
    name : str
        The input's.
    distribution : Distribution
        Its distribution; one on a few values has fewer polynomials.
    degree : int
        The highest.
    logarithms : bool
        Whether an input is replaced by its logarithm where that has a simpler distribution.
    """
    of_logarithm = distribution.logarithm() if logarithms else None
    found = recurrence(of_logarithm or distribution, degree)
    is_usable = np.isfinite(found.alpha) & np.isfinite(found.beta) & (found.beta > 0)
    usable = len(is_usable) if is_usable.all() else int(is_usable.argmin())
    return UnivariateBasis(
        name=name,
        is_logarithm=of_logarithm is not None,
        location=found.location,
        scale=found.scale,
        centres=found.alpha[:usable],
        ratios=found.beta[:usable],
    )
