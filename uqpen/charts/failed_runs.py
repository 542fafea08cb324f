"""Failed runs: the probability of each way to fail, and the inputs that go with it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.archive.read import read_group
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import (
    Dots,
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
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, grouped_number, number_text, percent_texts
from uqpen.results.input_measures import input_label
from uqpen.results.table import OutputTable, identity

# The statistics of the inputs of failed runs: names, labels, and places among colours and markers.
# The places before are those of the statuses.
_ASSOCIATIONS = (("larger", "larger", 5), ("further_out", "further out", 6))
# Inputs in a chart, and designs in its summary.
_MOST_INPUTS, _MOST_NAMED = 15, 6

_NO_SAMPLE = "no interval: a share of its runs, which are no sample of the inputs"


def failure_charts(view: ArchiveView) -> Iterator[Chart]:
    """Probability of each way to fail, and inputs of failed runs."""
    if failed := failed_designs(view):
        yield failure_probability_chart(view, failed)
    for design in view.designs:
        if view.source in (None, design) and (chart := failure_association_chart(view, design)):
            yield chart


def failed_designs(view: ArchiveView) -> list[str]:
    """Return the designs with failed runs; only the selected one, if any."""
    designs = [name for name in view.designs if view.source in (None, name)]
    return [design for design in designs if failed_run_counts(view, design)]


def failed_run_counts(view: ArchiveView, design: str) -> dict[Status, int]:
    """Count the failed runs of a design by status, without statuses of no run."""
    counts = status_counts(read_group(view.tree, RUNS, design))
    return {status: n for status, n in counts.items() if n and status is not Status.OK}


def failure_probability_chart(view: ArchiveView, designs: Sequence[str]) -> Chart:
    """Return the chart of the probability of each status of failed runs, by design."""
    counts = [failed_run_counts(view, design) for design in designs]
    statuses = [status for status in Status if any(status in each for each in counts)]
    names = [STATUS_TEXT[each] for each in statuses]
    table = OutputTable("Probability of a failed run", names)
    found = [_status_probabilities(view, design, statuses, table) for design in designs]
    bounds = np.array(found)
    last = 1.05 * float(np.nanmax(bounds))
    marks, keys = [], []
    for number, (name, status) in enumerate(zip(names, statuses, strict=True)):
        rows = np.arange(len(designs), dtype=np.float64)
        places = rows + (number + 1) / (len(statuses) + 1) - 0.5
        position, own = int(status) - 1, bounds[:, number]
        marker = series_marker(position)
        hovers = [
            f"{design}, {name}: {_percent_text(row)}"
            for design, row in zip(designs, own, strict=True)
        ]
        marks.append(Dots(own, places, position, hovers=hovers, name=name, marker=marker))
        keys.append(LegendKey(name, position, key_marker(marker, own)))
    texts = []
    for design, row in zip(designs[:_MOST_NAMED], bounds, strict=False):
        shares = (f"{name} {_percent_text(each)}" for name, each in zip(names, row, strict=True))
        texts.append(f"{design}: {', '.join(shares)}")
    arrays = [view.statistics.failures(design).get("probability") for design in designs]
    sample_notes = []
    for design, array in zip(designs, arrays, strict=True):
        used = None if array is None else array.attrs.get("runs")
        if used is not None and used != run_count(read_group(view.tree, RUNS, design)):
            count = grouped_number(int(used))
            sample_notes.append(f"{design}: from the {count} runs that are a sample of the inputs.")
    return Chart(
        title="How likely a run fails",
        summary=f"{'; '.join(texts)}.",
        x=Axis("probability of a failed run", (-0.02 * last, last)),
        y=Axis("", rows=tuple(designs)),
        marks=tuple(marks),
        keys=tuple(keys),
        notes=(
            *interval_notes(each for each in arrays if each is not None),
            *hollow_note(bounds),
            *sample_notes,
        ),
        tables=(table,),
        height=100 + len(designs) * max(34, 18 * len(statuses)),
    )


def _status_probabilities(
    view: ArchiveView, design: str, statuses: Sequence[Status], table: OutputTable
) -> list[FloatArray]:
    """Return the probability of each status, or else the share of runs that ended with it.

    They become a row of the table.
    """
    known = view.statistics.status_probabilities(design)
    runs = read_group(view.tree, RUNS, design)
    found, cells = [], []
    for status in statuses:
        if (estimate := known.get(status.meaning)) is not None:
            found.append(np.asarray(estimate.values, dtype=np.float64))
            cells.append(table.cell(estimate, identity))
        else:
            share = status_counts(runs)[status] / run_count(runs)
            found.append(np.array([share, np.nan, np.nan]))
            cells.append(f"{number_text(share)}{table.note_mark(_NO_SAMPLE)}")
    table.rows.append((design, cells))
    return found


def _percent_text(bounds: FloatArray) -> str:
    value, lower, upper = percent_texts(*bounds.tolist())
    return f"{value} ({lower} to {upper})" if np.isfinite(bounds).all() else value


def failure_association_chart(view: ArchiveView, design: str) -> Chart | None:
    """Return the inputs associated with a design's failed runs, the strongest first.

    None without an estimate.
    """
    found = view.statistics.failures(design)
    if not all(name in found for name, _, _ in _ASSOCIATIONS):
        return None
    arrays = [found[name] for name, _, _ in _ASSOCIATIONS]
    every = np.stack([each.values for each in arrays])
    if not np.isfinite(every[..., 0]).any():
        return None
    strengths = np.nan_to_num(np.abs(every[..., 0] - 0.5)).max(axis=0)
    order = np.argsort(-strengths, kind="stable")[:_MOST_INPUTS]
    bounds = every[:, order]
    rows = tuple(input_label(view, str(name)) for name in arrays[0][INPUT].values[order])
    marks, keys, strongest = [], [], []
    for number, ((_, label, position), own) in enumerate(zip(_ASSOCIATIONS, bounds, strict=True)):
        texts = [estimate_text(*each) for each in own]
        hovers = [f"{row}: P({label}) = {text}" for row, text in zip(rows, texts, strict=True)]
        marker = series_marker(position)
        places = np.arange(len(rows), dtype=np.float64) + 0.3 * (number - 0.5)
        marks.append(Dots(own, places, position, hovers=hovers, name=label, marker=marker))
        keys.append(LegendKey(label, position, key_marker(marker, own)))
        strongest.append(f"P({label}) {texts[0]}")
    cut = f"Shown are {len(rows)} of {len(strengths)} inputs; the table has all."
    return Chart(
        title=f"Inputs associated with the failed runs of {design}",
        summary=f"The input with the strongest association is {rows[0]}: {', '.join(strongest)}.",
        x=Axis("chance of this in a failed run", (-0.02, 1.02)),
        y=Axis("", rows=rows),
        marks=(*marks, Rule(0.5, "quiet", "dot")),
        keys=tuple(keys),
        notes=(
            "Larger: the input is larger in a failed run than in a completed one. Further out: it "
            "is further from its median.",
            "0.5: the input is not associated with failure.",
            *interval_notes(arrays),
            *hollow_note(bounds),
            *([cut] if len(rows) < len(strengths) else []),
        ),
        height=100 + 36 * len(rows),
    )
