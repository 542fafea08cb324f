"""Joint distributions of several inputs: their interface, those of chaospy, and rows of a table."""

from __future__ import annotations

import importlib
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NoReturn

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray, rows_by_weight
from uqpen.core.errors import ModelError
from uqpen.core.files import FileSnapshot
from uqpen.core.formulas import Formula
from uqpen.core.settings import declared_settings
from uqpen.core.units import scale
from uqpen.distributions.constraints import evaluate_formula
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution, UnloadedDistribution
from uqpen.distributions.frozen import frozen_families, is_chaospy, parse_call
from uqpen.distributions.univariate import Discrete

# Interface of the joint distribution of several inputs, and its stand-in without code.


class InputGroup(ABC):
    """Joint distribution of several random inputs, which depend on each other.

    It maps points of the unit cube to values of its inputs. A point decides its values alone, so
    these do not depend on the other points of a design. The inputs outside the group are
    independent of it.
    """

    conditional_reason: ClassVar[str]
    """Reason why its inputs cannot be drawn given values of some of them, for a message."""

    inputs: tuple[str, ...]

    @property
    @abstractmethod
    def description(self) -> str:
        """Description in one line, for points and tables."""

    @property
    def marginals(self) -> tuple[Distribution, ...] | None:
        """Distribution of each input by itself; None where they are not known."""
        return None

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        """Files from which it follows."""
        return ()

    @abstractmethod
    def values(self, unit: FloatArray) -> FloatArray:
        """Map points of the unit cube to values of the inputs.

        Parameters
        ----------
        unit : ndarray, shape (run, input)
            Independent probabilities, strictly between 0 and 1.

        Returns
        -------
        ndarray, shape (run, input)
            In SI units. Uniform points give draws of the joint distribution.
        """

    @abstractmethod
    def nominal(self) -> tuple[float, ...]:
        """Return one value of each input, which together lie in the middle of the distribution."""

    def __str__(self) -> str:
        return f"{self.description} of {', '.join(self.inputs)}"


@dataclass(frozen=True)
class ImplicitMarginal(Distribution):
    """Distribution of one input of a group that is known by its draws alone."""

    name: str  # the group, for a message
    nominal: float  # nominal value of the input, in its SI unit

    @property
    def median(self) -> float:
        """Nominal value of the input in its group."""
        return self.nominal

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise ModelError(f"{self.name} is known by its draws alone, not by those of one input")

    ppf = isf = cdf = sf = _refuse


@dataclass(frozen=True)
class UnloadedGroup(InputGroup):
    """Group known by its name only: an object of a program that is not here."""

    conditional_reason = "its joint distribution is not loaded"

    inputs: tuple[str, ...]
    name: str

    @property
    def description(self) -> str:
        return self.name

    @property
    def marginals(self) -> tuple[Distribution, ...]:
        return (UnloadedDistribution(self.name),) * len(self.inputs)

    def values(self, unit: FloatArray) -> FloatArray:
        raise ModelError(f"{self.name} is not loaded: it has no values without --trust")

    def nominal(self) -> tuple[float, ...]:
        raise ModelError(f"{self.name} is not loaded: it has no values without --trust")


# Joint distributions of chaospy: independent, with dependent parameters, multivariate.
#
# The map from the unit cube is chaospy's inverse Rosenblatt transformation.

# Of this many points at a time chaospy takes the same path, whatever the design; see `values`.
_ROWS = 1024


