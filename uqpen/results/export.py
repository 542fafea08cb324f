"""Tables of an archive as the bytes of a file that other programs read."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from uqpen.core.errors import ExportError
from uqpen.core.lookup import resolve
from uqpen.core.units import NUMBER
from uqpen.results import TABLE_FORMATS

if TYPE_CHECKING:
    import pandas as pd

# A spreadsheet takes a text that begins so as a formula, which may start programs.
_BEFORE_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
_QUANTITY = re.compile(rf"(?:{NUMBER})(?: [^=|!(]*)?")


def table_content(parts: Iterable[pd.DataFrame], kind: str) -> Iterator[bytes]:
    """Yield a table as the content of a file, from consecutive parts with the same columns.

    Numbers have all their digits. An ExportError is raised before anything is made if no package
    that writes the format is installed.
    """
    content: Iterator[bytes] = resolve(TABLE_FORMATS[kind].function)(parts)
    return content


def csv_content(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    """Yield a table as CSV.

    An apostrophe stands before a text that begins as a formula of a spreadsheet does, so that it is
    shown.
    """
    for number, part in enumerate(parts):
        texts = part.select_dtypes(exclude=["number", "bool"])
        plain = part.assign(**{str(name): each.map(_no_formula) for name, each in texts.items()})
        yield plain.to_csv(index=False, header=not number, lineterminator="\n").encode()


def _no_formula(value: Any) -> Any:
    """Put an apostrophe before a text that a spreadsheet would execute, and leave a quantity."""
    is_formula = isinstance(value, str) and value.startswith(_BEFORE_FORMULAS)
    return f"'{value}" if is_formula and not _QUANTITY.fullmatch(value) else value


def json_content(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    """Yield a table as a list with an object for each row, null for a missing value."""
    before = "["
    for part in parts:
        as_objects = part.astype(object).where(part.notna(), None)
        if rows := as_objects.to_dict("records"):
            text = json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False)
            yield (before + text.removeprefix("[").removesuffix("\n]")).encode()
            before = ","
    yield b"[]\n" if before == "[" else b"\n]\n"


def parquet_content(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    """Yield a table as Parquet, with a row group for each part."""
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
