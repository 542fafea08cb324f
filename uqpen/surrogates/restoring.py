"""Restore a fitted surrogate from an archive; nothing in it is executed."""

from __future__ import annotations

import xarray as xr

from uqpen.core.lookup import resolve_name
from uqpen.core.model import Model
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["restore_surrogate"]


def restore_surrogate(
    tree: xr.DataTree, name: str, original: Model | None = None
) -> FittedSurrogate:
    """Restore a fitted surrogate of the kind that its group names.

    Parameters
    ----------
    tree : DataTree
        The result of `FittedSurrogate.to_tree`, or the group read from an archive.
    name : str
        Its name in the study.
    original : Model, optional
        The original model; without it, every finite input counts as admissible.

    Raises
    ------
    UnknownNameError
        If there is no such kind.
    """
    kind: type[Surrogate] = resolve_name(SURROGATES, str(tree.attrs["kind"]), "kind of surrogate")
    return kind.restore(tree, name, original)
