"""User-defined figures: functions that yield charts or panels, beside those of the package."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from uqpen.charts.chart import Block, Chart, Charts
from uqpen.core.errors import FigureError
from uqpen.figures import FIGURES
from uqpen.figures.painter import chart_panel
from uqpen.figures.panel import Axes, Panel
from uqpen.models.user_module import FunctionFamily, UserDefinedFunction
from uqpen.results.archive_view import ArchiveView

FigureFunction = Callable[[ArchiveView], Iterable[Block | Panel]]

FIGURE = FunctionFamily(FIGURES, "uqpen.figures", "figure", "my_figure.py:my_figure", FigureError)


def figure_panels(named: str | FigureFunction, view: ArchiveView) -> list[Panel]:
    """Return the panels of a figure for a part of an archive.

    Parameters
    ----------
    named : str or callable
        Name of a figure; or a reference to a function, relative to the current folder; or the
        function itself.
    view : ArchiveView
        The part of the archive.

    Raises
    ------
    UnknownNameError
        If there is no such figure.
    FigureError
        If a user-defined function cannot be loaded, fails, or yields something else.
    """
    if isinstance(named, str) and named in FIGURES:
        charts = _name_outputs(list(FIGURE.find(named, Path()).function(view)))
        return list(_panels(charts, view))
    function = FIGURE.find(named, Path.cwd())
    with function.in_context():
        found = list(function.function(view))
    for each in found:
        if not isinstance(each, Block | Panel):
            text = f"it yields an object of class {type(each).__name__}, not a Chart or a Panel"
            raise function.failure(text)
    panels = _panels(found, view)
    return [replace(panel, draw=_guarded(panel, function)) for panel in panels]


def _name_outputs(drawn: Sequence[Block | Panel]) -> Iterator[Block | Panel]:
    """Yield charts whose legends and notes name one or two outputs that a text is of, among more.

    All panels of a figure have one legend and one set of notes.
    """
    owners: dict[str, dict[str, None]] = {}
    charts = [each for each in drawn if isinstance(each, Chart)]
    for chart in charts:
        for text in (*chart.notes, *(key.text for key in chart.keys)):
            owners.setdefault(text, {})[chart.of] = None
    outputs = {chart.of for chart in charts}

    def named(text: str) -> str:
        head = f"{', '.join(owners[text])}: "
        is_own = len(owners[text]) < min(3, len(outputs)) and not text.startswith(head)
        return f"{head}{text}" if is_own else text

    for each in drawn:
        if isinstance(each, Chart):
            keys = (replace(key, text=named(key.text)) for key in each.keys)
            yield replace(each, keys=tuple(keys), notes=tuple(map(named, each.notes)))
        else:
            yield each


def _panels(drawn: Iterable[Block | Panel], view: ArchiveView) -> Iterator[Panel]:
    """Yield panels and the charts among blocks; a figure has no place for other blocks."""
    for number, each in enumerate(drawn):
        match each:
            case Panel():
                yield each
            case Chart():
                yield chart_panel(each, view.title)
            case Charts():
                for chart in each.charts:
                    keys, notes = (*each.keys, *chart.keys), (*each.notes, *chart.notes)
                    panel = chart_panel(replace(chart, keys=keys, notes=notes), view.title)
                    yield replace(panel, group=f"charts {number}")


def _guarded(panel: Panel, function: UserDefinedFunction) -> Callable[[Axes], Iterable[str]]:
    """Return the drawing of a panel, whose failure names the figure's function."""

    def draw(axes: Axes) -> list[str]:
        with function.in_context():
            notes = [] if (returned := panel.draw(axes)) is None else list(returned)
            if not all(isinstance(note, str) for note in notes):
                raise TypeError("the notes of a panel are not all texts")
            return notes

    return draw
