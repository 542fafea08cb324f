"""Tables over many seeds: made block by block, kept in a file, and put on a page of the docs.

A script states its cases, what some seeds of a case give as rows of counts, and how the rows make a
table. Rows go into a file as they come, with the case and the seeds that they are of. A script that
was stopped goes on behind what its file has; files of other seeds add up:

    python benchmarks/SCRIPT.py --seeds 1000 --output FILE.csv
    python benchmarks/SCRIPT.py --from FILE.csv … --markdown docs/PAGE.md
"""

from __future__ import annotations

import argparse
import csv
import itertools
import multiprocessing
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from uqpen.core.processors import one_blas_thread

Row = Mapping[str, Any]
Case = tuple[str | int, ...]

# Of a cell that is judged: the least coverage, and the fewest intervals.
LOWEST, FEWEST = 0.92, 50


@dataclass(frozen=True)
class SeedTable:
    """Tables of the docs, and how they are made.

    Parameters
    ----------
    keys : tuple of str
        Columns that tell cases apart.
    cases : callable
        All cases, each a value for every key; ``--only`` takes some by these values.
    rows : callable
        Rows of a case and some seeds, from the case, the seeds and the options.
    tables : mapping of str to callable
        By the marks on the page between which it stands: lines of a table from the rows of all
        files; none if the rows have nothing for it.
    failing : callable
        A line for each cell that fails, from these rows.
    seeds, at_once : int
        Number of seeds unless another one is asked for, and that of a block.
    options : callable
        Adds options of its own.
    """

    keys: tuple[str, ...]
    cases: Callable[[], Iterable[Case]]
    rows: Callable[[Case, Sequence[int], argparse.Namespace], Iterable[Row]]
    tables: Mapping[str, Callable[[Sequence[Row]], Iterable[str]]]
    failing: Callable[[Sequence[Row]], Iterable[str]] = lambda _: ()
    seeds: int = 1000
    at_once: int = 1
    options: Callable[[argparse.ArgumentParser], None] = lambda _: None

    def main(self, description: str | None) -> int:
        """Make the table as the command line says; 1 if a cell fails."""
        script = Path(sys.argv[0]).stem
        parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
        parser.add_argument("--first", type=int, default=0, help="the first seed")
        parser.add_argument("--seeds", type=int, default=self.seeds)
        parser.add_argument("--only", default="", help="what a case has in it", metavar="REGEX")
        parser.add_argument("--workers", type=int, default=1)
        parser.add_argument("--output", type=Path, default=Path(f"{script}.csv"))
        parser.add_argument("--from", dest="earlier", type=Path, nargs="+", metavar="FILE.csv")
        parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
        self.options(parser)
        options = parser.parse_args()
        if not options.earlier:
            self._make(options)
        rows = _read(options.earlier or [options.output])
        for name, table in self.tables.items():
            if text := "\n".join(table(rows)):
                print(f"\n{text}")
                if options.markdown:
                    fill(options.markdown, name, text)
        failing = list(self.failing(rows))
        for line in failing:
            print("FAILS", line)
        return 1 if failing else 0

    def _make(self, options: argparse.Namespace) -> None:
        """Add to the file what it lacks: some seeds of all cases, then the next."""
        keys = (*self.keys, "first", "count")
        made = _read([options.output]) if options.output.exists() else []
        known = {
            (*(str(row[key]) for key in self.keys), seed)
            for row in made
            for seed in range(row["first"], row["first"] + row["count"])
        }
        cases = [case for case in self.cases() if re.search(options.only, _title(case))]
        last = options.first + options.seeds
        jobs = []
        for start, case in itertools.product(range(options.first, last, self.at_once), cases):
            block = range(start, min(start + self.at_once, last))
            left = [seed for seed in block if (*map(str, case), seed) not in known]
            if left:
                jobs.append((case, left))
        columns = list(made[0]) if made else []
        with options.output.open("a", newline="", encoding="utf-8") as file:
            for (case, seeds), rows in zip(jobs, self._work(jobs, options), strict=True):
                of = dict(zip(keys, (*case, seeds[0], len(seeds)), strict=True))
                found = [of | dict(row) for row in rows]
                if found and not columns:
                    columns = list(found[0])
                    csv.writer(file).writerow(columns)
                csv.DictWriter(file, columns).writerows(found)
                file.flush()
                print(f"{_title(case)}: seeds to {seeds[-1]}", flush=True)

    def _work(
        self, jobs: Sequence[tuple[Case, list[int]]], options: argparse.Namespace
    ) -> Iterator[list[Row]]:
        if options.workers == 1:
            yield from map(partial(_rows, self, options), jobs)
            return
        # Forked workers share what the cases have made; they know the table by its script.
        global _forked
        _forked = partial(_rows, self, options)
        with multiprocessing.get_context("fork").Pool(options.workers) as pool:
            yield from pool.imap(_call, jobs)