@dataclass(frozen=True, eq=False)
class ChaospyJoint(InputGroup):
    """Joint distribution of chaospy."""

    conditional_reason = "chaospy draws its inputs in one order, each given those before"

    inputs: tuple[str, ...]  # one for each of its dimensions
    joint: Any  # such as ``chaospy.J(…)`` or ``chaospy.MvNormal(…)``
    units: tuple[str, ...]  # unit of the values of each input
    name: str  # its text
    # Its name and parameters as a study has them; None for an object of a program.
    declared: Any = None

    @property
    def description(self) -> str:
        return f"chaospy {self.name}"

    def values(self, unit: FloatArray) -> FloatArray:
        factors, offsets = self._scales
        return self._in_blocks(self.joint.inv, unit) * factors + offsets

    def normal_scores(self, values: FloatArray) -> FloatArray:
        """Map values to independent standard normal variables, by Rosenblatt's transformation.

        Parameters
        ----------
        values : ndarray, shape (run, input)
            In SI units.
        """
        factors, offsets = self._scales
        unit = self._in_blocks(self.joint.fwd, (values - offsets) / factors)
        return np.asarray(scipy.special.ndtri(np.clip(unit, *OPEN_INTERVAL)))

    @property
    def _scales(self) -> tuple[FloatArray, FloatArray]:
        measures = [scale(each) for each in self.units]
        factors = np.array([measure.factor for measure in measures])
        return factors, np.array([measure.offset for measure in measures])

    def _in_blocks(self, map_rows: Callable[[FloatArray], Any], rows: FloatArray) -> FloatArray:
        """Map rows in blocks of one size: the last bits depend on the number of rows."""
        whole = np.tile(rows[:1], (-(-len(rows) // _ROWS) * _ROWS, 1))
        whole[: len(rows)] = rows
        blocks = (whole[start : start + _ROWS] for start in range(0, len(whole), _ROWS))
        mapped = [np.asarray(map_rows(each.T), dtype=np.float64).T for each in blocks]
        return np.concatenate(mapped)[: len(rows)]

    def nominal(self) -> tuple[float, ...]:
        middle = self.values(np.full((1, len(self.inputs)), 0.5))
        return tuple(middle[0].tolist())


def chaospy_joint(
    name: str, parameters: Mapping[str, Any], inputs: tuple[str, ...], units: tuple[str, ...]
) -> ChaospyJoint:
    """Return a multivariate distribution of chaospy by its name and parameters.

    LookupError if it has no such distribution; ValueError if it does not take these parameters, or
    is of another number of dimensions.
    """
    chaospy = importlib.import_module("chaospy")
    family: Any = getattr(chaospy, name, None)
    if not isinstance(family, type) or not issubclass(family, chaospy.Distribution):
        raise LookupError(name)
    found = _checked(lambda: family(**parameters), name, inputs, units)
    return replace(found, declared={"name": name, **parameters})


def conditional_joint(
    parts: Sequence[tuple[str, Mapping[str, float | str]]],
    inputs: tuple[str, ...],
    units: tuple[str, ...],
) -> ChaospyJoint:
    """Return the joint distribution of inputs whose parameters may depend on earlier ones.

    Parameters
    ----------
    parts : sequence of (str, mapping)
        For each input the name of a distribution of chaospy and its parameters: numbers, or
        formulas of the inputs before it, in the units of their values.

    LookupError if chaospy has no such distribution; ConstraintError if a formula is none of earlier
    inputs; ValueError if a distribution does not take these parameters.
    """
    chaospy = importlib.import_module("chaospy")
    known = frozen_families("chaospy")
    made: dict[str, Any] = {}
    for name, (family, written) in zip(inputs, parts, strict=True):
        if family not in known:
            raise LookupError(family)
        parameters = {
            key: evaluate_formula(value, made) if isinstance(value, str) else value
            for key, value in written.items()
        }
        try:
            made[name] = known[family](**parameters)
        except Exception as error:  # a library can raise anything about parameters
            raise ValueError(f"{family}: {str(error) or type(error).__name__}") from None
    shown = ", ".join(
        f"{family}({', '.join(f'{key}={value}' for key, value in written.items())})"
        for family, written in parts
    )
    found = _checked(lambda: chaospy.J(*made.values()), f"J({shown})", inputs, units)
    return replace(found, declared=[{"name": name, **written} for name, written in parts])


def joint_text(joint: ChaospyJoint) -> str:
    """Return the inputs, units, name and parameters of a declared joint distribution as JSON."""
    content = {"inputs": joint.inputs, "units": joint.units, "chaospy": joint.declared}
    return json.dumps(content)


def joint_from_text(text: str) -> ChaospyJoint:
    """Return a joint distribution from `joint_text`; ValueError or LookupError if it is none."""
    content = json.loads(text)
    inputs, units, declared = tuple(content["inputs"]), tuple(content["units"]), content["chaospy"]
    if isinstance(declared, list):
        parts = [(each.pop("name"), each) for each in declared]
        return conditional_joint(parts, inputs, units)
    parameters = {key: value for key, value in declared.items() if key != "name"}
    for value in parameters.values():
        np.asarray(value, dtype=np.float64)
    return chaospy_joint(declared["name"], parameters, inputs, units)


def _checked(
    make: Callable[[], Any], name: str, inputs: tuple[str, ...], units: tuple[str, ...]
) -> ChaospyJoint:
    """Return a joint distribution of chaospy; ValueError where it cannot be made or used."""
    try:
        made = make()
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

    None where they do not determine it: its parameters depend on others, say.
    """
    inputs = tuple(map(str, range(len(joint))))
    units = ("1",) * len(joint)
    try:
        name, given, parameters = parse_call(repr(joint))
        if given:
            return None
        again = chaospy_joint(name, parameters, inputs, units)
        unit = np.random.default_rng(0).random((64, len(joint)))
        here = ChaospyJoint(inputs, joint, units, "")
        same = np.array_equal(again.values(unit), here.values(unit))
    except (SyntaxError, TypeError, ValueError, LookupError):
        return None
    return {"name": name, **parameters} if same else None


# Rows of a table as the joint distribution of its columns: a posterior sample, say.


@dataclass(frozen=True, eq=False)
class SampleDistribution(InputGroup):
    """Weighted rows of values as the joint distribution of several inputs.

    A draw is a row, so it keeps the dependence of the columns. The first coordinate of the unit
    cube selects the row, each over an interval as long as its weight. So stratified points take the
    rows evenly, as systematic resampling does; the other coordinates have no effect.

    References
    ----------
    Kitagawa, G. (1996). J. Comput. Graph. Stat. 5, 1-25.
    """

    conditional_reason = "its draws are whole rows of a sample, of which no part is given the rest"

    inputs: tuple[str, ...]  # the columns
    rows: FloatArray  # (row, input): values in SI units
    weights: FloatArray  # (row,): relative weights, at least two above 0
    source: str = "a table"  # the file, for a description
    file: FileSnapshot | None = field(default=None, repr=False)  # that file
    # Of a posterior: hashes of the measured values that have taught it.
    taught_by: frozenset[str] = field(default=frozenset(), repr=False)

    @property
    def description(self) -> str:
        weighted = "weighted " if np.ptp(self.weights) > 0 else ""
        return f"{len(self.rows)} {weighted}rows of {self.source}"

    @property
    def files(self) -> tuple[FileSnapshot, ...]:
        return () if self.file is None else (self.file,)

    @cached_property
    def marginals(self) -> tuple[Distribution, ...]:
        return tuple(Discrete.from_sample(column, self.weights) for column in self.rows.T)

    def values(self, unit: FloatArray) -> FloatArray:
        return self.rows[rows_by_weight(self.weights, unit[:, 0])]

    def nominal(self) -> tuple[float, ...]:
        return tuple(marginal.median for marginal in self.marginals)


# Inputs whose parameters are formulas of others, in a chain of conditional distributions.


@dataclass(frozen=True)
class ConditionalPart:
    """Family of an input, with parameters that are numbers or formulas of inputs before it."""

    family: type[Distribution]
    parameters: Mapping[str, Any]  # SI values, or a `Formula`
    text: str  # as a study states it

    def ppf(self, probability: FloatArray, known: Mapping[str, FloatArray]) -> FloatArray:
        """Return quantiles, each of the distribution of its run; NaN where that is none."""
        columns = {
            key: np.broadcast_to(
                value.values(known) if isinstance(value, Formula) else value, probability.shape
            )
            for key, value in self.parameters.items()
        }
        accepts = {field.name: each.accepts for field, each in declared_settings(self.family)}
        found = np.full(probability.shape, np.nan)
        for run, p in enumerate(probability):
            values = {
                key: column[run].item() if isinstance(column[run], np.generic) else column[run]
                for key, column in columns.items()
            }
            # Without the checks of its class, which take longer than the quantile.
            made = object.__new__(self.family)
            vars(made).update(values)
            if all(accepts[key](value) for key, value in values.items()) and not any(
                made.check_settings()
            ):
                found[run] = made.ppf(np.array(p))
        return found


@dataclass(frozen=True, eq=False)
class ConditionalGroup(InputGroup):
    """Inputs with parameters that depend on others, behind these: a chain of quantiles.

    The distribution of each is the one given those before it, by its own coordinate of the unit
    cube. That is the inverse of Rosenblatt's transformation.
    """

    conditional_reason = "its inputs are drawn in one order, each given those before"

    inputs: tuple[str, ...]  # each behind those that its parameters name
    parts: tuple[Distribution | ConditionalPart, ...]  # one for each
    fixed: Mapping[str, float]  # values of fixed inputs that parameters name, in SI units

    @property
    def description(self) -> str:
        named = zip(self.inputs, self.parts, strict=True)
        texts = (f"{name} {each.text}" for name, each in named if isinstance(each, ConditionalPart))
        return f"conditional distribution ({'; '.join(texts)})"

    def values(self, unit: FloatArray) -> FloatArray:
        inside = np.clip(unit, *OPEN_INTERVAL)
        known = {name: np.array(value) for name, value in self.fixed.items()}
        columns = []
        for name, part, column in zip(self.inputs, self.parts, inside.T, strict=True):
            is_conditional = isinstance(part, ConditionalPart)
            known[name] = part.ppf(column, known) if is_conditional else part.ppf(column)  # type: ignore[call-arg]
            columns.append(known[name])
        return np.column_stack(columns)

    def nominal(self) -> tuple[float, ...]:
        return tuple(self.values(np.full((1, len(self.inputs)), 0.5))[0].tolist())
