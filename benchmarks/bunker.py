"""Do the methods agree on the wall? Probabilities and thicknesses of the rod in concrete, by each.

A table of docs/rod_models.md as `seed_table.py` makes it. The inputs are those of
``studies/bunker.toml`` that the Walker-Anderson model takes. Depths are those in a target without a
rear face.

All methods are designs of uqpen, with the intervals that an archive has: those of independent runs
are exact for a binomial count (Clopper-Pearson), and a thickness has a one-sided bound (Wilks).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from seed_table import STUDIES, Row, SeedTable, counted, lines

import uqpen
from uqpen.designs import DESIGNS
from uqpen.results.source_statistics import SourceStatistics

STUDY = STUDIES / "bunker.toml"
DEPTH = "penetration_depth"
THRESHOLDS = (54, 60, 80, 100, 150, 200, 300)  # cm
CONTENTS = (0.95, 0.99, 0.999, 0.9999, 0.99999)
# Events for which it is worth moving runs towards them, and one that every method sees.
ASKED = (60, 150, 300)
MOST_RUNS = "Monte Carlo, 10 million"


class Answer(NamedTuple):
    """What a method says of one quantity; an end that is not known is NaN."""

    quantity: str
    runs: int
    estimate: float
    lower: float
    upper: float


def study_text(seed: int, designs: str) -> str:
    """Return a study of the Walker-Anderson model with the inputs of the wall's study."""
    inputs = STUDY.read_text(encoding="utf-8").partition("[inputs]\n")[2].partition("\n\n")[0]
    exceeds = ", ".join(f'"{each} cm"' for each in THRESHOLDS)
    hold = ", ".join(map(str, CONTENTS))
    return (
        f'seed = {seed}\n[model]\nuse = "walker-anderson"\n[inputs]\n{inputs}\n'
        f'[outputs.{DEPTH}]\nunit = "cm"\nexceeds = [{exceeds}]\nhold = [{hold}]\n{designs}'
    )


def by_design(seed: int, settings: str) -> list[Answer]:
    """Ask a design whose runs are a sample."""
    study = uqpen.parse_study(study_text(seed, f"[designs.only]\n{settings}"))
    with tempfile.TemporaryDirectory() as folder:
        uqpen.make_archive(study, Path(folder) / "only.nc")
        statistics = SourceStatistics(uqpen.open_archive(Path(folder) / "only.nc"))
    runs = int(settings.partition("runs = ")[2].split()[0])
    found = []
    for name, label, scale in (
        ("exceedance", "P(> {})", 1.0),
        ("tolerance_limit", "{:g} %", 100.0),
    ):
        array = statistics.get("only", DEPTH, name)
        for entry in array if array is not None else ():
            key = (
                entry["threshold"].item() if name == "exceedance" else 100 * entry["content"].item()
            )
            numbers = (scale * entry.values).tolist()
            found.append(Answer(label.format(key), runs, *numbers))
    return found


def towards_event(seed: int, kind: str) -> list[Answer]:
    """Ask a design for rare events, once for each event."""
    found = []
    for threshold in ASKED:
        event = f'event = "{DEPTH} > {threshold} cm"'
        settings = f'[designs.only]\nkind = "{kind}"\n{event}\n'
        tree = uqpen.run(uqpen.parse_study(study_text(seed, settings)))
        array = SourceStatistics(tree).joint_probability("only")
        runs = int(tree["runs/only"].sizes["run"])
        if array is not None:
            numbers = array.values[0].tolist()
            found.append(Answer(f"P(> {threshold} cm)", runs, *numbers))
    return found


def methods() -> dict[str, Callable[[int], list[Answer]]]:
    """Return the methods by name, each a function of the seed."""
    found: dict[str, Callable[[int], list[Answer]]] = {
        "Monte Carlo, 10 000": lambda seed: by_design(seed, 'kind = "monte-carlo"\nruns = 10_000'),
        MOST_RUNS: lambda seed: by_design(
            seed, 'kind = "monte-carlo"\nruns = 10_000_000\nkeep = "statistics"'
        ),
        "Sobol' points, 16 × 4096": lambda seed: by_design(
            seed, 'kind = "sobol-sequence"\nruns = 65_536\nreplicates = 16'
        ),
    }
    for kind in ("subset-simulation", "importance-sampling", "active-learning"):
        if kind in DESIGNS:
            found[kind] = lambda seed, kind=kind: towards_event(seed, kind)
    return found


def _rows(method: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the answers of a method."""
    for seed in seeds:
        yield from (each._asdict() for each in methods()[method](seed))


def page(table: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of both tables: the first seed's answers, and how many seeds agree."""
    rows = [SimpleNamespace(seed=row["first"], **row) for row in table]
    yield from _first_answers(rows)
    if any(row.seed != rows[0].seed for row in rows):
        yield ""
        yield from _agreement(rows)


def _agreement(rows: Sequence[SimpleNamespace]) -> Iterator[str]:
    """Yield how many seeds of a method have an interval that contains what most runs say."""
    most = {row.quantity: row for row in rows if row.method == MOST_RUNS}
    if not most:
        yield f"No table of agreement: no file has the rows of {MOST_RUNS}, whose values it needs."
        return
    seeds: dict[str, set[int]] = {}
    for row in rows:
        seeds.setdefault(row.method, set()).add(row.seed)
    names = [name for name, own in seeds.items() if len(own) > 1]
    found = []
    for label in (f"P(> {each} cm)" for each in THRESHOLDS):
        found.append([label])
        for name in names:
            own = [row for row in rows if (row.method, row.quantity) == (name, label)]
            inside = sum(row.lower <= most[label].estimate <= row.upper for row in own)
            found[-1].append(f"{inside} of {len(own)}" if own else "–")
    yield from lines([f"seeds whose interval contains the value of {MOST_RUNS}", *names], found)


def _first_answers(rows: Sequence[SimpleNamespace]) -> Iterator[str]:
    """Yield a row a quantity, a column a method, of the first seed each."""
    first: dict[str, int] = {}
    for row in rows:
        first[row.method] = min(row.seed, first.get(row.method, row.seed))
    shown = [row for row in rows if row.seed == first[row.method]]
    names = list(dict.fromkeys(row.method for row in shown))
    cells = {(row.quantity, row.method): row for row in shown}
    labels = {f"P(> {each} cm)": f"P(> {each} cm)" for each in THRESHOLDS}
    labels |= {f"{100 * each:g} %": f"thickness [cm] for {100 * each:g} %" for each in CONTENTS}
    found = [
        [head, *(_cell(cells.get((label, name))) for name in names)]
        for label, head in labels.items()
    ]
    counts = (" + ".join(map(counted, _runs(shown, name))) for name in names)
    yield from lines(["", *names], [*found, ["runs", *counts]])


def _runs(rows: Sequence[SimpleNamespace], method: str) -> list[int]:
    """Return the numbers of runs of a method: one for all quantities, or one for each."""
    found = [row.runs for row in rows if row.method == method]
    return found[:1] if len(set(found)) == 1 else found


def _cell(row: SimpleNamespace | None) -> str:
    if row is None:
        return "–"
    if row.quantity.startswith("P"):
        return f"{row.estimate:.4g} ({row.lower:.4g} to {row.upper:.4g})"
    bound = "too few runs for a bound" if np.isnan(row.upper) else f"at most {row.upper:.4g}"
    return f"{row.estimate:.4g}, {bound}"


TABLE = SeedTable({"method": methods()}, _rows, {"the wall": page}, seeds=1)

if __name__ == "__main__":
    TABLE.main(__doc__)
