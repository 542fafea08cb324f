"""Tables of an archive as the bytes of a file that other programs read."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from uqpen.core.errors import ExportError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FORMATS", "table_content"]


def table_content(parts: Iterable[pd.DataFrame], kind: str) -> Iterator[bytes]:
    """Yield a table as the content of a file of one of the `FORMATS`, part after part.

    Numbers have all their digits. JSON is a list with an object for each row, null for a missing
    value.

    Parameters
    ----------
    parts : iterable of DataFrame
        Consecutive rows of the table, with the same columns.
    kind : str
        The format.

    Raises
    ------
    ExportError
        If it is Parquet, and no package that writes it is installed; nothing of the table is then
        made.
    """
    return _WRITERS[kind](parts)


def _csv(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    for number, part in enumerate(parts):
        yield part.to_csv(index=False, header=not number, lineterminator="\n").encode()


def _json(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    before = "["
    for part in parts:
        as_objects = part.astype(object).where(part.notna(), None)
        if rows := as_objects.to_dict("records"):
            text = json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False)
            yield (before + text.removeprefix("[").removesuffix("\n]")).encode()
            before = ","
    yield b"[]\n" if before == "[" else b"\n]\n"


def _parquet(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    """Yield a row group for each part."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise ExportError("Parquet needs pyarrow: pip install pyarrow") from None
    written, writer = _Written(), None
    for part in parts:
        if writer is None:
            # In the first rows, a text may be missing everywhere.
            schema = pyarrow.Schema.from_pandas(part, preserve_index=False)
            for place, each in enumerate(schema):
                if pyarrow.types.is_null(each.type):
                    schema = schema.set(place, each.with_type(pyarrow.string()))
            writer = parquet.ParquetWriter(written, schema)
        writer.write_table(pyarrow.Table.from_pandas(part, schema, preserve_index=False))
        yield written.take()
    if writer is not None:
        writer.close()
    yield written.take()


class _Written(io.RawIOBase):
    """Stream whose bytes are taken away from time to time."""

    def __init__(self) -> None:
        super().__init__()
        self._parts: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, content: Any) -> int:
        self._parts.append(bytes(content))
        return len(self._parts[-1])

    def take(self) -> bytes:
        """Return what was written since it was called before."""
        found = b"".join(self._parts)
        self._parts.clear()
        return found


_WRITERS = {"csv": _csv, "parquet": _parquet, "json": _json}
FORMATS = tuple(_WRITERS)
