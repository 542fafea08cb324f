"""Tables of an archive as the bytes of a file that other programs read."""

from __future__ import annotations

import io
import json
import math
import re
import zipfile
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

    Numbers have all their digits, and 16 in Excel. An ExportError is raised before anything is made
    if no package that writes the format is installed.
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


# A sheet of Excel has so many rows.
_MOST_EXCEL_ROWS = 1_048_576
# What a file says of the time when it was written, so that the same table has the same bytes.
_NO_TIME = (1980, 1, 1, 0, 0, 0)
_TIMES = re.compile(rb"(<dcterms:(?:created|modified)[^>]*>)[^<]*")


def excel_content(parts: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    """Yield a table as the sheet of an Excel file, under the headings that CSV has.

    ExportError for more rows than a sheet has.
    """
    try:
        from openpyxl import Workbook
    except ImportError:
        raise ExportError("Excel needs openpyxl: pip install uqpen[excel]") from None
    book = Workbook(write_only=True)
    sheet = book.create_sheet("uqpen")
    rows = 1
    for number, part in enumerate(parts):
        if not number:
            sheet.append([_excel_cell(sheet, str(name)) for name in part])
        rows += len(part)
        if rows > _MOST_EXCEL_ROWS:
            raise ExportError(
                f"a sheet of Excel has {_MOST_EXCEL_ROWS} rows, and the table more: write it as CSV"
            )
        as_objects = part.astype(object).where(part.notna(), None)
        for row in as_objects.itertuples(index=False, name=None):
            sheet.append([_excel_cell(sheet, value) for value in row])
    whole, timeless = io.BytesIO(), io.BytesIO()
    book.save(whole)
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(timeless, "w") as target:
        for entry in source.infolist():
            content = source.read(entry)
            if entry.filename == "docProps/core.xml":
                content = _TIMES.sub(rb"\g<1>1980-01-01T00:00:00Z", content)
            info = zipfile.ZipInfo(entry.filename, _NO_TIME)
            target.writestr(info, content, zipfile.ZIP_DEFLATED)
    yield timeless.getvalue()


def _excel_cell(sheet: Any, value: Any) -> Any:
    """Return a value for a row of Excel; a text stays one, and an infinite number becomes one."""
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE

    if isinstance(value, float) and not math.isfinite(value):
        value = None if math.isnan(value) else str(value)
    if not isinstance(value, str):
        return value
    made = WriteOnlyCell(sheet, ILLEGAL_CHARACTERS_RE.sub("\N{REPLACEMENT CHARACTER}", value))
    made.data_type = "s"  # else "=1" were a formula
    return made


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
