"""The table of coverage: read and written as files, and as a page of the docs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from result_files import number_or_text, read_rows, write_rows

__all__ = [
    "BANDS",
    "CORRECTED",
    "ENDED",
    "EXTENDED",
    "FEWEST_SEEDS",
    "FEW_RUNS",
    "FIELD_INDICES",
    "INDICES",
    "LOWEST",
    "MULTIFIDELITY",
    "REFINED",
    "SKEWED",
    "STOPPED_REPLICATES",
    "SURROGATE_USE_CASES",
    "USE_CASES",
    "Place",
    "markdown",
    "read",
    "write",
]

Row = Mapping[str, Any]

LOWEST = 0.92
# A cell with fewer seeds has too large an error to be judged.
FEWEST_SEEDS = 50
LABELS = ("nominal", "discrete", "conservative")


class Place(NamedTuple):
    """The place of a table between two marks of the page."""

    name: str

    @property
    def _marks(self) -> tuple[str, str]:
        return f"<!-- {self.name}: begin -->", f"<!-- {self.name}: end -->"

    def text(self, page: str) -> str:
        """The table with its marks as it stands on a page; the marks alone if it is not there."""
        begin, end = self._marks
        return f"{begin}{page.partition(begin)[2].partition(end)[0]}{end}\n"

    def fill(self, path: Path, text: str) -> None:
        """Put another table in the place of the one on a page."""
        begin, end = self._marks
        page = path.read_text(encoding="utf-8")
        before, _, rest = page.partition(begin)
        _, _, after = rest.partition(end)
        path.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


# The tables of the other benchmarks: `skewed_coverage.py`, `usecase_coverage.py`,
# `deciding_coverage.py`, `stopped_replicates_coverage.py`, `extended_designs.py`,
# `field_indices_coverage.py`, `corrected_coverage.py`, `refined_coverage.py`,
# `surrogate_usecases.py`, `few_runs.py`.
SKEWED = Place("skewed outputs")
USE_CASES = Place("use cases")
ENDED = Place("designs that end by themselves")
STOPPED_REPLICATES = Place("replicates that end by themselves")
EXTENDED = Place("extended designs")
FIELD_INDICES = Place("indices of fields")
BANDS = Place("bands along a curve")
CORRECTED = Place("corrected estimates of surrogates")
REFINED = Place("refined designs")
INDICES = Place("corrected indices")
FEW_RUNS = Place("300 runs")
MULTIFIDELITY = Place("stand-ins")
SURROGATE_USE_CASES = Place("surrogates of use cases")

_KEY = ("problem", "design", "runs", "statistic")

# Beginnings of the statistics of a cell, and their names on the page.
_FAMILIES = {
    "mean": "mean",
    "std": "standard deviation",
    "half_spread": "half the 16–84 % range",
    "quantile": "quantiles 0.05, 0.5, 0.95, 0.99",
    "hold": "tolerance limits of 0.95 and 0.99",
    "P(": "exceedance probabilities from 0.5 to 0.00014",
    "share": "category probabilities",
    "cdf at": "cdf at a value",
    "cdf band": "cdf, simultaneous band",
    "first_order": "first-order index",
    "total_order": "total-order index",
    "log_first_order": "first-order index of the logarithm",
    "log_total_order": "total-order index of the logarithm",
    "exceedance first_order": "first-order index of exceeding a value",
    "exceedance total_order": "total-order index of exceeding a value",
}

_HEAD = """\
# How often the intervals cover

The coverage of an interval is the share of seeds in which it contains the true value. The tables
give the lowest and the highest coverage, in per cent, of intervals with a level of 95 %. Each
problem, design and size has {seeds} seeds{fewer}.
The standard error of a single coverage is {error:.1f} points.

*Nominal* intervals should have a coverage of 92 to 98 %. *Discrete* and *conservative* ones may
have more. The first table leaves out intervals with a note, and exceptions; both have tables of
their own below. `benchmarks/interval_coverage.py` makes this page.

The problems are:

- the penetration depth of the concrete study, with a heavy tail (kurtosis 111);
- the Ishigami function;
- a sum of three normal inputs (`additive`);
- a step across a diagonal plus the square of an input;
- jumps along two axes, where the second jump needs the first;
- one uniform input as it is;
- a sum of two uniform inputs with half of the draws inadmissible (`half lost`).

