"""Archives as one dictionary each, read by netCDF4 alone.

Nothing of uqpen is used here: whoever asks whether a redesign has changed a number cannot ask the
code that was redesigned.
"""

from __future__ import annotations

from pathlib import Path

from flat_archive.content import Flat, Key, NoPlaceError, read
from flat_archive.head_to_head import flat_of_head_to_head
from flat_archive.study import flat_of_study

__all__ = ["Flat", "Key", "NoPlaceError", "flat_archive"]


def flat_archive(path: Path) -> Flat:
    """Flatten an archive.

    Parameters
    ----------
    path : Path
        Of a study or of methods head to head.

    Raises
    ------
    NoPlaceError
        If something in the archive is left over, or contradicts itself.
    """
    tree = read(path)
    is_study = "uqpen_kind" not in tree.groups["/"].attributes
    flat = flat_of_study(tree) if is_study else flat_of_head_to_head(tree)
    if left := tree.left():
        raise NoPlaceError(f"{path.name}: no place for {', '.join(left)}")
    return flat
