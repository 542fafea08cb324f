"""Coverage that a rehearsal predicts, beside that of the study itself, whose model is fast.

    python -m uqpen study studies/concrete.toml
    python benchmarks/rehearsal.py studies/concrete.toml --repeats 300

Both are repeated at the same points, so that they differ by the model alone. The truth of the model
is that of a large sample of it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from seed_table import lines

from uqpen.benchmark.methods import BenchmarkStatistic, benchmark_statistics
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import STATED
from uqpen.rehearsal.rehearse import RepeatRecord, RepeatWork, make_repeats
from uqpen.rehearsal.rehearsed_study import (
    RehearsedSource,
    RehearsedStudy,
    large_sample,
    open_rehearsed,
    run_estimates,
    study_sources,
    surrogate_truth,
    tail_record,
)
from uqpen.study.study import ValidatedStudy

STATISTICS = ("mean", "std", "half_spread", "quantile", "exceedance")


def main() -> None:
    """Repeat a study by its model and by its surrogate, and print both coverages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", type=Path)
    parser.add_argument("--repeats", type=int, default=300)
    parser.add_argument("--draws", type=int, default=2**22)
    options = parser.parse_args()
    with open_rehearsed(options.study) as rehearsed:
        quantities = rehearsed.study.quantities_of_interest
        model = replace(rehearsed.original, quantities_of_interest=quantities)
        sources = tuple(each for each in study_sources(rehearsed.study) if each.size == STATED)
        statistics = tuple(benchmark_statistics(quantities, STATISTICS))
        numbers = range(options.repeats)
        estimates = [
            [each.estimates for each in make_repeats(work, numbers, map)]
            for study in (rehearsed.study, model)
            if (work := RepeatWork(study, sources, statistics))
        ]
        for line in table(rehearsed, model, sources, statistics, estimates, options.draws):
            print(line)


def table(
    rehearsed: RehearsedStudy,
    model: ValidatedStudy,
    sources: Sequence[RehearsedSource],
    statistics: Sequence[BenchmarkStatistic],
    estimates: Sequence[Sequence[FloatArray]],
    draws: int,
) -> Iterator[str]:
    """Yield the rows of a table: the coverage in per cent, rehearsed and measured."""
    sample = large_sample(rehearsed.study, draws)
    of_surrogate = np.concatenate(
        surrogate_truth(rehearsed.study, rehearsed.fitted, statistics, sample)
    )
    found = run_estimates(large_sample(model, draws), model.quantities_of_interest)
    of_model = np.concatenate([each.estimates(found) for each in statistics])
    tails = tail_record(rehearsed, statistics, of_surrogate[:, 0], sample)
    counts = np.zeros((len(estimates[0]), len(sources)))
    rehearsed, measured = (
        RepeatRecord(np.stack(made), counts, truth)
        for made, truth in zip(estimates, (of_surrogate, of_model), strict=True)
    )
    entries = [(each.output, each.name, str(one)) for each in statistics for one in each.entries]
    rows = []
    for position, (output, name, label) in enumerate(entries):
        for number, source in enumerate(sources):
            cells = [_cell(each, number, position) for each in (rehearsed, measured)]
            share = " / ".join(f"{each:.2f}" for each in tails[:, position])
            rows.append([output, f"{name} {label}".strip(), share, source.name, *cells])
    head = ["output", "statistic", "tail, surrogate / runs", "design", "rehearsed", "measured"]
    yield from lines(head, rows)


def _cell(record: RepeatRecord, source: int, entry: int) -> str:
    share, lower, upper = 100 * record.coverage()[source, entry]
    given = record.has_interval[:, source, entry].mean()
    if not given:
        return "no interval"
    few = f", {100 * given:.0f} % have one" if given < 1 else ""
    return f"{share:.1f} ({lower:.1f} … {upper:.1f}){few}"


if __name__ == "__main__":
    main()
