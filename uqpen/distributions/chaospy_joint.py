"""Joint distributions of chaospy: independent, with dependent parameters, multivariate.

The map from the unit cube is chaospy's inverse Rosenblatt transformation.
"""

from __future__ import annotations

import ast
import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.units import scale
from uqpen.distributions.frozen import is_chaospy
from uqpen.distributions.input_group import InputGroup

__all__ = ["ChaospyJoint", "chaospy_joint", "declare_joint", "is_joint"]

# Of this many points at a time chaospy takes the same path, whatever the design; see `values`.
_ROWS = 1024


@dataclass(frozen=True, eq=False)
class ChaospyJoint(InputGroup):
    """Joint distribution of chaospy.

    Parameters
    ----------
    inputs : tuple of str
        One for each of its dimensions.
    joint : object
        Such as ``chaospy.J(…)`` or ``chaospy.MvNormal(…)``.
    units : tuple of str
        Unit of the values of each input.
    name : str
        Its text.
    """

    conditional_reason = "chaospy draws its inputs in one order, each given those before"

    inputs: tuple[str, ...]
    joint: Any
    units: tuple[str, ...]
    name: str

    @property
    def description(self) -> str:
        return f"chaospy {self.name}"

    def values(self, unit: FloatArray) -> FloatArray:
        # Blocks of one size: the last bits of a product of matrices depend on the number of rows.
        blocks = [self._block(unit[start : start + _ROWS]) for start in range(0, len(unit), _ROWS)]
        values = np.concatenate(blocks)
        measures = [scale(each) for each in self.units]
        factors = np.array([measure.factor for measure in measures])
        return values * factors + np.array([measure.offset for measure in measures])

    def nominal(self) -> tuple[float, ...]:
        middle = self.values(np.full((1, len(self.inputs)), 0.5))
        return tuple(middle[0].tolist())

    def _block(self, unit: FloatArray) -> FloatArray:
        whole = np.full((_ROWS, len(self.inputs)), 0.5)
        whole[: len(unit)] = unit
        found = np.asarray(self.joint.inv(whole.T), dtype=np.float64).T
        return found[: len(unit)]


def chaospy_joint(
    name: str, parameters: Mapping[str, Any], inputs: tuple[str, ...], units: tuple[str, ...]
) -> ChaospyJoint:
    """Return a multivariate distribution of chaospy by its name and parameters.

    Raises
    ------
    LookupError
        If it has no such distribution.
    ValueError
        If it does not take these parameters, or is of another number of dimensions.
    """
    chaospy = importlib.import_module("chaospy")
    family: Any = getattr(chaospy, name, None)
    if not isinstance(family, type) or not issubclass(family, chaospy.Distribution):
        raise LookupError(name)
    try:
        made = family(**parameters)
        found = ChaospyJoint(inputs, made, units, name)
        dimensions = len(made)
        is_usable = dimensions == len(inputs) and all(map(math.isfinite, found.nominal()))
    except Exception as error:  # a library can raise anything about parameters
        raise ValueError(str(error) or type(error).__name__) from None
    if dimensions != len(inputs):
        raise ValueError(f"it has {dimensions} dimensions, for {len(inputs)} inputs")
    if not is_usable:
        raise ValueError("it is not defined for these parameters")
    return found


def is_joint(value: object) -> bool:
    """Check for a distribution of chaospy of more than one dimension."""
    return is_chaospy(value) and len(value) > 1  # type: ignore[arg-type]


def declare_joint(joint: Any) -> dict[str, Any] | None:
    """Return the name and the parameters of a distribution of chaospy as data.

    Returns
    -------
    dict or None
        None where they do not determine it: its parameters depend on others, say.
    """
    inputs = tuple(map(str, range(len(joint))))
    units = ("1",) * len(joint)
    try:
        call = ast.parse(repr(joint), mode="eval").body
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name) or call.args:
            return None
        parameters = {str(each.arg): ast.literal_eval(each.value) for each in call.keywords}
        again = chaospy_joint(call.func.id, parameters, inputs, units)
        unit = np.random.default_rng(0).random((64, len(joint)))
        here = ChaospyJoint(inputs, joint, units, "")
        same = np.array_equal(again.values(unit), here.values(unit))
    except (SyntaxError, TypeError, ValueError, LookupError):
        return None
    return {"name": call.func.id, **parameters} if same else None
