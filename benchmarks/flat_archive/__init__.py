"""Archives of any schema as one dictionary each, read by netCDF4 alone.

Nothing of uqpen is used here: whoever asks whether a redesign has changed a number cannot ask the
code that was redesigned. Names are those of schema 3; `schema_2` says what they were before.
"""

from __future__ import annotations

from pathlib import Path

from flat_archive.content import Flat, Key, NoPlaceError, read
from flat_archive.head_to_head import flat_of_head_to_head
from flat_archive.schema_2 import flat_of_schema_2
from flat_archive.schema_3 import flat_of_schema_3

__all__ = ["Flat", "Key", "NoPlaceError", "flat_archive"]

_STUDIES = {2: flat_of_schema_2, 3: flat_of_schema_3}


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
    root = tree.groups["/"].attributes
    schema = int(str(root["uqpen_schema"]))
    if schema not in _STUDIES:
        raise NoPlaceError(f"{path.name}: no flattener of schema {schema}")
    is_study = "uqpen_kind" not in root
    flat = _STUDIES[schema](tree) if is_study else flat_of_head_to_head(tree, schema)
    if left := tree.left():
        raise NoPlaceError(f"{path.name}: no place for {', '.join(left)}")
    return flat
