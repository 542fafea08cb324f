"""Charts of failed runs: their probability, and their inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.archive.read import read_group
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import (
    Dots,
    Mark,
    Rule,
    hollow_note,
    interval_notes,
    key_marker,
    series_marker,
)
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INPUT, RUNS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import run_count, status_counts
from uqpen.figures.failure_panels import (
    ASSOCIATION_SLOTS,
    ASSOCIATIONS,
    by_strength,
    failed_run_counts,
)
from uqpen.report.sections.drivers import input_label
from uqpen.report.sections.view_statistics import (
    failure_probabilities,
    sample_account,
    status_probability,
)
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, grouped_number, number_text, percent_texts
from uqpen.results.table import OutputTable, identity

__all__ = ["failure_association_chart", "failure_probability_chart"]


# Inputs in a chart, and designs in its summary.
_MOST_INPUTS = 15
_MOST_NAMED = 6

_NO_SAMPLE = "no interval: a share of its runs, which are no sample of the inputs"


def failure_probability_chart(view: ArchiveView, designs: Sequence[str]) -> Chart:
    """Return the chart of the probability of each status of failed runs, by design."""
    every = [failed_run_counts(view, design) for design in designs]
    statuses = [status for status in Status if any(status in each for each in every)]
    table = OutputTable("Probability of a failed run", [STATUS_TEXT[each] for each in statuses])
    rows = [
        [_failure_probability(view, design, status, table) for status in statuses]
        for design in designs
    ]
    table.rows += [
        (name, [text for _, text in row]) for name, row in zip(designs, rows, strict=True)
    ]
    bounds = np.array([[array for array, _ in row] for row in rows])
    last = 1.05 * float(np.nanmax(bounds))
    found = [failure_probabilities(view, name) for name in designs]
    return Chart(
        title="How likely a run fails",
        summary=_probability_sentence(designs, statuses, bounds),
        x=Axis("probability of a failed run", (-0.02 * last, last)),
        y=Axis("", rows=tuple(designs)),
        marks=tuple(_status_traces(designs, statuses, bounds)),
        keys=tuple(_status_key(each, bounds[:, number]) for number, each in enumerate(statuses)),
        notes=(
            *interval_notes(each for each in found if each is not None),
            *hollow_note(bounds),
            *_sample_notes(view, designs),
        ),
        tables=(table,),
        height=100 + len(designs) * max(34, 18 * len(statuses)),
    )


def _failure_probability(
    view: ArchiveView, design: str, status: Status, table: OutputTable
) -> tuple[FloatArray, str]:
    """The probability of a status, or else the share of runs that ended with it."""
    probability = status_probability(view, design, status)
    if probability is not None:
        return np.asarray(probability.values, dtype=np.float64), table.cell(probability, identity)
    runs = read_group(view.tree, RUNS, design)
    share = status_counts(runs)[status] / run_count(runs)
    return np.array([share, np.nan, np.nan]), f"{number_text(share)}{table.note_mark(_NO_SAMPLE)}"


def _status_style(status: Status) -> tuple[int, str]:
    return int(status) - 1, series_marker(int(status) - 1)


def _status_key(status: Status, bounds: FloatArray) -> LegendKey:
    colour, marker = _status_style(status)
    return LegendKey(STATUS_TEXT[status], colour, key_marker(marker, bounds))


def _probability_sentence(
    designs: Sequence[str], statuses: Sequence[Status], bounds: FloatArray
) -> str:
    names = [STATUS_TEXT[status] for status in statuses]
    texts = []
    for design, row in zip(designs[:_MOST_NAMED], bounds, strict=False):
        shares = (f"{name} {_percent_text(each)}" for name, each in zip(names, row, strict=True))
        texts.append(f"{design}: {', '.join(shares)}")
    return f"{'; '.join(texts)}."


def _percent_text(bounds: FloatArray) -> str:
    value, lower, upper = percent_texts(*bounds.tolist())
    return f"{value} ({lower} to {upper})" if np.isfinite(bounds).all() else value


def _status_traces(
    designs: Sequence[str], statuses: Sequence[Status], bounds: FloatArray
) -> Iterator[Mark]:
    for number, status in enumerate(statuses):
        name = STATUS_TEXT[status]
        places = (
            np.arange(len(designs), dtype=np.float64) + (number + 1) / (len(statuses) + 1) - 0.5
        )
        colour, marker = _status_style(status)
        hovers = [
            f"{design}, {name}: {_percent_text(row)}"
            for design, row in zip(designs, bounds[:, number], strict=True)
        ]
        yield Dots(bounds[:, number], places, colour, hovers=hovers, name=name, marker=marker)


def _sample_notes(view: ArchiveView, designs: Sequence[str]) -> Iterator[str]:
    for design in designs:
        used = sample_account(view, design).get("runs")
        if used is not None and used != run_count(read_group(view.tree, RUNS, design)):
            count = grouped_number(int(used))
            yield f"{design}: from the {count} runs that are a sample of the inputs."


def failure_association_chart(view: ArchiveView, design: str, table: OutputTable) -> Chart | None:
    """Return the inputs associated with a design's failed runs, the strongest first.

    The table has the numbers behind it. None without an estimate.
    """
    found = view.statistics.failures(design)
    associations = by_strength({name: found[name] for name, _ in ASSOCIATIONS})
    bounds = np.stack([each.values[:_MOST_INPUTS] for each in associations.values()])
    if not np.isfinite(bounds[..., 0]).any():
        return None
    names = associations["larger"][INPUT].values[:_MOST_INPUTS]
    rows = tuple(input_label(view, str(name)) for name in names)
    left_out = associations["larger"].sizes[INPUT] - len(rows)
    strongest = (
        f"P({label}) {estimate_text(*each)}"
        for (_, label), each in zip(ASSOCIATIONS, bounds[:, 0], strict=True)
    )
    return Chart(
        title=f"Inputs associated with the failed runs of {design}",
        summary=f"The input with the strongest association is {rows[0]}: {', '.join(strongest)}.",
        x=Axis("chance of this in a failed run", (-0.02, 1.02)),
        y=Axis("", rows=rows),
        marks=(*_measure_traces(rows, bounds), Rule(0.5, "quiet", "dot")),
        keys=tuple(
            LegendKey(label, slot, key_marker(series_marker(slot), each))
            for slot, (_, label), each in zip(ASSOCIATION_SLOTS, ASSOCIATIONS, bounds, strict=True)
        ),
        notes=(
            "Larger: the input is larger in a failed run than in a completed one. Further out: it "
            "is further from its median.",
            "0.5: the input is not associated with failure.",
            *interval_notes(associations[name] for name, _ in ASSOCIATIONS),
            *hollow_note(bounds),
            *([f"{left_out} more inputs are in the table."] if left_out else []),
        ),
        tables=(table,),
        height=100 + 36 * len(rows),
    )


def _measure_traces(rows: Sequence[str], bounds: FloatArray) -> Iterator[Mark]:
    for number, (_, label) in enumerate(ASSOCIATIONS):
        hovers = [
            f"{row}: P({label}) = {estimate_text(*each)}"
            for row, each in zip(rows, bounds[number], strict=True)
        ]
        places = np.arange(len(rows), dtype=np.float64) + 0.3 * (number - 0.5)
        slot = ASSOCIATION_SLOTS[number]
        marker = series_marker(slot)
        yield Dots(bounds[number], places, slot, hovers=hovers, name=label, marker=marker)
