"""Restore a fitted surrogate from an archive; nothing in it is executed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uqpen.core.errors import ArchiveError, ModelError, UqpenError
from uqpen.core.labels import SURROGATES as GROUP
from uqpen.core.lookup import installed_members, load_installed, resolve_name
from uqpen.core.model import Model
from uqpen.surrogates import ENTRY_POINTS, SURROGATES
from uqpen.surrogates.field_surrogate import FieldSurrogate, has_fields
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.surrogates.surrogate import Surrogate

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["is_restorable", "restore_surrogate"]


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
    name : str
        Its name in the study.
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
