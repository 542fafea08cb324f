"""The results that a person or a script reads, from the archive alone."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["TABLE_FORMATS", "TableFormat"]


class TableFormat(NamedTuple):
    """Format of a table for other programs, which is also the ending of its files.

    Parameters
    ----------
    function : str
        Reference. It takes consecutive parts of a table, and yields the content of a file.
    title : str
        Its name.
    help : str
        Of the option of the command line.
    needs_file : bool
        True if it is no text, so that standard output does not take it.
    """

    function: str
    title: str
    help: str
    needs_file: bool = False


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
    "json": TableFormat(
        "uqpen.results.export:json_content", "JSON", "A list with an object for each row."
    ),
}
