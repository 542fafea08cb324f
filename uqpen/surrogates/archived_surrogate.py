"""Surrogate of an archive, to predict with; nothing that the archive names is executed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.errors import (
    ArchiveError,
    ModelError,
    QuantityError,
    UnknownNameError,
    UqpenError,
)
from uqpen.core.labels import INPUT, RUN, RUNS, STATUS
from uqpen.core.labels import SURROGATES as GROUP
from uqpen.core.lookup import choices, installed_members, load_installed, resolve_name
from uqpen.core.model import Input, Model, Output, find_variable
from uqpen.core.quantities import parse_quantity
from uqpen.core.status import Status
from uqpen.core.units import are_convertible, describe, scale
from uqpen.core.variables import code_labels, field_coordinates
from uqpen.surrogates import ENTRY_POINTS, SURROGATES
from uqpen.surrogates.diagnostics import refuted_outputs
from uqpen.surrogates.field_surrogate import FieldSurrogate, has_fields
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.surrogate import Surrogate

# Points to predict at, as a caller gives them: quantities, numbers, arrays of either.


def input_array(variable: Input, given: Any) -> xr.DataArray:
    """Return values of an input in SI units, as an array with its dimensions.

    Raises
    ------
    QuantityError
        If one is no finite quantity of its dimension, or nested sequences lack dimensions.
    """
    try:
        if isinstance(given, xr.DataArray):
            unit = str(given.attrs.get("units", variable.unit))
            if not are_convertible(unit, variable.unit):
                raise QuantityError(f'an array in "{unit}"', describe(variable.unit))
            in_si = scale(unit).array_to_si(_numbers(given.values, variable))
            values = given.copy(data=in_si)
        else:
            numbers = _numbers(given, variable)
            if numbers.ndim > 1:
                shape = f"an array of shape {numbers.shape}"
                raise QuantityError(shape, "one value for each point, or a DataArray")
            values = xr.DataArray(numbers, dims=(RUN,) * numbers.ndim)
    except QuantityError as error:
        raise QuantityError(f"{variable.name} = {error.found}", error.expected) from None
    if not np.isfinite(values.values).all():
        raise QuantityError(f"{variable.name} with values that are not finite", "finite numbers")
    if variable.labels and not np.isin(values.values, range(len(variable.labels))).all():
        expected = f"texts of {', '.join(variable.labels)}, or their numbers from 0"
        raise QuantityError(f"{variable.name} with a number that stands for no text", expected)
    attributes = {"units": variable.unit, "display_units": variable.preferred_unit}
    return values.drop_attrs().assign_attrs(long_name=variable.title, **attributes)


def _numbers(given: Any, variable: Input) -> FloatArray:
    """Return numbers as they are, and quantities in SI units."""
    try:
        values = np.asarray(given)
    except ValueError:
        expected = "a value, or a sequence with one for each point"
        raise QuantityError("lists of different lengths", expected) from None
    if values.dtype.kind in "iuf":
        return values.astype(np.float64)
    flat = [
        each
        if type(each) in (int, float)
        else variable.label_code(each)
        if variable.labels
        else parse_quantity(each, variable.unit).value
        for each in np.asarray(given, dtype=object).ravel().tolist()
    ]
    return np.array(flat, dtype=np.float64).reshape(values.shape)


def broadcast_inputs(given: Mapping[str, xr.DataArray]) -> dict[str, xr.DataArray]:
    """Return the inputs along all dimensions of any; a ModelError says that they do not fit."""
    try:
        aligned = xr.align(*given.values(), join="exact")
    except ValueError:
        sizes = ", ".join(f"{name} {dict(array.sizes)}" for name, array in given.items())
        raise ModelError(f"the inputs differ in their points: {sizes}") from None
    return dict(zip(given, xr.broadcast(*aligned), strict=True))


# Restore a fitted surrogate from an archive; nothing in it is executed.


def restore_surrogate(
    tree: xr.DataTree,
    name: str,
    original: Model | None = None,
    *,
    loaded: type[Surrogate] | None = None,
) -> FittedSurrogate:
    """Restore a fitted surrogate of the kind that its group names.

    Parameters
    ----------
    tree : DataTree
        The result of `FittedSurrogate.to_tree`, or the group read from an archive.
    original : Model, optional
        The original model; without it, every finite input counts as admissible.
    loaded : type, optional
        The class of a user-defined surrogate, if the archive's code may be executed.

    Raises
    ------
    UnknownNameError
        If there is no such kind.
    ArchiveError
        If its group lacks what its kind needs, or contradicts itself.
    ModelError
        If it is a class that only the archive's code defines, and that is not loaded; or if its
        installed package cannot be imported.
    """
    kind = loaded or _known_class(str(tree.attrs["kind"]), name)
    try:
        if has_fields(tree):
            return FieldSurrogate.from_tree(tree, name, original, kind)
        return kind.restore(tree, name, original)
    except UqpenError:
        raise
    except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ArchiveError(f"/{GROUP}/{name}: is damaged: {reason}") from None


def is_restorable(tree: xr.DataTree) -> bool:
    """Check that the kind of a surrogate is built in or installed, so it can be evaluated."""
    kind = str(tree.attrs["kind"])
    return kind in SURROGATES or kind in installed_members(ENTRY_POINTS)


def _known_class(kind: str, name: str) -> type[Surrogate]:
    installed = {} if kind in SURROGATES else installed_members(ENTRY_POINTS)
    if kind in installed:
        found: type[Surrogate] = load_installed(ENTRY_POINTS, kind)
        return found
    if ":" in kind:
        raise ModelError(
            f"the surrogate {name} follows from code that the archive names ({kind})\n"
            "  if you trust whoever made it, say --trust"
        )
    built_in: type[Surrogate] = resolve_name(SURROGATES, kind, "kind of surrogate")
    return built_in


EXTRAPOLATED = "extrapolated"

# A value that was converted to another unit and back may be an ulp off.
_ROUNDING = 1e-12


class ExtrapolationWarning(UserWarning):
    """Warning: a surrogate predicts outside of its training range."""


class RefutationWarning(UserWarning):
    """Warning: a surrogate predicts an output although runs refute it."""


@dataclass(frozen=True, eq=False)
class ArchivedSurrogate:
    """Surrogate of an archive: a function of inputs with units.

    Examples
    --------
    >>> pce = uqpen.open_archive("archives/cantilever.nc").surrogate("pce")  # doctest: +SKIP
    >>> pce(load="0.5 kN", modulus=210e9, width="5 cm", height=["9.9 cm", "10.1 cm"])["tip"]
    ... # doctest: +SKIP
    """

    fitted: FittedSurrogate  # its predictions in SI units
    # The inputs that varied in the training runs, then those that had one value.
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]  # those that it predicts
    # The smallest and the largest value of each input in the training runs, in SI units.
    ranges: Mapping[str, tuple[float, float]]
    # The outputs whose predictions runs refute, each with the reason.
    refuted: Mapping[str, str] = field(default_factory=dict)

    def __call__(self, **values: Any) -> xr.Dataset:
        """Predict its outputs at some points.

        Parameters
        ----------
        **values
            The inputs: each a quantity such as ``"10 kN"``, one of its texts where a data file has
            texts of it, a number in SI units, a sequence of
            either with a value for each point, or a DataArray. DataArrays are broadcast by their
            dimensions, and are in the unit of their attribute ``units``, by default in SI units.
            An input that did not vary in the training runs may be left out.

        Returns
        -------
        Dataset
            In SI units, with the inputs as coordinates: the outputs, fields along their dimensions
            behind those of the points; ``<output>_std``, the standard deviation of a prediction,
            where the surrogate has one; ``<output>_mean_std``, that of the mean given the inputs,
            where its runs were repeated, as the other is of a new run; and ``extrapolated`` along
            ``input``, which marks the inputs of a point outside of the training range.

        Warns
        -----
        ExtrapolationWarning
            If a point is outside of the training range.
        RefutationWarning
            If runs refute it.

        Raises
        ------
        UnknownNameError
            If a name is none of its inputs.
        QuantityError
            If a value is no finite quantity of the dimension of its input.
        ModelError
            If an input is missing, has another value than in all training runs, does not fit the
            others in shape, or has a dimension of a field.
        """
        predicted = self.predict(values)
        if text := self.extrapolation_text(predicted[EXTRAPOLATED]):
            warnings.warn(text, ExtrapolationWarning, stacklevel=2)
        if text := self.refutation_text:
            warnings.warn(text, RefutationWarning, stacklevel=2)
        return predicted

    def predict(self, values: Mapping[str, Any]) -> xr.Dataset:
        """Predict its outputs as a call does, but without the warnings."""
        given = self._arrays(values)
        points = broadcast_inputs(given)
        some = points[self.fitted.random_inputs[0]]
        self._check_dimensions(some)
        flat = {name: array.values.ravel() for name, array in points.items()}
        found = self.fitted.predict(flat)
        variables: dict[str, Any] = {}
        for output in self.outputs:
            variables |= _variables(output, found[output.name], some)
        return xr.Dataset({**variables, EXTRAPOLATED: self._is_outside(points)}, coords=given)

    def _check_dimensions(self, some: xr.DataArray) -> None:
        """Refuse points along a dimension of a field, which would be two dimensions of one name."""
        fields = {dimension.name for output in self.outputs for dimension in output.dims}
        if shared := sorted(fields & set(map(str, some.dims))):
            raise ModelError(
                f"inputs along {', '.join(shared)}, a dimension of an output: rename it"
            )

    def extrapolation(self, values: Mapping[str, Any]) -> xr.DataArray:
        """Return the mask of inputs outside of the training range, as a prediction has it.

        It refuses what a prediction would.
        """
        points = broadcast_inputs(self._arrays(values))
        self._check_dimensions(points[self.fitted.random_inputs[0]])
        return self._is_outside(points)

    @property
    def refutation_text(self) -> str:
        """Text on the outputs whose predictions runs refute; empty for none."""
        reasons = (f"{output}: {reason}" for output, reason in self.refuted.items())
        return f"{self.fitted.name}, {'; '.join(reasons)}" if self.refuted else ""

    def extrapolation_text(self, marked: xr.DataArray) -> str:
        """Return how many points are outside of the training range, and where; empty for none."""
        along = [dimension for dimension in marked.dims if dimension != INPUT]
        count, size = int(marked.any(INPUT).sum()), marked.size // marked.sizes[INPUT]
        names = marked[INPUT].values[marked.any(along).values]
        ranges = ", ".join(self._range_text(self._input(str(each))) for each in names)
        points = f"{count} of {size} points" if size > 1 else "the point"
        verb = "is" if count == 1 else "are"
        return f"{points} {verb} outside of the training range: {ranges}" if count else ""

    def _range_text(self, variable: Input) -> str:
        unit = variable.preferred_unit
        lower, upper = (scale(unit).from_si(end) for end in self.ranges[variable.name])
        if variable.labels:
            return f"{variable.name} {', '.join(variable.labels)}"
        return f"{variable.name} {lower:.4g} to {upper:.4g} {unit}".removesuffix(" 1")

    def _arrays(self, values: Mapping[str, Any]) -> dict[str, xr.DataArray]:
        """Return the given inputs in SI units; refuse what the surrogate cannot predict at."""
        name = self.fitted.name
        given = {key: input_array(self._input(key), value) for key, value in values.items()}
        if missing := list(self.fitted.missing_inputs(given)):
            raise ModelError(f"{name} also needs {', '.join(missing)}")
        for key in self.fitted.fixed.keys() & given.keys():
            if _outside(given[key].values, self.ranges[key]).any():
                only = self._range_text(self._input(key)).partition(" to ")[2]
                raise ModelError(f"{key} is {only} in all training runs; {name} has no other value")
        return given

    def _input(self, name: str) -> Input:
        return find_variable(self.inputs, name, "input", self.fitted.name)

    def _is_outside(self, points: Mapping[str, xr.DataArray]) -> xr.DataArray:
        """Return a mask of the points, along `INPUT`, that are outside of the training range."""
        names = list(self.fitted.random_inputs)
        marked = [
            points[name].copy(data=_outside(points[name].values, self.ranges[name])).drop_attrs()
            for name in names
        ]
        found = xr.concat([each.reset_coords(drop=True) for each in marked], dim=INPUT)
        found = found.assign_coords({INPUT: names}).transpose(..., INPUT)
        return found.assign_attrs(long_name="outside of the training range")


def surrogate_paths(tree: xr.DataTree) -> dict[str, tuple[str, str]]:
    """Return the model and the name of each surrogate of an archive, by its label.

    The label is the name; of several models ``<model>/<name>``.
    """
    return {
        f"{model}/{name}" if model else name: (model, name)
        for model, model_tree in model_trees(tree).items()
        for name in group_names(model_tree, GROUP)
    }


def archived_surrogate(
    tree: xr.DataTree, label: str, *, kind: type[Surrogate] | None = None
) -> ArchivedSurrogate:
    """Restore a surrogate of an archive.

    Parameters
    ----------
    tree : DataTree
        An archive.
    label : str
        As in `surrogate_paths`.
    kind : type, optional
        Its class, where that is user-defined; an archive's own code is not executed.

    Raises
    ------
    UnknownNameError
        If there is no such surrogate.
    ModelError
        If its class is user-defined, and is not given; or if it predicts no output.
    ArchiveError
        If its group, or the design that it was fitted to, is damaged.
    """
    paths = surrogate_paths(tree)
    if label not in paths:
        raise UnknownNameError(f'no surrogate "{label}"; {choices(label, paths)}')
    model, name = paths[label]
    model_tree = model_trees(tree)[model]
    group = model_tree.children[GROUP].children[name]
    fitted = restore_surrogate(group, label, loaded=kind)
    if not fitted.outputs:
        reasons = "; ".join(f"{output}: {reason}" for output, reason in fitted.reasons.items())
        raise ModelError(f"{label} predicts nothing: {reasons}")
    inputs = [*fitted.random_inputs, *fitted.fixed]
    outputs = [output.name for output in fitted.outputs]
    runs = _training_runs(model_tree, str(group.attrs["design"]), {*inputs, *outputs})
    completed = runs[STATUS].values == Status.OK
    return ArchivedSurrogate(
        fitted,
        tuple(
            Input(each, *_texts(runs[each]), labels=code_labels(runs[each].attrs))
            for each in inputs
        ),
        (
            *(
                Output(output.name, *_texts(runs[output.name]), dims=output.dims)
                for output in fitted.outputs
            ),
            *(fitted.ends.values() if isinstance(fitted, FieldSurrogate) else ()),
        ),
        {each: _range(runs[each], completed) for each in inputs},
        refuted_outputs(group),
    )


def _training_runs(model: xr.DataTree, design: str, names: set[str]) -> xr.Dataset:
    """Return the runs of a design; refuse runs that lack some inputs or outputs."""
    if design not in group_names(model, RUNS):
        raise ArchiveError(f"/{RUNS}: is damaged: it has no {design}, which a surrogate names")
    runs = read_group(model, RUNS, design)
    if missing := sorted(names - set(map(str, runs.data_vars))):
        raise ArchiveError(f"/{RUNS}/{design}: is damaged: it lacks {', '.join(missing)}")
    return runs


def _texts(variable: xr.DataArray) -> tuple[str, str, str]:
    """Return the SI unit, the title and the unit in the study of a variable."""
    unit = str(variable.attrs["units"])
    shown = (str(variable.attrs.get(key, "")) for key in ("long_name", "display_units"))
    return unit, *shown  # type: ignore[return-value]


def _range(variable: xr.DataArray, completed: np.ndarray) -> tuple[float, float]:
    values = np.broadcast_to(variable.values, completed.shape)[completed]
    return float(values.min()), float(values.max())


def _outside(values: FloatArray, ends: tuple[float, float]) -> np.ndarray:
    margin = _ROUNDING * max(map(abs, ends))
    mask: np.ndarray = (values < ends[0] - margin) | (values > ends[1] + margin)
    return mask


def _variables(output: Output, found: Prediction, some: xr.DataArray) -> dict[str, xr.DataArray]:
    """Return the predicted values of an output, and their standard deviations if there are any."""
    attributes = {"long_name": output.title, "units": output.unit}
    shown = {"display_units": output.preferred_unit}
    variables = {output.name: _like(some, output, found.mean, attributes | shown)}
    titles = "prediction of {}", "mean of {} given the inputs"
    for name, values, title in zip(
        std_names(output), (found.std, found.mean_std), titles, strict=True
    ):
        if values is not None:
            own = {"long_name": f"standard deviation of the {title.format(output.title)}"}
            variables[name] = _like(some, output, values, attributes | own | shown)
    return variables


def std_names(output: Output) -> tuple[str, str]:
    """Return the names of the standard deviations of predictions of an output.

    The second is that of its mean given the inputs, where runs were repeated.
    """
    return f"{output.name}_std", f"{output.name}_mean_std"


def _like(
    some: xr.DataArray, output: Output, values: FloatArray, attributes: dict[str, str]
) -> xr.DataArray:
    """Return values of an output along the points, and along its own dimensions."""
    along = field_coordinates(output.dims)
    return xr.DataArray(
        values.reshape((*some.shape, *output.shape)),
        {**some.reset_coords(drop=True).coords, **along},
        (*some.dims, *along),
        attrs=attributes,
    )
