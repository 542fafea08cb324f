"""Tables of an archive as the bytes of a file that other programs read."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING

from uqpen.core.errors import ExportError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FORMATS", "table_bytes"]

FORMATS = ("csv", "parquet", "json")


def table_bytes(table: pd.DataFrame, kind: str, *, has_header: bool = True) -> bytes:
    """Return a table as a file of one of the `FORMATS`.

    Numbers have all their digits. JSON is a list with an object for each row, null for a missing
    value. CSV without a header goes on with a table.

    Raises
    ------
    ExportError
        If it is Parquet, and no package that writes it is installed.
    """
    if kind == "csv":
        return table.to_csv(index=False, header=has_header, lineterminator="\n").encode()
    if kind == "json":
        as_objects = table.astype(object).where(table.notna(), None)
        rows = as_objects.to_dict("records")
        return (json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
    stream = io.BytesIO()
    try:
        table.to_parquet(stream, index=False)
    except ImportError:
        raise ExportError("Parquet needs pyarrow: pip install pyarrow") from None
    return stream.getvalue()