def _title(case: Case) -> str:
    return ", ".join(map(str, case))


_forked: Callable[[tuple[Case, list[int]]], list[Row]]


def _call(job: tuple[Case, list[int]]) -> list[Row]:
    return _forked(job)


def _rows(table: SeedTable, options: argparse.Namespace, job: tuple[Case, list[int]]) -> list[Row]:
    with one_blas_thread():
        return list(table.rows(*job, options))


def _read(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """Return the rows of files one after the other; what stands for a number is one."""
    rows: list[dict[str, Any]] = []
    for path in paths:
        with path.open(newline="", encoding="utf-8") as file:
            rows += [
                {name: _number_or_text(text) for name, text in row.items()}
                for row in csv.DictReader(file)
            ]
    return rows


def _number_or_text(text: str) -> str | int | float:
    try:
        return int(text) if text.isdigit() else float(text)
    except ValueError:
        return text


def totals(
    rows: Iterable[Row], keys: Sequence[str], sums: Sequence[str]
) -> dict[tuple[Any, ...], SimpleNamespace]:
    """Add up some columns of the rows with the same keys."""
    found: dict[tuple[Any, ...], SimpleNamespace] = {}
    for row in rows:
        cell = found.setdefault(
            tuple(row[key] for key in keys), SimpleNamespace(**dict.fromkeys(sums, 0))
        )
        for name in sums:
            setattr(cell, name, getattr(cell, name) + row[name])
    return found


def lines(head: Sequence[str], rows: Iterable[Iterable[object]]) -> Iterator[str]:
    """Yield a table in Markdown."""
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    for row in rows:
        yield f"| {' | '.join(map(str, row))} |"


def too_seldom(cells: Mapping[Any, SimpleNamespace]) -> Iterator[str]:
    """Yield a line for each cell whose intervals cover too seldom."""
    for key, cell in cells.items():
        if cell.intervals >= FEWEST and cell.covers < LOWEST * cell.intervals:
            yield f"{key}: {per_cent(cell.covers, cell.intervals)}"


def per_cent(part: float, whole: float) -> str:
    """Return a share in per cent."""
    return f"{100 * part / whole:.1f}"


def fill(path: Path, name: str, text: str) -> None:
    """Put tables between their marks on a page; in the folder of coverage, as data beside it."""
    if path.parent.name == "coverage":
        text = _as_data(path.parent, name, text)
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    page = path.read_text(encoding="utf-8")
    if begin not in page:
        raise SystemExit(f"{path} has no mark {begin}")
    before, _, rest = page.partition(begin)
    path.write_text(f"{before}{begin}\n{text}\n{end}{rest.partition(end)[2]}", encoding="utf-8")


def _as_data(folder: Path, name: str, text: str) -> str:
    """Write the tables of a text into files, and return it with these in their places."""
    blocks = [
        (is_table, list(rows))
        for is_table, rows in itertools.groupby(text.splitlines(), lambda row: row.startswith("|"))
    ]
    stem = name.replace(" ", "_")
    several = sum(is_table for is_table, _ in blocks) > 1
    found: list[str] = []
    number = 0
    for is_table, rows in blocks:
        if not is_table:
            found += rows
            continue
        number += 1
        file = f"{stem}_{number}.csv" if several else f"{stem}.csv"
        cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows]
        with (folder / file).open("w", newline="", encoding="utf-8") as opened:
            csv.writer(opened, lineterminator="\n").writerows([cells[0], *cells[2:]])
        found += ["```{csv-table}", f":file: {file}", ":header-rows: 1", "```"]
    return "\n".join(found)
