"""CSV files of results: written as they come, read again, and the options that name them."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TextIO, TypeVar

__all__ = [
    "add_table_options",
    "append_results",
    "number_or_text",
    "read_records",
    "read_rows",
    "result_file",
    "write_rows",
]

Result = TypeVar("Result", bound=NamedTuple)


def add_table_options(parser: argparse.ArgumentParser, output: str) -> None:
    """Add the options of a script that writes a file, or makes a table of earlier ones.

    Parameters
    ----------
    parser : ArgumentParser
        Of the script.
    output : str
        The file that it writes by default.
    """
    parser.add_argument("--output", type=Path, default=Path(output))
    parser.add_argument("--from", dest="earlier", type=Path, nargs="+", metavar="FILE.csv")
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")


class ResultFile:
    """File of results that is being written; an interruption loses none that were added."""

    def __init__(self, file: TextIO, columns: Sequence[str]) -> None:
        self._file = file
        self._writer = csv.DictWriter(file, columns)
        self._writer.writeheader()

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Write rows at once."""
        self._writer.writerows(rows)
        self._file.flush()


@contextmanager
def result_file(path: Path, columns: Sequence[str]) -> Iterator[ResultFile]:
    """Provide a new file of results in the place of an earlier one."""
    with path.open("w", newline="", encoding="utf-8") as file:
        yield ResultFile(file, columns)


def read_rows(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """Return the rows of files one after the other, as texts by column."""
    rows: list[dict[str, Any]] = []
    for path in paths:
        with path.open(newline="", encoding="utf-8") as file:
            rows += csv.DictReader(file)
    return rows


def read_records(paths: Iterable[Path]) -> list[list[str]]:
    """Return the rows of files one after the other, as lists of texts without the headings."""
    records: list[list[str]] = []
    for path in paths:
        with path.open(newline="", encoding="utf-8") as file:
            records += list(csv.reader(file))[1:]
    return records


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of the same columns into a file."""
    with result_file(path, list(rows[0])) as file:
        file.add(rows)


def append_results(results: Iterator[Result], path: Path) -> Iterator[Result]:
    """Yield results, each after it has been added to a file; so a script can be resumed."""
    is_new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        for result in results:
            if is_new:
                writer.writerow(result._fields)
                is_new = False
            writer.writerow(result)
            file.flush()
            yield result


def number_or_text(text: str) -> str | int | float:
    """Return the number that a text stands for, or the text."""
    try:
        return int(text) if text.isdigit() else float(text)
    except ValueError:
        return text
