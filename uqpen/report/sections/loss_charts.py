"""Charts of lost runs: how likely they are, and where among the inputs they lie."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from uqpen.analyses.where_lost import LOSSES
from uqpen.archive.read import group
from uqpen.evaluation import status_counts
from uqpen.figures.losses import CHANCES, lost_of
from uqpen.figures.part import Part
from uqpen.labels import INPUT, RUN, RUNS, STATUS_TEXT, STATUSES, Status
from uqpen.report.blocks import Axis, Chart, Key
from uqpen.report.counting import in_percent
from uqpen.report.marks import Trace, dots, marker_of
from uqpen.report.notes import bars_of, hollow_of
from uqpen.report.shapes import upright
from uqpen.summary.digits import grouped, sensible
from uqpen.summary.table import OutputTable, unchanged

__all__ = ["chances", "places"]

FloatArray = npt.NDArray[np.float64]

# Inputs in a chart, and designs in what is said of one.
_MOST_INPUTS = 15
_MOST_SAID = 6

_NO_SAMPLE = "the share of its runs, which are no sample of the inputs: no interval"


def chances(part: Part, designs: Sequence[str]) -> Chart:
    """The probability of losing a run in each way that some were lost in, by design."""
    every = [lost_of(part, design) for design in designs]
    statuses = [status for status in Status if any(status in each for each in every)]
    table = OutputTable("Probability of losing a run", [STATUS_TEXT[each] for each in statuses])
    rows = [[_chance(part, design, status, table) for status in statuses] for design in designs]
    table.rows += [
        (name, [text for _, text in row]) for name, row in zip(designs, rows, strict=True)
    ]
    bounds = np.array([[array for array, _ in row] for row in rows])
    last = 1.05 * float(np.nanmax(bounds))
    return Chart(
        title="How likely a run is lost",
        summary=_said(designs, statuses, bounds),
        x=Axis("probability of losing a run", (-0.02 * last, last)),
        y=Axis("", rows=tuple(designs)),
        traces=tuple(_by_status(designs, statuses, bounds)),
        keys=tuple(Key(STATUS_TEXT[each], *_look(each)) for each in statuses),
        notes=(*_notes(part, designs, bounds), *_of_sample(part, designs)),
        tables=(table,),
        height=100 + len(designs) * max(34, 18 * len(statuses)),
    )


def _chance(part: Part, design: str, status: Status, table: OutputTable) -> tuple[FloatArray, str]:
    """The probability of a status, or else the share of runs that ended with it."""
    told = group(part.tree, STATUSES, design).get(status.meaning)
    if told is not None:
        return np.asarray(told.values, dtype=np.float64), table.cell(told, unchanged)
    runs = group(part.tree, RUNS, design)
    share = status_counts(runs)[status] / runs.sizes[RUN]
    return np.array([share, np.nan, np.nan]), f"{share:.4g}{table.mark(_NO_SAMPLE)}"


def _look(status: Status) -> tuple[int, str]:
    return int(status) - 1, marker_of(int(status) - 1)


def _said(designs: Sequence[str], statuses: Sequence[Status], bounds: FloatArray) -> str:
    said = []
    for design, row in zip(designs[:_MOST_SAID], bounds, strict=False):
        shares = (f"{STATUS_TEXT[s]} {_percent(b)}" for s, b in zip(statuses, row, strict=True))
        said.append(f"{design}: {', '.join(shares)}")
    return f"{'; '.join(said)}."


def _percent(bounds: FloatArray) -> str:
    value, lower, upper = in_percent(*bounds.tolist())
    return f"{value} ({lower} to {upper})" if np.isfinite(bounds).all() else value


def _by_status(
    designs: Sequence[str], statuses: Sequence[Status], bounds: FloatArray
) -> Iterator[Trace]:
    for number, status in enumerate(statuses):
        name = STATUS_TEXT[status]
        offset = (number + 1) / (len(statuses) + 1) - 0.5
        place = [row + offset for row in range(len(designs))]
        colour, marker = _look(status)
        hovers = [
            f"{design}, {name}: {_percent(row)}"
            for design, row in zip(designs, bounds[:, number], strict=True)
        ]
        yield dots(bounds[:, number], place, colour, hovers=hovers, name=name, marker=marker)


def _notes(part: Part, designs: Sequence[str], bounds: FloatArray) -> Iterator[str]:
    yield from bars_of(
        each for name in designs for each in group(part.tree, STATUSES, name).values()
    )
    yield from hollow_of(bounds)


def _of_sample(part: Part, designs: Sequence[str]) -> Iterator[str]:
    """Designs of which only some runs are a sample."""
    for design in designs:
        used = group(part.tree, STATUSES, design).attrs.get("runs")
        if used is not None and used != group(part.tree, RUNS, design).sizes[RUN]:
            yield f"{design}: of those {grouped(int(used))} runs that are a sample of the inputs."


def places(part: Part, design: str, table: OutputTable) -> Chart | None:
    """Which inputs go with the loss of a design's runs; None where nothing tells.

    Parameters
    ----------
    part : Part
    design : str
    table : OutputTable
        The numbers behind it, a row for each input, those first that go with the losses most.
    """
    told = group(part.tree, LOSSES, design)
    bounds = np.stack([told[name].values for name, _ in CHANCES])
    if not np.isfinite(bounds[..., 0]).any():
        return None
    strength = np.nan_to_num(np.abs(bounds[..., 0] - 0.5)).max(axis=0)
    order = np.argsort(-strength, kind="stable")
    bounds = bounds[:, order[:_MOST_INPUTS]]
    rows = tuple(str(name) for name in told[INPUT].values[order[:_MOST_INPUTS]])
    left_out = len(order) - len(rows)
    return Chart(
        title=f"Which inputs go with the lost runs of {design}",
        summary=_strongest(rows[0], bounds[:, 0]),
        x=Axis("P(a lost run's input is so)", (-0.02, 1.02)),
        y=Axis("", rows=rows),
        traces=tuple(_by_measure(rows, bounds)),
        shapes=(upright(0.5, "quiet", "dot"),),
        keys=tuple(Key(label, n, marker_of(n)) for n, (_, label) in enumerate(CHANCES)),
        notes=(
            "Larger, further out: than in a run that came back; further out is from the median.",
            "0.5: the input does not go with the losses.",
            *bars_of(told[name] for name, _ in CHANCES),
            *hollow_of(bounds),
            *([f"{left_out} more inputs are in the table."] if left_out else []),
        ),
        tables=(table,),
        height=100 + 36 * len(rows),
    )


def _strongest(name: str, bounds: FloatArray) -> str:
    figures = (
        f"P({label}) {sensible(*each)}" for (_, label), each in zip(CHANCES, bounds, strict=True)
    )
    return f"The input that goes with the losses most is {name}: {', '.join(figures)}."


def _by_measure(rows: Sequence[str], bounds: FloatArray) -> Iterator[Trace]:
    for number, (_, label) in enumerate(CHANCES):
        hovers = [
            f"{row}: P({label}) = {sensible(*each)}"
            for row, each in zip(rows, bounds[number], strict=True)
        ]
        place = [row + 0.3 * (number - 0.5) for row in range(len(rows))]
        marker = marker_of(number)
        yield dots(bounds[number], place, number, hovers=hovers, name=label, marker=marker)
