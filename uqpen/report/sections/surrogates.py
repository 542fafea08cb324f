"""How good surrogates are, by runs that they have not seen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group, names_in
from uqpen.figures.part import Part
from uqpen.figures.scatter import thinned
from uqpen.figures.surrogate import predicted, quality, tested_by
from uqpen.figures.texts import after_number, with_unit
from uqpen.labels import RUN, RUNS, STATUS, SURROGATES, Status
from uqpen.report.axes import padded
from uqpen.report.blocks import Axis, Block, Chart, Charts, Heading, Key, Table
from uqpen.report.marks import Trace, line, points, written
from uqpen.report.sections.verdicts import verdicts
from uqpen.summary.digits import grouped
from uqpen.summary.table import OutputTable
from uqpen.summary.tables import fit_table

__all__ = ["surrogates"]

FloatArray = npt.NDArray[np.float64]

# Runs in a chart, and runs that differences are told of, at the most.
_MOST_RUNS, _MOST_COMPARED = 400, 100_000
# Runs that are shown besides, as they differ most.
_WORST = 10


def surrogates(part: Part) -> Iterator[Block]:
    """How good surrogates are, by runs that they have not seen."""
    for name in names_in(part.tree, SURROGATES):
        made = group(part.tree, SURROGATES, name)
        yield Heading(name)
        yield Table(fit_table(name, made))
        design = tested_by(part, made)
        outputs = [each for each in str(made.attrs["outputs"]).split() if each in part.numbers]
        if outputs and part.came_back(design):
            yield _comparison(part, name, design, outputs)
        yield from verdicts(part, name)


class _Compared(NamedTuple):
    """What the model and its surrogate say of the same runs, in the unit that is shown."""

    runs: npt.NDArray[np.int64]
    truth: FloatArray
    guess: FloatArray

    @property
    def differences(self) -> FloatArray:
        found: FloatArray = self.guess - self.truth
        return found


def _comparison(part: Part, name: str, design: str, outputs: list[str]) -> Charts:
    made = group(part.tree, SURROGATES, name)
    runs = group(part.tree, RUNS, design)
    places = np.flatnonzero(runs[STATUS].values == Status.OK)
    chosen = thinned(xr.Dataset({"place": (RUN, places)}), _MOST_COMPARED)["place"].values
    taken = runs.isel({RUN: chosen})
    shown = np.isin(chosen, thinned(xr.Dataset({"place": (RUN, chosen)}), _MOST_RUNS)["place"])
    has_worst = not shown.all()
    compared = {
        output: _Compared(
            chosen,
            part.measure(output).from_si(taken[output].values),
            part.measure(output).from_si(predicted(made, name, taken, output)),
        )
        for output in outputs
    }
    is_fitted_to = design == str(made.attrs["design"])
    whose = "it was fitted to these very runs" if is_fitted_to else "it was not fitted to them"
    drawn = f"{grouped(int(shown.sum()))} of {grouped(places.size)} runs of {design}"
    keys = [Key("run", part.sources.index(name), "circle")]
    if has_worst:
        drawn += f", and the {_WORST} with the largest differences"
        keys.append(Key(f"the {_WORST} largest differences", "ink", "diamond-open"))
    return Charts(
        tuple(_chart(part, name, output, each, shown) for output, each in compared.items()),
        keys=(*keys, Key("surrogate = model", "quiet", "line")),
        notes=(f"Shown are {drawn}; {whose}.",),
        tables=(_difference_table(part, design, places.size, compared),),
    )


def _chart(
    part: Part, name: str, output: str, compared: _Compared, shown: npt.NDArray[np.bool_]
) -> Chart:
    worst = _worst(compared) if not shown.all() else np.array([], dtype=np.int64)
    at = np.union1d(np.flatnonzero(shown), worst)
    ends = _ends(np.concatenate([compared.truth[at], compared.guess[at]]))
    room = padded(*ends, 0.04)
    unit = part.unit(output)
    said = after_number(unit)
    off = np.abs(compared.differences)
    middle, most = np.nanquantile(off, [0.5, 0.95])
    series = part.sources.index(name)
    traces = [_drawn(compared, np.flatnonzero(shown), series, said, f"{output} by {name}")]
    if worst.size:
        told = f"{output} by {name}, largest differences"
        traces.append(_drawn(compared, worst, "ink", said, told, "diamond-open"))
    made = group(part.tree, SURROGATES, name)
    return Chart(
        title=f"{output}: {quality(made, output)}",
        summary=f"Half of the {grouped(off.size)} runs differ by at most {middle:.3g}{said}, "
        f"95 % by at most {most:.3g}{said}, and the largest difference is "
        f"{np.nanmax(off):.3g}{said}.",
        x=Axis(with_unit("run of the model", unit), room),
        y=Axis(with_unit("surrogate", unit), room),
        traces=(line(ends, ends, "quiet", hover="", width=1.5), *traces),
        height=300,
    )


def _drawn(
    compared: _Compared,
    which: npt.NDArray[np.int64],
    series: int | str,
    unit: str,
    name: str,
    marker: str = "circle",
) -> Trace:
    """Runs of a comparison as points."""
    said = written(unit)
    return points(
        compared.truth[which],
        compared.guess[which],
        series,
        hover=f"run %{{customdata}}<br>model %{{x:.5~g}}{said}<br>surrogate %{{y:.5~g}}{said}",
        name=name,
        numbers=compared.runs[which].tolist(),
        marker=marker,
        size=4 if marker == "circle" else 8,
        opacity=0.55 if marker == "circle" else 1,
    )


def _worst(compared: _Compared) -> npt.NDArray[np.int64]:
    """The runs with the largest differences, which a choice at random would leave out."""
    order = np.argsort(-np.abs(np.nan_to_num(compared.differences, nan=0.0)), kind="stable")
    return np.sort(order[:_WORST])


def _ends(values: FloatArray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return float(finite.min()), float(finite.max())


def _difference_table(
    part: Part, design: str, whole: int, compared: dict[str, _Compared]
) -> OutputTable:
    """How far a surrogate is from the model, run by run."""
    size = next(iter(compared.values())).truth.size
    of = grouped(size) if size == whole else f"{grouped(size)} of {grouped(whole)}"
    title = f"Surrogate minus model, in {of} runs of {design}"
    columns = ["mean", "root mean square", "95 % differ at most by", "largest", "sd of the runs"]
    table = OutputTable(title, columns)
    note = table.mark("of these very runs, not estimates of others; so they have no intervals")
    for output, each in compared.items():
        off = each.differences
        figures = (
            np.mean(off),
            np.sqrt(np.mean(off**2)),
            np.quantile(np.abs(off), 0.95),
            np.max(np.abs(off)),
            np.std(each.truth),
        )
        table.rows.append(
            (with_unit(output, part.unit(output)), [f"{figure:.3g}{note}" for figure in figures])
        )
    return table
