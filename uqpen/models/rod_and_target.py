"""Base of the models of a rod going into a thick target: their inputs and outputs.

Depths are those in a target without a rear face; a wall of that thickness fails earlier.

References
----------
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Table 3.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import Any

import numpy as np

from uqpen.core.errors import Problem, toml_text
from uqpen.core.model import (
    POSITIVE,
    Arrays,
    BoolArray,
    Bounds,
    Category,
    FloatArray,
    Input,
    Output,
)
from uqpen.core.settings import choice, number
from uqpen.models.source import BuiltInModel

_INPUTS = (
    Input("projectile_density", "kg m-3", bounds=POSITIVE, display_unit="g/cm^3"),
    Input("projectile_yield_limit", "Pa", bounds=POSITIVE, display_unit="MPa"),
    Input("projectile_length", "m", bounds=POSITIVE, display_unit="cm"),
    Input("impact_velocity", "m s-1", bounds=POSITIVE, display_unit="m/s"),
    Input(
        "projectile_sound_speed",
        "m s-1",
        "bar sound speed of the projectile",
        bounds=POSITIVE,
        display_unit="m/s",
    ),
    Input(
        "projectile_young_modulus",
        "Pa",
        "Young's modulus of the projectile",
        bounds=POSITIVE,
        display_unit="GPa",
    ),
    Input("target_density", "kg m-3", bounds=POSITIVE, display_unit="g/cm^3"),
    Input("target_yield_limit", "Pa", bounds=POSITIVE, display_unit="MPa"),
    Input(
        "plasticity_radius",
        "m",
        "outer radius of plastic flow in the target",
        bounds=POSITIVE,
        display_unit="mm",
    ),
    Input("crater_radius", "m", bounds=POSITIVE, display_unit="mm"),
    Input(
        "smoothing",
        "1",
        "smoothing of the velocity profile",
        default=0.0,
        bounds=Bounds(0.0, 2.0, lower_included=True),
    ),
)


class Termination(IntEnum):
    """Kinds of endings of erosion."""

    BREAKDOWN = 0
    """The tail becomes as slow as the nose; the rest of the rod goes on as a rigid body."""
    STANDSTILL = 1
    """The nose comes to rest while the rod is eroding."""
    RIGID = 2
    """The rod never begins to erode."""
    STRENGTH = 3
    """The rest of the rod no longer yields and goes on as a rigid body, its tail still faster."""


_TERMINATION_LABELS = {
    Termination.BREAKDOWN: "v = u",
    Termination.STANDSTILL: "u = 0",
    Termination.RIGID: "rigid",
    Termination.STRENGTH: "v > u",
}


def _outputs(*kinds: Termination) -> tuple[Output, ...]:
    """Return the outputs of a rod whose erosion ends in one of some ways."""
    return (
        Output("penetration_depth", "m", "depth of penetration"),
        Output("projectile_residue", "m", "length of projectile left"),
        Output("erosion_end_depth", "m", "depth at which erosion ends"),
        Output(
            "termination",
            "1",
            "how erosion ends",
            categories=tuple(
                Category(kind.name.lower(), _TERMINATION_LABELS[kind]) for kind in kinds
            ),
        ),
    )


OUTPUTS = _outputs(Termination.BREAKDOWN, Termination.STANDSTILL, Termination.RIGID)
OUTPUTS_BY_STRENGTH = _outputs(*Termination)

# Criteria by which an eroding rod becomes rigid; each ends erosion at v = u at the latest.
EQUAL_VELOCITIES, RIGID_VELOCITY, RIGID_STRESS = (
    "equal-velocities",
    "rigid-velocity",
    "rigid-stress",
)

# Of a sound speed and a Young's modulus, where both are given.
_AGREEMENT = 0.01


class RodModel(BuiltInModel):
    """Base of the models with the inputs and outputs of `walker-anderson`."""

    inputs: tuple[Input, ...] = _INPUTS
    outputs: tuple[Output, ...] = OUTPUTS
    # A Young's modulus gives the sound speed, so one of the two is enough.
    alternatives: tuple[tuple[str, ...], ...] = (
        ("projectile_sound_speed", "projectile_young_modulus"),
    )

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        S, R = inputs["plasticity_radius"], inputs["crater_radius"]
        yield S > R, "plasticity_radius > crater_radius"
        if "projectile_sound_speed" in inputs and "projectile_young_modulus" in inputs:
            given = inputs["projectile_sound_speed"]
            agrees = np.abs(_elastic_sound_speed(inputs) / given - 1) <= _AGREEMENT
            yield agrees, "projectile_sound_speed = sqrt(young_modulus / density) within 1 %"


def transition_setting() -> Any:
    """Declare by which criterion an eroding rod becomes rigid; see docs/walker_anderson.md."""
    criteria = (EQUAL_VELOCITIES, RIGID_VELOCITY, RIGID_STRESS)
    return choice(*criteria, default=EQUAL_VELOCITIES)


def strength_factor_setting() -> Any:
    """Declare the projectile's strength in that criterion, in units of its yield limit."""
    return number(above=0, default=1.0)


def transition_problems(transition: str, strength_factor: float) -> Iterator[Problem]:
    """Yield what is wrong with these two settings together."""
    if transition == EQUAL_VELOCITIES and strength_factor != 1:
        criteria = f"{toml_text(RIGID_VELOCITY)} or {toml_text(RIGID_STRESS)}"
        yield Problem(
            ("strength_factor",),
            toml_text(strength_factor),
            f"none where the velocities alone decide; or transition = {criteria}",
        )


def sound_speed(inputs: Arrays) -> FloatArray:
    """Bar sound speed, m/s: as given, else from Young's modulus and density."""
    if "projectile_sound_speed" in inputs:
        return inputs["projectile_sound_speed"]
    return _elastic_sound_speed(inputs)


def _elastic_sound_speed(inputs: Arrays) -> FloatArray:
    return np.sqrt(inputs["projectile_young_modulus"] / inputs["projectile_density"])