The sizes are about 100, 1 000 and 10 000 runs. For `saltelli` they count the runs of all blocks,
in 8, 16 and 16 replicates. Its moments, quantiles and probabilities use the points A and B alone,
and its indices the blocks. The indices of the other designs are from given data, which give no
total-order index.
"""

_FAILING = """\
## Exceptions

These cells are outside the limits above. Their intervals carry no note, as nothing in the runs
distinguishes them. For a single input, most scrambled Sobol' replicates are exact, and the
interval contains the few others. The quantile 0.05 of the jumps, with 512 points, has a coverage
of 92.6 % over 3 000 seeds.
"""

_NO_EXCEPTIONS = "There are none.\n"

_UNCOVERED = """\
## With a note, below 92 %

These intervals carry a note, and their coverage is below 92 %. A cell gives the lowest and the
highest coverage over inputs, or over the statistics of the row. It counts the seeds with the
note: all seeds, unless the cell gives a number. Cells with fewer than 50 such seeds are left out.
"""

_NOTED = """\
## With a note, 92 % or more

All other cells with a note, by design. Their coverage suffices here. It may be lower if extreme
values are more frequent than in the runs.
"""

_SKEWED = """\
## Skewed and heavy outputs

Functions of few inputs that matter, most of them unbounded, some with Pareto-like tails (by their
index). A cell gives the coverage of intervals without a note, and in brackets of those with the
sentence on tails, each with its share of the seeds where it is not all of them. *None* is a cell
whose samples have no interval. `benchmarks/skewed_coverage.py` makes this table. No cell without a
note is below 92 %.
"""

_OF_USE_CASES = """\
## Use cases of OpenTURNS

The models of `openturns.usecases` (version 1.27) with scalar outputs, under the distributions
that come with them. Ackley's and Branin's functions come with bounds alone: their inputs are
uniform between these. The inputs of `CantileverBeam` and `StiffenedPanel` depend on each other by
a normal copula. Left out are `Coles` and `Linthurst` (data), `FissionGasRelease` (its inputs have
no distribution), `LogisticModel` and `ViscousFreeFall` (fields).

A cell gives the coverage in per cent, the number of intervals, and the probability that so few of
them cover, were the coverage of each 95 %. It fails if this is below 0.001; all together fail
below 94.5 %. Each output, design and seed has points of its own, so the intervals of a cell are
independent. The correlation and the index are those of the input with the largest rank
correlation. True values come from 16 sets of 65 536 scrambled Sobol' points.

The outputs *H* and *S* of `FloodModel` have an infinite variance: the water height is Ks^-0.6
times a factor, and Ks is a normal variable truncated at 0, where its density is positive. A
standard deviation that does not exist has no coverage, so the cells leave out that of these two
outputs; the last lines count its intervals. Ks below 2 is rarer than 1 in 10 000. So many samples
look light, and **no rule on the runs alone can refuse an interval there**: it is right for the
spread of the runs without that rare part. Were each of these intervals counted as one that does
not cover, the seven cells of the standard deviation would fail. First-order indices of these
outputs do not exist either, and are not counted. Over 100 seeds (`--only FloodModel --seeds 100`),
the means of these two had a coverage of 93 to 98 % in all designs but one: 87.4 % with the 8 192
runs of `sobol-sequence`, and no note.

```sh
python benchmarks/usecase_coverage.py --output usecases.csv
python benchmarks/usecase_coverage.py --from usecases.csv --markdown docs/coverage.md
```
"""

_ENDED = """\
## Designs that end by themselves

