"""Surrogate of an archive as an argument of the command line: ``ARCHIVE:NAME``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.surrogates.archived_surrogate import ArchivedSurrogate

__all__ = ["open_surrogate", "split_surrogate"]


def split_surrogate(argument: str) -> tuple[Path, str] | None:
    """Return the archive and the name of ``ARCHIVE:NAME``; no name for ``ARCHIVE`` alone.

    None stands for an argument that names no archive.
    """
    path, _, name = argument.rpartition(".nc:")
    if path:
        return Path(f"{path}.nc"), name
    return (Path(argument), "") if argument.endswith(".nc") else None


def open_surrogate(
    tree: xr.DataTree, path: Path, name: str, folder: Path | None, *, trust: bool
) -> ArchivedSurrogate:
    """Return a surrogate of an archive; the only one where no name is given.

    Code that the archive names is executed only with `trust`. `folder` has the files that its study
    names, by default those that it keeps.

    Raises
    ------
    UnknownNameError
        If the archive has no such surrogate, or several and no name is given.
    UqpenError
        As `archived_surrogate`, and if trusted code cannot be loaded.
    """
    from uqpen.core.errors import UnknownNameError
    from uqpen.surrogates.archived_surrogate import archived_surrogate, surrogate_paths
    from uqpen.verification.archived_study import restored_study

    paths = surrogate_paths(tree)
    if not paths:
        raise UnknownNameError(f"{path}: contains no surrogate")
    if not name and len(paths) > 1:
        raise UnknownNameError(
            f"{path}: contains several surrogates; expected one of {_list(path, paths)}"
        )
    label = name or next(iter(paths))
    if not trust or label not in paths:
        return archived_surrogate(tree, label)
    with restored_study(tree, folder, trust=True) as restored:
        settings = restored.study.surrogates[paths[label][1]]
        return archived_surrogate(tree, label, kind=None if settings.absence else type(settings))


def _list(path: Path, names: object) -> str:
    return ", ".join(f"{path}:{name}" for name in names)  # type: ignore[attr-defined]
