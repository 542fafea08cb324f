"""An archive cut down to one output, and to places of it where that is a field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.archive.groups import GROUPS, group_place, model_trees
from uqpen.core.errors import QuantityError, UnknownNameError, toml_text
from uqpen.core.labels import RUNS
from uqpen.core.lookup import choices
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import scale
from uqpen.results.surrogate_tables import FITTED, fitted_outputs
from uqpen.results.table import first_runs, output_names, shown_unit

__all__ = ["FieldPlace", "find_place", "select_output"]


class FieldPlace(NamedTuple):
    """A coordinate along a dimension of a field.

    Attributes
    ----------
    dimension : str
        The dimension.
    position : int
        The position among the coordinates.
    remark : str
        Sentence on a place that is not where it was asked for; else empty.
    """

    dimension: str
    position: int
    remark: str


def find_place(field: xr.DataArray, text: str) -> FieldPlace:
    """Return the coordinate of a field that is nearest to a text of a user.

    Parameters
    ----------
    field : DataArray
        The field over runs.
    text : str
        Such as ``"time=10 day"``; without a unit it is that of the study.

    Raises
    ------
    UnknownNameError
        If the field has no such dimension.
    QuantityError
        If it is no quantity, or lies outside the coordinates.
    """
    name, _, asked = (part.strip() for part in text.partition("="))
    along = field_dimensions(field)
    if name not in along:
        known = choices(name, along) if along else "it is a single number or category"
        raise UnknownNameError(f'{field.name} has no dimension "{name}"; {known}')
    coordinate = field[name]
    values, unit = coordinate.values, shown_unit(coordinate.attrs)
    if not asked:
        raise QuantityError(toml_text(text), f"a place, such as {name}=1")
    try:
        value = scale(unit).to_si(float(asked))
    except ValueError:
        value = parse_quantity(asked, unit).value
    if not values[0] <= value <= values[-1]:
        first, last = (coordinate_text(coordinate, end) for end in values[[0, -1]])
        raise QuantityError(toml_text(text), f"{first} to {last.partition('= ')[2]}")
    position = int(np.abs(values - value).argmin())
    is_there = np.isclose(values[position], value, rtol=1e-9, atol=0)
    nearest = f"{coordinate_text(coordinate, values[position])} is the nearest to {asked}"
    return FieldPlace(name, position, "" if is_there else nearest)


def select_output(
    tree: xr.DataTree, output: str, at: Sequence[str] = ()
) -> tuple[xr.DataTree, list[FieldPlace]]:
    """Return an archive as if its models had one output, the values of a field at some places.

    A field at a place is a number there, and so has the tables and the JSON of one.

    Parameters
    ----------
    tree : DataTree
        An archive of a study.
    output : str
        The output that remains.
    at : sequence of str
        A place along each dimension to cut, such as ``"time=10 day"``; see `find_place`.

    Returns
    -------
    tree : DataTree
        The archive; the coordinates of the places remain as scalar ones.
    places : list of FieldPlace
        The coordinates that were found.

    Raises
    ------
    UnknownNameError
        If no model has this output, or the output has no such dimension.
    QuantityError
        If a place is not inside the coordinates, or a dimension has two.
    """
    described = {
        name: runs[name]
        for model in reversed(model_trees(tree).values())
        for runs in (first_runs(model),)
        for name in output_names(runs)
    }
    if output not in described:
        known = choices(output, described)
        raise UnknownNameError(f'the archive has no output "{output}"; {known}')
    places = [find_place(described[output], text) for text in at]
    positions = {place.dimension: place.position for place in places}
    if len(positions) < len(places):
        raise QuantityError(", ".join(at), "one place along each dimension")
    others = described.keys() - {output}
    groups = {}
    for node in tree.subtree:
        kind, names = group_place(node.relative_to(tree))
        if names.get("output") in others:
            continue
        dataset = node.to_dataset(inherit=False)
        if kind == RUNS:
            dataset = dataset.drop_vars(others, errors="ignore")
        if kind in GROUPS and GROUPS[kind].is_along_fields:
            dataset = dataset.isel(positions, missing_dims="ignore")
        if FITTED in dataset.attrs:
            kept = [name for name in fitted_outputs(node) if name == output]
            dataset = dataset.assign_attrs({FITTED: " ".join(kept)})
        groups[node.path] = dataset
    return xr.DataTree.from_dict(groups), places