Designs that end [at a wanted precision](study_file.md#enough-runs) or [with a
decision](study_file.md#a-decision). The outputs are the penetration depth of the concrete study,
the Ishigami function, and a step across a diagonal plus the square of an input. Each has a pool of
about a million exact runs. A seed draws its runs from the pool, and the statistics of the pool are
the true values. `benchmarks/deciding_coverage.py` makes these tables with the estimates, intervals
and the test of the package.

At a wanted precision: the coverage in per cent of the interval that decided, after a fixed number
of 512 runs, and where the design ended by itself: at the worst of up to 45 targets and at the
middle one. Targets lie around the usual half-width at each look up to 8 192 runs, where chance
decides most. Of so many targets, chance alone puts the worst some 1.5 points below the middle. The
depth has too heavy a tail for an interval of its standard deviation: such a design goes on to the
end.

With a decision: the answers in per cent of seeds, and the number of runs that they took. At the
true value, *held* is the wrong answer. *By intervals* looks after every run whether the
Clopper-Pearson interval excludes the limit, in place of the test.
"""

_FIELD_INDICES = """\
## Indices of fields

[Campbell's curve](statistics.md#sensitivity-along-a-curve) at nineteen angles, with its exact
indices. A cell gives the coverage in per cent; at the angles, that of the worst and of the best.
The input x3 explains less than 0.01 % of the variance; at single angles its total-order index rests
on few blocks. `benchmarks/field_indices_coverage.py` makes this table.
"""

_EXTENDED = """\
## Extended designs

A [larger design](study_file.md#more-runs) has the points of a fresh one of its size, so the
tables above hold for it. To prove it, `benchmarks/extended_designs.py` makes each design at a
quarter of its size, at half of it, and whole: 512, 1 024 and 2 048 runs, or a quarter as many
blocks. Half of the draws are inadmissible. Runs at the same inputs, to the bit, are taken from the
steps before. Then all runs and all intervals are compared with those of a fresh design.

Blocks of `saltelli` are drawn again by streams of their own since the first table was made. For
`half lost` with about 1 000 runs they were measured again, over 250 seeds: quantiles 95.2 to
97.2 %, exceedance probabilities 92.0 to 100.0 %, and with a note means 97.6, standard deviations
97.2, first-order indices 93.2 and 95.6, total-order indices 96.0 and 96.0. No cell fails. The
standard error of these coverages is at most 1.7 points.
"""

_MULTIFIDELITY = """\
## Stand-ins

How often intervals of [a model with stand-ins](statistics.md#stand-ins) cover, in per cent of
seeds, and how wide they are over those of plain Monte Carlo with the whole budget. In brackets
stands the share of seeds that have an interval, where not all have one; *none* is a cell with fewer
than 50. The pilot has 50 points. The standard error of a coverage is 3 points with 50 seeds.
Probabilities and quantiles rest on the number of the dear runs: with few of them, plain runs for
the whole budget have narrower ones. `benchmarks/multifidelity_coverage.py` makes this table.
"""

_SURROGATE_USE_CASES = """\
## Surrogates of the use cases of OpenTURNS

The models above, each with a surrogate of independent runs and without any setting. A figure is
*off* if its interval misses the true value. It is off *without a word* if it has no note either.
The surrogate's own figure stands beside each corrected one: the last column counts those that are
wrong by more than the interval is wide to one side, and yet inside of an interval without a note.
True values are those of the section on use cases; standard deviations that are infinite are left
out. `benchmarks/surrogate_usecases.py` makes these tables. They have one or two seeds, and indices
of Gaussian processes are still those of before
[draws stood in for terms](decisions/076-runs-correct-a-surrogate.md).
"""

_FEW_RUNS = """\
## The concrete study from 300 runs

The corrected means of depth and residue from 300 runs in all: how often the intervals contain the
true mean, and their half-width over it. The plain one is that of the same runs. The depth's
surrogate is of its logarithm. `benchmarks/few_runs.py` makes this table.
"""

_NONE = """\
## Without an interval

Skewness, delta, Morris's sigma and responses have no interval. Nor have those estimates of a
surrogate that runs cannot correct. The standard deviation of runs has no interval below 200 runs or
where the runs may be those of a heavy tail. A quantile has none if no order statistic bounds it.
See [what the statistics mean](statistics.md).
"""


_BANDS = """\
## Bands along a curve

How often [bands](statistics.md#bands-along-a-curve) cover a true curve at all places at once,
and how often a tolerance band holds 95 % of all curves, in per cent of seeds. The curves are
Campbell's with four inputs, one with two, and the nose velocity of the rod of
`studies/rod_course.toml` by depth, which ends where the rod rests. Few runs decide most places of
the other three: a pulse exp(a − (t − c)² / (2 · 0.15²)) with a ~ N(0, 0.3), c ~ N(3, 0.6), a step
to a height U(1, 2) at a time N(3, 0.6), and curves that are a bump with a lognormal height in 4 %
of the runs, else 0. Of these and the rod the share of places that the band has stands behind, and
of tolerance bands the height of the highest one, over the largest range of 95 % of the values.
*None* is a cell with fewer than 100 bands. Bands of quantiles and tolerance bands count whole runs,
so they may cover more; tolerance bands over replicates are conservative.
`benchmarks/band_coverage.py` makes this table, of every fourth place (`--every 4`) of the first two
and of the rod. The standard error of a cell is 0.7 points with 1 000 seeds, 1 with 500, 1.4 with
250. Cells with 1 000 seeds, and the last row of the rod, were measured before bands left out
[what few runs decide](decisions/072-a-band-is-the-intervals-at-a-higher-level.md), which leaves
the bands of the first two curves as they were.
"""

_CORRECTED = """\
## Corrected estimates of surrogates

How often the intervals of [corrected estimates](statistics.md#surrogates) contain the true value,
in per cent, and their mean width over that of the plain interval of the same runs, where there is
one: "coverage / width". *None* is a statistic that is refused; a dash one that there is not, or
that is still to be measured. The last rows count all intervals. A surrogate is a sparse polynomial
chaos of an order fixed beforehand, in five folds; that of the concrete depth is of its logarithm.
"P" is a probability of exceeding a value, of the true size. Means and standard deviations have
the sentence on tails in all cells, as those of few plain runs have; plain runs have no standard
deviation below 200. `benchmarks/corrected_coverage.py` makes these tables. Rows with a star were
measured with earlier rules: their intervals may be wider than those of the runs alone, and those of
`half_spread` and of quantiles are now narrower. The last rows are without them. Wider than 1 are
only intervals beside plain ones that do not hold the estimate,
[indices](statistics.md#corrected-estimates) of the useless surrogate, and those with failed runs.
"""

_INDICES_FROM_DRAWS = """\
## Corrected indices

How often the intervals of [indices](statistics.md#corrected-estimates) contain the true value
where draws stand in for terms, in per cent of seeds and inputs, and their mean width. *Given* is
the share of intervals that are not refused; the last column is the coverage of those that are. "y >
7" is the event. A surrogate is a sparse polynomial chaos of order 8, and of 4 where it is to be
poor, in five folds of independent runs. The table has very few seeds: it shows widths, and is no
proof of coverage. `benchmarks/corrected_indices.py` makes it.
"""

_REFINED = """\
## Refined designs

How often corrected estimates cover, in per cent, and how wide their intervals are over those of as
many plain draws ("coverage / width"), where a surrogate [places](statistics.md#refined-designs)
some of its runs. `benchmarks/refined_coverage.py` makes this table, of 300 runs each: plain draws,
or 100 of them and 200 in rounds for the mean or for probabilities; *placed* is the mean number of
runs with a weight. The seeds are too few to certify, so intervals of placed runs have a note.
Rounds for the mean widen probabilities and quantiles, up to twice. Rounds for probabilities were
almost all of plain draws: the placement promised no narrower interval.
"""


def read(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """The rows of several tables; the last one of equal cells."""
    rows: dict[tuple[str, ...], dict[str, Any]] = {}
    for texts in read_rows(paths):
        key = tuple(texts[name] for name in _KEY)
        rows[key] = {name: number_or_text(text) for name, text in texts.items()}
    return list(rows.values())


def write(path: Path, table: Sequence[Row]) -> None:
    """Write a file that `read` reads."""
    if table:
        write_rows(path, table)


def markdown(table: Sequence[Row], designs: Sequence[str], page: str) -> str:
    """Coverage by statistic and design, over all problems and sizes, and the noted cells.

    The tables of the other benchmarks are kept.
    """
    designs = [each for each in designs if any(row["design"] == each for row in table)]
    failing = [row for row in table if row["verdict"] == "FAILS"]
    noted = [row for row in table if _is_noted(row)]
    uncovered = [row for row in noted if row["coverage_warned"] < LOWEST]
    covered = [row for row in noted if row["coverage_warned"] >= LOWEST]
    parts = [_head(table), _grid(table, designs, _certain), _FAILING]
    parts.append(_lines(_by_size(failing, "coverage")) if failing else _NO_EXCEPTIONS)
    parts += [_UNCOVERED, _lines(_by_size(uncovered, "coverage_warned"))]
    parts += [_NOTED, _grid(covered, designs, _warned)]
    parts += [_SKEWED, SKEWED.text(page), _ENDED, ENDED.text(page)]
    parts += [_OF_USE_CASES, USE_CASES.text(page), _EXTENDED, EXTENDED.text(page)]
    parts += [_BANDS, BANDS.text(page), _FIELD_INDICES, FIELD_INDICES.text(page)]
    parts += [_CORRECTED, CORRECTED.text(page), _INDICES_FROM_DRAWS, INDICES.text(page)]
    parts += [_REFINED, REFINED.text(page), _MULTIFIDELITY, MULTIFIDELITY.text(page)]
    parts += [_SURROGATE_USE_CASES, SURROGATE_USE_CASES.text(page)]
    parts += [_FEW_RUNS, FEW_RUNS.text(page), _NONE]
    return "\n".join(parts)


def _head(table: Sequence[Row]) -> str:
    """The head of the page, with the number of seeds and the cells with fewer."""
    seeds = max(row["seeds"] for row in table)
    fewer = {
        f"{_counted(row['seeds'])} of {row['problem']} with {row['design']}"
        for row in table
        if row["seeds"] < seeds
    }
    return _HEAD.format(
        seeds=_counted(seeds),
        fewer=f" (but {', '.join(sorted(fewer))})" if fewer else "",
        error=100 * math.sqrt(0.95 * 0.05 / seeds),
    )


def _is_noted(row: Row) -> bool:
    """True if enough seeds carry a note to give a coverage."""
    return round(row["warned"] * row["seeds"]) >= FEWEST_SEEDS


def _counted(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def _family(statistic: str) -> str:
    """The name of a statistic on the page: by the longest beginning that fits."""
    prefix = max((prefix for prefix in _FAMILIES if statistic.startswith(prefix)), key=len)
    return _FAMILIES[prefix]


def _lines(rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown, its head first."""
    head, *rest = rows
    between = "|" + "---|" * len(head)
    return "\n".join([_line(head), between, *map(_line, rest)]) + "\n"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _grid(
    table: Sequence[Row], designs: Sequence[str], cell: Callable[[Sequence[Row]], str]
) -> str:
    """A row for each family of statistics that has any, a column for each design."""
    rows = []
    for family in _FAMILIES.values():
        found = [row for row in table if _family(row["statistic"]) == family]
        if found:
            cells = (cell([row for row in found if row["design"] == each]) for each in designs)
            rows.append([family, *cells])
    return _lines([["statistic", *designs], *rows])


def _certain(rows: Sequence[Row]) -> str:
    """Coverage of intervals without a note: of nominal ones, and of other labels."""
    certain = [row for row in rows if row["verdict"] == "ok"]
    if not certain:
        return "only with a note" if any(row["verdict"] == "warns" for row in rows) else "–"
    nominal = [row for row in certain if row["labels"] == LABELS[0]]
    others = [row for row in certain if row["labels"] != LABELS[0]]
    return "; ".join(
        f"{_span(some, 'coverage')} {_labels(some)}" for some in (nominal, others) if some
    )


def _labels(rows: Sequence[Row]) -> str:
    """The labels that occur; the label of a cell may differ between seeds."""
    return "/".join(label for label in LABELS if any(label in row["labels"] for row in rows))


def _warned(rows: Sequence[Row]) -> str:
    return _span(rows, "coverage_warned") if rows else "–"


def _span(rows: Sequence[Row], figure: str) -> str:
    """The lowest and the highest, in per cent."""
    lowest, highest = (f"{100 * end(row[figure] for row in rows):.1f}" for end in (min, max))
    return lowest if lowest == highest else f"{lowest} … {highest}"


def _by_size(rows: Sequence[Row], figure: str) -> Iterator[list[str]]:
    """A row for each problem, family of statistics and design, a column for each size."""
    sizes = sorted({row["runs"] for row in rows})
    yield ["problem", "statistic", "design", *(f"{_counted(size)} runs" for size in sizes)]
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        group = (row["problem"], _family(row["statistic"]), row["design"])
        groups.setdefault(group, []).append(row)
    for group, found in groups.items():
        of_sizes = ([row for row in found if row["runs"] == size] for size in sizes)
        yield [*group, *(_with_seeds(each, figure) for each in of_sizes)]


def _with_seeds(rows: Sequence[Row], figure: str) -> str:
    """A span, with the number of its seeds if these are not all."""
    if not rows:
        return "–"
    share = "warned" if figure == "coverage_warned" else "given"
    fewest = min(round(row[share] * row["seeds"]) for row in rows)
    every = min(row["seeds"] for row in rows)
    text = _span(rows, figure)
    return text if fewest == every else f"{text} (of {_counted(fewest)} seeds or more)"
