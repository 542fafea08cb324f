"""An archive cut down to one output, and to places of it where that is a field."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from uqpen.archive.groups import GROUPS, group_place, model_trees
from uqpen.core.errors import QuantityError, UnknownNameError
from uqpen.core.labels import RUNS
from uqpen.core.lookup import choices
from uqpen.results.field_places import FieldPlace, find_place
from uqpen.results.surrogate_fits import FITTED, fitted_outputs
from uqpen.results.table import first_runs, output_names

__all__ = ["select_output"]


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
