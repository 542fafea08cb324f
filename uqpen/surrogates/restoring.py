"""Restore a fitted surrogate from an archive; nothing in it is executed."""

from __future__ import annotations

import xarray as xr

from uqpen.core.errors import ArchiveError, UnknownNameError
from uqpen.core.labels import SURROGATES as GROUP
from uqpen.core.lookup import resolve_name
from uqpen.core.model import Model
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.surrogate import FittedSurrogate, Surrogate

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
    ArchiveError
        If its group lacks what its kind needs, or contradicts itself.
    """
    try:
        named = str(tree.attrs["kind"])
        kind: type[Surrogate] = resolve_name(SURROGATES, named, "kind of surrogate")
        return kind.fitted_class.from_tree(tree, name, original)
    except UnknownNameError:
        raise
    except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ArchiveError(f"/{GROUP}/{name}: is damaged: {reason}") from None
