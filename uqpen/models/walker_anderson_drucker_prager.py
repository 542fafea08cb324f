"""The Walker-Anderson model in a target whose yield limit rises with pressure.

The numbers in brackets are those of the equations in docs/drucker_prager.md.

References
----------
Bishop, R. F., Hill, R. & Mott, N. F. (1945). Proc. Phys. Soc. 57, 147-159: cavity expansion.
Drucker, D. C. & Prager, W. (1952). Quart. Appl. Math. 10, 157-165: yield limit and pressure.
Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48: the momentum balance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray
from uqpen.core.model import POSITIVE, Arrays, BoolArray, Bounds, Input, Results
from uqpen.core.settings import number, validate
from uqpen.models.rod_and_target import (
    RodModel,
    strength_factor_setting,
    transition_problems,
    transition_setting,
)
from uqpen.models.walker_anderson import DEFAULT_TOLERANCE, WalkerAnderson

if TYPE_CHECKING:
    import xarray as xr

_TARGET = (
    Input(
        "zero_pressure_yield_limit",
        "Pa",
        "yield limit of the target at zero pressure",
        bounds=POSITIVE,
        display_unit="MPa",
    ),
    Input(
        "yield_limit_slope",
        "1",
        "rise of the target's yield limit per pressure",
        bounds=Bounds(0.0, np.inf, lower_included=True),
    ),
    Input(
        "target_shear_modulus",
        "Pa",
        "shear modulus of the target",
        bounds=POSITIVE,
        display_unit="GPa",
    ),
)
_OWN = tuple(each.name for each in _TARGET)


@dataclass(frozen=True)
class WalkerAndersonDruckerPrager(RodModel):
    """An eroding rod in a target whose yield limit rises with pressure to a plateau.

    The limit is `zero_pressure_yield_limit` plus `yield_limit_slope` times the pressure, and at
    most `target_yield_limit`. Where a shear modulus is given, a spherical cavity expansion gives
    the extent of plastic flow, and a `plasticity_radius` has no effect.

    Parameters
    ----------
    tolerance : float
        Relative error allowed to a step of the integration; see `WalkerAnderson`.
    transition, strength_factor
        When the rod becomes rigid; see `WalkerAnderson`.

    References
    ----------
    Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48.
    Drucker, D. C. & Prager, W. (1952). Quart. Appl. Math. 10, 157-165.
    Bishop, R. F., Hill, R. & Mott, N. F. (1945). Proc. Phys. Soc. 57, 147-159.
    """

    tolerance: float = number(above=0, below=1e-2, default=DEFAULT_TOLERANCE)
    transition: str = transition_setting()
    strength_factor: float = strength_factor_setting()

    name = "walker-anderson-drucker-prager"
    inputs = (*RodModel.inputs, *_TARGET)
    alternatives = (*RodModel.alternatives, ("target_shear_modulus", "plasticity_radius"))

    def __post_init__(self) -> None:
        validate(self, transition_problems(self.transition, self.strength_factor))
        object.__setattr__(self, "outputs", self._in_constant_target().outputs)

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        lowest = inputs["zero_pressure_yield_limit"]
        rises = lowest <= inputs["target_yield_limit"]
        yield rises, "zero_pressure_yield_limit <= target_yield_limit"
        if "target_shear_modulus" in inputs:
            is_elastic = lowest < 6 * inputs["target_shear_modulus"]
            yield is_elastic, "zero_pressure_yield_limit < 6 target_shear_modulus"
        yield from super().conditions(_constant_target(inputs))

    def prepare(self) -> None:
        self._in_constant_target().prepare()

    def evaluate(self, inputs: Arrays) -> Results:
        return self._in_constant_target().evaluate(_constant_target(inputs))

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset:
        """The course of one run against depth, as that of `walker-anderson`."""
        arrays = {name: np.array([value], dtype=np.float64) for name, value in inputs.items()}
        target = _constant_target(arrays)
        one = {name: value.item() for name, value in target.items()}
        return self._in_constant_target().trajectory(one)

    def _in_constant_target(self) -> WalkerAnderson:
        return WalkerAnderson(self.tolerance, self.transition, self.strength_factor)


def _constant_target(inputs: Arrays) -> Arrays:
    """Return the inputs of `walker-anderson` whose target resists as much."""
    R, lowest = inputs["crater_radius"], inputs["zero_pressure_yield_limit"]
    if "target_shear_modulus" in inputs:
        S = plastic_extent(R, lowest, inputs["target_shear_modulus"])
    else:
        S = inputs["plasticity_radius"]
    Y = effective_yield_limit(
        special.log1p((S - R) / R),
        lowest,
        inputs["target_yield_limit"],
        inputs["yield_limit_slope"],
    )
    kept = {name: value for name, value in inputs.items() if name not in _OWN}
    return {**kept, "plasticity_radius": S, "target_yield_limit": Y}


def plastic_extent(
    crater_radius: FloatArray, yield_limit: FloatArray, shear_modulus: FloatArray
) -> FloatArray:
    """Return the outer radius S of plastic flow around a cavity opened from nothing, m.

    The yield limit is that at zero pressure, Y0; the shear modulus is above Y0/6.
    """
    strain = yield_limit / (6 * shear_modulus)  # (8)
    return crater_radius / special.cbrt(strain * (3 - strain * (3 - strain)))  # (9)


def effective_yield_limit(
    logarithm: FloatArray, lowest: FloatArray, highest: FloatArray, slope: FloatArray
) -> FloatArray:
    """Return the constant yield limit with the same resistance, Pa.

    The logarithm is ln(S/R). The limit rises by the slope k per pressure, from the lowest at zero
    pressure, Y0, to the highest, Y1.
    """
    growth = 7 * slope / (3 + 2 * slope)  # (5)
    # From the outer boundary inwards the limit rises over this part of ln(S/R).
    ratio = special.log1p((highest - lowest) / lowest)
    with np.errstate(divide="ignore", invalid="ignore"):
        rising = np.fmin(logarithm, ratio / growth)
    mean = lowest * special.exprel(growth * rising)  # (6)
    return (mean * rising + highest * (logarithm - rising)) / logarithm  # (7)
