"""Tables over many seeds: made block by block, kept in a file, and put on a page of the docs.

A script states its cases, what some seeds of a case give as rows of counts, and how the rows make a
table. Rows go into a file as they come, with the case and the seeds that they are of. A script that
was stopped goes on behind what its file has; files of other seeds add up:

    python benchmarks/SCRIPT.py --seeds 1000 --output FILE.csv
    python benchmarks/SCRIPT.py --from FILE.csv … --markdown docs/PAGE.md

A script of several tables takes the name of one as its first argument (`main`).
"""

from __future__ import annotations

import argparse
import csv
import itertools
import multiprocessing
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from pathlib import Path
from statistics import median
from types import SimpleNamespace
from typing import Any

from uqpen.core.processors import one_blas_thread

Row = Mapping[str, Any]
Case = tuple[Any, ...]
Job = tuple[Case, list[int]]

STUDIES = Path(__file__).parents[1] / "studies"
# Of a cell that is judged: the least coverage, and the fewest intervals.
LOWEST, FEWEST = 0.92, 50


@dataclass(frozen=True)
class SeedTable:
    """Tables of the docs, and how they are made.

    Parameters
    ----------
    keys : mapping of str to iterable, or sequence of str
        Columns that tell cases apart, and the values of each; ``--only`` takes some cases by these.
    rows : callable
        Rows of a case and some seeds, from the values of the case, the seeds and the options of its
        own by name.
    tables : mapping of str to callable
        By the marks on the page between which it stands: lines of a table from the rows of all
        files; none if the rows have nothing for it.
    failing : callable
        A line for each cell that fails, from these rows.
    seeds, at_once : int
        Number of seeds unless another one is asked for, and that of a block.
    options : mapping of str to mapping
        Options of its own, with what argparse takes of each.
    cases : callable
        All cases, where they are not all combinations of the values.
    """

    keys: Mapping[str, Iterable[Any]] | Sequence[str]
    rows: Callable[..., Iterable[Row]]
    tables: Mapping[str, Callable[[Sequence[Row]], Iterable[str]]]
    failing: Callable[[Sequence[Row]], Iterable[str]] = lambda _: ()
    seeds: int = 1000
    at_once: int = 1
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    cases: Callable[[], Iterable[Case]] | None = None

    def main(self, description: str | None, name: str = "") -> None:
        """Make the table as the command line says; leave with 1 if a cell fails."""
        file = Path("_".join([Path(sys.argv[0]).stem, *[name] * bool(name)])).with_suffix(".csv")
        parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
        parser.add_argument("--first", type=int, default=0, help="the first seed")
        parser.add_argument("--seeds", type=int, default=self.seeds)
        parser.add_argument("--only", default="", help="what a case has in it", metavar="REGEX")
        parser.add_argument("--workers", type=int, default=1)
        parser.add_argument("--output", type=Path, default=file)
        parser.add_argument("--from", dest="earlier", type=Path, nargs="+", metavar="FILE.csv")
        parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
        common = vars(parser.parse_args([]))
        for name, settings in self.options.items():
            parser.add_argument(name, **settings)
        options = parser.parse_args()
        if not options.earlier:
            own = {name: each for name, each in vars(options).items() if name not in common}
            self._make(options, own)
        rows = _read(options.earlier or [options.output])
        for name, table in self.tables.items():
            if text := "\n".join(table(rows)):
                print(f"\n{text}")
                if options.markdown:
                    fill(options.markdown, name, text)
        failing = list(self.failing(rows))
        for line in failing:
            print("FAILS", line)
        if failing:
            sys.exit(1)

    def _make(self, options: argparse.Namespace, own: Mapping[str, Any]) -> None:
        """Add to the file what it lacks: some seeds of all cases, then the next."""
        keys = (*self.keys, "first", "count")
        made = _read([options.output]) if options.output.exists() else []
        known = {
            (*(str(row[key]) for key in self.keys), seed)
            for row in made
            for seed in range(row["first"], row["first"] + row["count"])
        }
        if self.cases:
            cases = self.cases()
        else:
            assert isinstance(self.keys, Mapping)
            cases = itertools.product(*self.keys.values())
        cases = [case for case in cases if re.search(options.only, _title(case))]
        last = options.first + options.seeds
        jobs = []
        for start, case in itertools.product(range(options.first, last, self.at_once), cases):
            block = range(start, min(start + self.at_once, last))
            left = [seed for seed in block if (*map(str, case), seed) not in known]
            if left:
                jobs.append((case, left))
        columns = list(made[0]) if made else []
        with options.output.open("a", newline="", encoding="utf-8") as file:
            made_of = self._work(jobs, options.workers, own)
            for (case, seeds), rows in zip(jobs, made_of, strict=True):
                of = dict(zip(keys, (*case, seeds[0], len(seeds)), strict=True))
                found = [of | dict(row) for row in rows]
                if found and not columns:
                    columns = list(found[0])
                    csv.writer(file).writerow(columns)
                csv.DictWriter(file, columns).writerows(found)
                file.flush()
                print(f"{_title(case)}: seeds to {seeds[-1]}", flush=True)

    def _work(
        self, jobs: Sequence[Job], workers: int, own: Mapping[str, Any]
    ) -> Iterator[list[Row]]:
        if workers == 1:
            yield from map(partial(_rows, self, own), jobs)
            return
        # Forked workers share what the cases have made; they know the table by its script.
        global _forked
        _forked = partial(_rows, self, own)
        with multiprocessing.get_context("fork").Pool(workers) as pool:
            yield from pool.imap(_call, jobs)


