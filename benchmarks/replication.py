"""How often `uqpen replicate` claims a reading against a right report, and finds a planted one.

A table as `seed_table.py` makes it, of docs/replicate.md. Each seed makes a report of the concrete
study: means and standard deviations of 10 000 draws of one reading, printed with the report's
digits. Ten times as many other draws test it, with the declared readings of the study. A cell fails
if a right report meets more claims than a test at 5 % explains, or a planted reading is too seldom
in the set.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import xarray as xr
from scipy import stats
from seed_table import STUDIES, Row, SeedTable, per_cent, table, totals

from uqpen.core.progress import Progress
from uqpen.core.streams import Stream
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.replication import LEVEL
from uqpen.statistics.published import Publication, TableComparison, compare_moments
from uqpen.study.load import load_study, reading_study
from uqpen.workflow import run_design

STUDY = load_study(STUDIES / "concrete.toml")
REPORT = STUDY.published["report"]
# Reports that are tested by the same runs of the archive, whose noise is small beside theirs.
SHARED = 10
# Readings that change the figures compared here; the others change responses alone.
STATED = "as stated"
PLANTED = (STATED, *(name for name in REPORT.readings if name not in ("backward", "forward")))
# Decimals in metres, as the report prints them.
DECIMALS = {"penetration_depth": 3, "projectile_residue": 4}
COUNTS = ("tests", "rejected", "claims", "in_set", "alone")
# A planted reading counts as one that can be found where it moves a figure by more deviations.
FAR, LEAST = 4.0, 0.93


BY_READING = {STATED: STUDY} | {
    name: reading_study(STUDY, each) for name, each in REPORT.readings.items()
}


def _runs(name: str, seed: int, purpose: str, size: int) -> xr.Dataset:
    stream, design = Stream(seed, "replication", purpose), MonteCarlo(runs=size)
    made = run_design(BY_READING[name], design, stream, map=map, progress=Progress())
    return next(iter(made.values()))


@cache
def _archive(name: str, block: int, size: int) -> xr.Dataset:
    """Make the archive's runs of a reading, which the reports of a block of seeds share."""
    return _runs(name, block, "archive", size)[["status", *DECIMALS]].load()


def _test(report: Publication, name: str, seed: int, size: int) -> TableComparison:
    """Compare a report with draws of a reading; all readings have the same draws."""
    lost = {} if name == STATED else REPORT.readings[name].lost
    rng = Stream(seed, "replication", "vectors").generator()
    return compare_moments(report, _archive(name, seed // SHARED, size), rng, lost)


def _printed(name: str, seed: int) -> Publication:
    """Return a report of 10 000 draws of a reading, rounded as the report is."""
    lost = {} if name == STATED else REPORT.readings[name].lost
    rng = Stream(seed, "replication", "print").generator()
    found = compare_moments(REPORT, _runs(name, seed, "report", 10_000), rng, lost)
    figures = {(each.output, each.figure): each.found for each in found.figures}
    estimates = []
    for each in REPORT.estimates:
        output = each.output.name
        values = {key: round(figures[output, key], DECIMALS[output]) for key in each.moments}
        half = dict.fromkeys(values, 0.5 * 10 ** -DECIMALS[output])
        estimates.append(replace(each, **values, rounding=half))
    return replace(REPORT, estimates=tuple(estimates))


def _rows(planted: str, seeds: Sequence[int], archive_runs: int) -> Iterator[Row]:
    counts = dict.fromkeys(COUNTS, 0)
    moved = 0.0
    for seed in seeds:
        report = _printed(planted, seed)
        stated = _test(report, STATED, seed, archive_runs)
        moved += max(abs(each.z) for each in stated.figures)
        counts["tests"] += 1
        if stated.p >= LEVEL:
            continue
        counts["rejected"] += 1
        readings = REPORT.readings
        fitting = [each for each in readings if _test(report, each, seed, archive_runs).p >= LEVEL]
        counts["claims"] += bool(fitting)
        counts["in_set"] += planted in fitting
        counts["alone"] += fitting == [planted]
    yield {**counts, "moved": moved}


def _planted(part: str, whole: str) -> Callable[[SimpleNamespace], str]:
    def text(c: SimpleNamespace) -> str:
        counted = getattr(c, whole)
        is_none = c.planted == STATED or not counted
        return "–" if is_none else per_cent(getattr(c, part), counted)

    return text


COLUMNS = {
    "the report was made by": "planted",
    "reports": "tests",
    "mean largest z, without sign": lambda c: f"{c.moved / c.tests:.1f}",
    "study rejected [%]": lambda c: per_cent(c.rejected, c.tests),
    "a reading named [%]": lambda c: per_cent(c.claims, c.tests),
    "its reading among them [% of rejected]": _planted("in_set", "rejected"),
    "alone [%]": _planted("alone", "tests"),
}


def _cells(rows: Sequence[Row]) -> dict[str, SimpleNamespace]:
    found = totals(rows, "planted")
    return {name: found[name,] for name in PLANTED if (name,) in found}


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for name, cell in _cells(rows).items():
        if name == STATED:
            # 16 of 200 is what a test of exactly 5 % exceeds in less than 3 % of tables.
            if cell.claims > stats.binom.ppf(0.975, cell.tests, LEVEL):
                yield f"{name}: {cell.claims} claims in {cell.tests}"
        elif cell.rejected and cell.moved > FAR * cell.tests:
            least = stats.binom.ppf(0.025, cell.rejected, LEAST)
            if cell.in_set < least:
                yield f"{name}: in the set in {cell.in_set} of {cell.rejected}"


TABLE = SeedTable(
    {"planted": PLANTED},
    _rows,
    {"replication": lambda rows: table(_cells(rows).values(), COLUMNS)},
    _failing,
    seeds=200,
    at_once=20,
    options={"--archive-runs": {"type": int, "default": 100_000}},
)

if __name__ == "__main__":
    TABLE.main(__doc__)
