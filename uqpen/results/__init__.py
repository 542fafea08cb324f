"""The results that a person or a script reads, from the archive alone."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["TABLE_FORMATS", "TableFormat"]


class TableFormat(NamedTuple):
    """Format of a table for other programs, which is also the ending of its files."""

    # Reference. It takes consecutive parts of a table, and yields the content of a file.
    function: str
    title: str  # its name
    help: str  # of the option of the command line
    needs_file: bool = False  # true if it is no text, so that standard output does not take it


# By the names of their options; the first is the default.
TABLE_FORMATS = {
    "csv": TableFormat(
        "uqpen.results.export:csv_content", "CSV", "Comma-separated values.  [default]"
    ),
    "parquet": TableFormat(
        "uqpen.results.export:parquet_content",
        "Parquet",
        "Parquet; needs -o and pyarrow.",
        needs_file=True,
    ),
    "xlsx": TableFormat(
        "uqpen.results.export:excel_content",
        "Excel",
        "Excel; needs -o and openpyxl.",
        needs_file=True,
    ),
    "json": TableFormat(
        "uqpen.results.export:json_content", "JSON", "A list with an object for each row."
    ),
}
