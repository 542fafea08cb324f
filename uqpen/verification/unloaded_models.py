"""Models of an archive whose classes are not loaded: their variables, as its runs have them."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.errors import SettingsError
from uqpen.core.labels import CURVE_MAY_END, DERIVED_FROM, ROLE, RUN, RUNS
from uqpen.core.model import Category, Dimension, Input, Output
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.study.document import inner_table
from uqpen.study.named_object import OBJECT
from uqpen.study.user_defined_members import is_reference
from uqpen.study.variables_section import dimensions_from_model

__all__ = ["archived_dimensions", "unloaded_models"]


def unloaded_models(
    tree: xr.DataTree, content: Mapping[str, Any], *, trust: bool
) -> dict[tuple[str | int, ...], UnloadedModel]:
    """Return a stand-in for each model of a study whose class is user-defined.

    Parameters
    ----------
    tree : DataTree
        The archive.
    content : mapping
        Its study's text, parsed.
    trust : bool
        True if classes in files are loaded, and need no stand-in. Objects of a Python program do.

    Returns
    -------
    dict of tuple to UnloadedModel
        By the path of the model's table, as the objects of `parse_study`.
    """
    found: dict[tuple[str | int, ...], UnloadedModel] = {}
    for name, group in model_trees(tree).items():
        path = ("models", name) if name else ("model",)
        table = inner_table(content, *path)
        is_object = table.get("class") is True and OBJECT in table
        designs = group_names(group, RUNS)
        if designs and (is_object or (is_reference(table.get("use")) and not trust)):
            runs = read_group(group, RUNS, designs[0])
            named = str(table[OBJECT] if is_object else table["use"])
            found[path] = replace(_model(named, runs), is_absent=is_object)
    return found


def archived_dimensions(
    tree: xr.DataTree, content: Mapping[str, Any]
) -> dict[tuple[str | int, ...], Dimension]:
    """Return the dimensions of an archive whose coordinates are in the code of its models.

    Parameters
    ----------
    tree : DataTree
        The archive.
    content : mapping
        Its study's text, parsed.

    Returns
    -------
    dict of tuple to Dimension
        By the path of the dimension's table, as the objects of `parse_study`.
    """
    found: dict[tuple[str | int, ...], Dimension] = {}
    for name, group in model_trees(tree).items():
        path = ("models", name) if name else ("model",)
        for design in group_names(group, RUNS)[:1]:
            runs = read_group(group, RUNS, design)
            for inner in dimensions_from_model(inner_table(content, *path)):
                # A damaged archive may have none, or another; the study then says so.
                with contextlib.suppress(SettingsError, KeyError):
                    found[*path, *inner] = _dimension(inner[-1], runs)
    return found


def _model(reference: str, runs: xr.Dataset) -> UnloadedModel:
    """Return a model with the inputs and outputs of runs; a value for all runs is a default."""
    variables = {str(name): runs.variables[name] for name in runs.data_vars}
    inputs = tuple(
        Input(*_names(name, variable), default=_value(variable))
        for name, variable in variables.items()
        if variable.attrs.get(ROLE) == "input"
    )
    outputs = tuple(
        _output(name, variable, runs)
        for name, variable in variables.items()
        if variable.attrs.get(ROLE) == "output" and DERIVED_FROM not in variable.attrs
    )
    return UnloadedModel(reference, inputs, outputs)


def _output(name: str, variable: xr.Variable, runs: xr.Dataset) -> Output:
    """Return an output with its categories or its dimensions."""
    dims = tuple(_dimension(str(each), runs) for each in variable.dims if each != RUN)
    return Output(
        *_names(name, variable),
        categories=_categories(variable),
        dims=dims,
        may_end=variable.attrs.get("comment") == CURVE_MAY_END,
    )


def _dimension(name: str, runs: xr.Dataset) -> Dimension:
    coordinates = runs.variables[name]
    return Dimension(*_names(name, coordinates), values=tuple(coordinates.values.tolist()))


def _names(name: str, variable: xr.Variable) -> tuple[str, str, str, str]:
    """Return the name, SI unit, title and display unit of a variable."""
    texts = (str(variable.attrs.get(key, "")) for key in ("long_name", "display_units"))
    return name, str(variable.attrs.get("units", "1")), *texts  # type: ignore[return-value]


def _value(variable: xr.Variable) -> float | None:
    is_number = not variable.dims and variable.dtype.kind == "f"
    return float(variable.values) if is_number else None


def _categories(variable: xr.Variable) -> tuple[Category, ...]:
    flags = str(variable.attrs.get("flag_meanings", "")).split()
    labels = np.atleast_1d(variable.attrs.get("flag_labels", flags))
    return tuple(Category(flag, str(label)) for flag, label in zip(flags, labels, strict=False))