def main(tables: Mapping[str, SeedTable], description: str | None) -> None:
    """Make the table that the first argument names, by the arguments behind it."""
    if len(sys.argv) < 2 or sys.argv[1] not in tables:
        sys.exit(f"which table? the first argument is one of {', '.join(tables)}")
    name = sys.argv.pop(1)
    tables[name].main(description, name)


def _title(case: Case) -> str:
    return ", ".join(map(str, case))


_forked: Callable[[Job], list[Row]]


def _call(job: Job) -> list[Row]:
    return _forked(job)


def _rows(table: SeedTable, own: Mapping[str, Any], job: Job) -> list[Row]:
    case, seeds = job
    with one_blas_thread():
        return list(table.rows(*case, seeds, **own))


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


def grouped(rows: Iterable[Row], *keys: str) -> dict[Case, list[Row]]:
    """Return the rows with the same keys, by these."""
    found: dict[Case, list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in keys), []).append(row)
    return found


def totals(rows: Iterable[Row], *keys: str) -> dict[Case, SimpleNamespace]:
    """Add up all numbers of the rows with the same keys; a cell has these keys, too."""
    found: dict[Case, SimpleNamespace] = {}
    for key, group in grouped(rows, *keys).items():
        sums = found[key] = SimpleNamespace(**dict(zip(keys, key, strict=True)))
        for row in group:
            for name, value in row.items():
                if name not in keys and isinstance(value, int | float):
                    setattr(sums, name, getattr(sums, name, 0) + value)
    return found


def medians(rows: Iterable[Row], *keys: str) -> dict[Case, SimpleNamespace]:
    """Return the medians of all numbers of the rows with the same keys; a cell has these, too."""
    found = {}
    for key, group in grouped(rows, *keys).items():
        numbers = {name: [row[name] for row in group] for name in group[0] if name not in keys}
        middle = {
            name: median(each) for name, each in numbers.items() if isinstance(each[0], int | float)
        }
        found[key] = SimpleNamespace(**dict(zip(keys, key, strict=True)), **middle)
    return found


Columns = Mapping[str, str | Callable[[Any], object]]


def table(cells: Iterable[Any], columns: Columns) -> Iterator[str]:
    """Yield a table in Markdown; none without cells.

    A column has a function of a cell, or one of its names.
    """
    texts = [attrgetter(each) if isinstance(each, str) else each for each in columns.values()]
    if found := [[text(cell) for text in texts] for cell in cells]:
        yield from lines(columns, found)


def cross_table(
    cells: Iterable[Any],
    corner: str,
    row: Callable[[Any], str],
    column: Callable[[Any], str],
    text: Callable[[Sequence[Any]], str],
    columns: Iterable[str] = (),
) -> Iterator[str]:
    """Yield a table in Markdown with a text of the cells of each row and column, as they come."""
    found: dict[str, dict[str, list[Any]]] = {}
    for cell in cells:
        found.setdefault(row(cell), {}).setdefault(column(cell), []).append(cell)
    columns = dict.fromkeys([*columns, *(each for of in found.values() for each in of)])
    rows = ([name, *(text(of.get(each, ())) for each in columns)] for name, of in found.items())
    yield from lines([corner, *columns], rows)


def summed(columns: Columns, *keys: str) -> Callable[[Sequence[Row]], Iterator[str]]:
    """Return the table of what is added up for each case."""
    return lambda rows: table(totals(rows, *keys).values(), columns)


def share_of(part: str, whole: str = "count") -> Callable[[Any], str]:
    """Return a column with the share that a part of a cell is of its whole."""
    return lambda cell: share(getattr(cell, part), getattr(cell, whole))


def lines(head: Iterable[str], rows: Iterable[Iterable[object]]) -> Iterator[str]:
    """Yield a table in Markdown."""
    names = list(head)
    yield _line(names)
    yield "|---" * len(names) + "|"
    yield from map(_line, rows)


def _line(cells: Iterable[object]) -> str:
    texts = map(str, cells)
    return "".join(f"| {each} " if each else "| " for each in texts) + "|"


def too_seldom(cells: Mapping[Any, SimpleNamespace]) -> Iterator[str]:
    """Yield a line for each cell whose intervals cover too seldom."""
    for key, cell in cells.items():
        if cell.intervals >= FEWEST and cell.covers < LOWEST * cell.intervals:
            yield f"{key}: {per_cent(cell.covers, cell.intervals)}"


def per_cent(part: float, whole: float) -> str:
    """Return a share in per cent."""
    return f"{100 * part / whole:.1f}"


def share(part: float, whole: float) -> str:
    """Return a share in per cent with its sign; a dash of nothing."""
    return f"{per_cent(part, whole)} %" if whole else "–"


def mean_range(cell: SimpleNamespace) -> str:
    """Return the mean ends of a range, of those seeds that have one."""
    ends = (cell.least, cell.largest)
    found = " to ".join(f"{each / cell.intervals:.3g}" for each in ends if cell.intervals)
    return found or "–"


def counted(number: float) -> str:
    """Return a whole number with spaces between thousands."""
    return f"{number:,.0f}".replace(",", " ")


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
