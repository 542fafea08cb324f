"""Panels laid out on a page, with one legend and one set of notes below them."""

from __future__ import annotations

import functools
import itertools
import textwrap
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from uqpen.archive.read import is_benchmark, model_trees
from uqpen.archive.structure import find_comparison_faults, find_level_faults, find_model_faults
from uqpen.core.errors import ArchiveError, FigureError, UnknownNameError
from uqpen.core.lookup import choices
from uqpen.figures import FIGURES, OF_BENCHMARKS
from uqpen.figures.panel import LONGEST_ROW, Axes, Panel
from uqpen.figures.style import figure_style, require_matplotlib
from uqpen.figures.user_defined_figures import FIGURE, FigureFunction, figure_panels
from uqpen.results.archive_view import ArchiveView, select_view
from uqpen.results.texts import plain_text

if TYPE_CHECKING:
    from uqpen.figures.drawing import Drawing

# Inches, and characters to an inch of the notes.
_WIDTHS = {1: 4.6, 2: 7.2, 3: 9.2, 4: 11.4}
# Characters of a panel's title in a line, by the number of columns.
_TITLE = {1: 52, 2: 44, 3: 36, 4: 34}
_CHARACTERS = 17
_HEAD = 0.3
# A page shows the first of more panels, with a note.
_MOST_PANELS = 24


def figure(
    tree: xr.DataTree,
    name: str | FigureFunction,
    *others: str | FigureFunction,
    output: str | None = None,
    source: str | None = None,
    model: str | None = None,
) -> Drawing:
    """Return a figure of an archive, or several on a page.

    Parameters
    ----------
    tree : DataTree
        As `run` returns it, or `open_archive` reads it.
    name, *others : str or callable
        Names of those that are `available`. A figure of one's own is a function that takes an
        `ArchiveView` and yields a `Panel` each, or a reference to it such as
        ``"my_figure.py:my_figure"``.
    output : str, optional
        The only output to show; all without it.
    source : str, optional
        The design, surrogate or publication to show, or to show with its band; without it one
        that suits the figure.
    model : str, optional
        One of several models; the first without it.

    Returns
    -------
    Drawing
        A figure of matplotlib's; a notebook shows it, and its `save` writes it to a file.

    Raises
    ------
    UnknownNameError
        If there is no such figure, output, source or model.
    FigureError
        If the archive has nothing for it, or matplotlib is not installed; or if a function of
        one's own fails.
    ArchiveError
        If it lacks data that figures need.
    """
    found = [
        panel
        for each in (name, *others)
        for panel in panels(tree, each, output=output, source=source, model=model)
    ]
    require_matplotlib()
    return _lay_out(found, str(tree.attrs.get("title", "")))


def panels(
    tree: xr.DataTree,
    name: str | FigureFunction,
    *,
    output: str | None = None,
    source: str | None = None,
    model: str | None = None,
) -> list[Panel]:
    """Return the panels of a figure; `Panel.draw_on_axes` draws each onto axes of one's own.

    Parameters and errors are those of `figure`.
    """
    if is_benchmark(tree):
        # All methods are shown.
        for option, value in (("source", source), ("model", model)):
            if value is not None:
                text = f"a benchmark of methods has no {option} to select: found {value}"
                raise FigureError(text)
        if name not in OF_BENCHMARKS:
            known = choices(str(name), OF_BENCHMARKS)
            raise UnknownNameError(f'no figure "{name}" of a benchmark of methods; {known}')
    view = _select_view(tree, output, source, model)
    found = figure_panels(name, view)
    if not found:
        selection = " and ".join(f'"{each}"' for each in (output, source, model) if each)
        shown = name if isinstance(name, str) else FIGURE.find(name, Path.cwd()).reference
        what = f'"{shown}" of {selection}' if selection else f'"{shown}"'
        if is_benchmark(tree):
            raise FigureError(f"the archive has nothing for the figure {what}")
        if not any(view.design(name).has_completed_runs for name in view.designs):
            what += ", as no run completed"
        elif not any(view.design(name).keeps_runs for name in view.designs):
            what += ", as it keeps statistics alone"
        has = ", ".join(_available_names(_select_view(tree, None, None, model))) or "none"
        raise FigureError(f"the archive has nothing for the figure {what}; it has: {has}")
    return found


class ArchivePlots:
    """Figures of an archive as methods, by their names with underscores.

    Each takes ``output``, ``source`` and ``model`` as `figure` does, and ``ax``, axes of
    matplotlib's to draw the only panel onto.

    Examples
    --------
    >>> archive.plot.cdf("penetration_depth").save("cdf.svg")  # doctest: +SKIP
    >>> archive.plot.sensitivity("penetration_depth", ax=ax)  # doctest: +SKIP
    """

    def __init__(self, tree: xr.DataTree) -> None:
        self._tree = tree

    def __dir__(self) -> list[str]:
        return [name.replace("-", "_") for name in available(self._tree)]

    def __repr__(self) -> str:
        return f"<figures of this archive: {', '.join(dir(self))}>"

    def __getattr__(self, name: str) -> Callable[..., Drawing | Axes]:
        known = {each.replace("-", "_"): each for each in FIGURES}
        if name not in known:
            raise AttributeError(f"no figure {name!r}; this archive has: {', '.join(dir(self))}")
        return functools.partial(self._draw, known[name])

    def _draw(
        self, name: str, output: str | None = None, *, ax: Axes | None = None, **selected: str
    ) -> Drawing | Axes:
        if ax is None:
            return figure(self._tree, name, output=output, **selected)
        found = panels(self._tree, name, output=output, **selected)
        if len(found) > 1:
            titles = "; ".join(panel.title for panel in found)
            raise FigureError(f"the figure has {len(found)} panels, and ax is one: {titles}")
        found[0].draw_on_axes(ax)
        return ax


def available(tree: xr.DataTree) -> dict[str, str]:
    """Return the figures that an archive has data for, each with its description."""
    return _available_names(_select_view(tree, None, None, None))


def check_archive(tree: xr.DataTree) -> None:
    """Raise an `ArchiveError` for a damaged archive."""
    faults: list[Iterable[str]] = [find_level_faults(tree)]
    faults += (
        [find_comparison_faults(tree)]
        if is_benchmark(tree)
        else map(find_model_faults, model_trees(tree).values())
    )
    if fault := next(chain(*faults), None):
        raise ArchiveError(f"the archive is damaged: {fault}")


def _select_view(
    tree: xr.DataTree, output: str | None, source: str | None, model: str | None
) -> ArchiveView:
    check_archive(tree)
    return select_view(tree, output, source, model)


def _available_names(view: ArchiveView) -> dict[str, str]:
    """Return the figures that a part has data for; of one that fails, the reason."""
    found = {}
    is_of_methods = is_benchmark(view.archive)
    for name in OF_BENCHMARKS if is_of_methods else FIGURES:
        function = FIGURE.find(name, Path())
        if next(iter(function.function(view)), None) is not None:
            found[name] = function.title.removesuffix(".")
    for name in () if is_of_methods else FIGURE.installed():
        try:
            if figure_panels(name, view):
                found[name] = FIGURE.find(name, Path()).title.removesuffix(".")
        except FigureError as error:
            found[name] = str(error)
    return found


def _lay_out(found: Sequence[Panel], title: str) -> Drawing:
    from uqpen.figures.drawing import Drawing, RoundedLayout

    shown = found[:_MOST_PANELS]
    groups = [list(group) for _, group in itertools.groupby(shown, lambda panel: panel.group)]
    columns = 1 if len(shown) == 1 else 2 if len(shown) <= 4 else 3
    most = max(map(len, groups))
    if most == 1:
        groups = [list(shown)]
    elif len(groups) > 1 and most in (2, 4):
        columns = most
    parts = ((group, start) for group in groups for start in range(0, len(group), columns))
    rows = [group[start : start + columns] for group, start in parts]
    heights = [max(panel.height for panel in row) for row in rows]
    with figure_style():
        page = Drawing(layout=RoundedLayout())
        grid = page.add_gridspec(len(rows), columns, height_ratios=heights)
        notes: dict[str, None] = {}
        for number, row in enumerate(rows):
            for column, panel in enumerate(row):
                axes = page.add_subplot(grid[number, column])
                notes |= dict.fromkeys(panel.draw_on_axes(axes))
                # Rows are named once where they are the same as those on the left.
                has_rows = not column or not panel.rows or panel.rows != row[column - 1].rows
                longest = min(max(map(len, panel.rows), default=0), LONGEST_ROW)
                across = _TITLE[columns] - longest // columns
                axes.set_title(_break_lines(panel.title, across, 4))
                axes.set_xlabel(_break_lines(axes.get_xlabel(), across, 2))
                axes.set_ylabel(_break_lines(axes.get_ylabel(), int(10 * panel.height), 2))
                if not has_rows:
                    axes.tick_params(labelleft=False)
        if len(shown) < len(found):
            notes |= {f"the first {len(shown)} of {len(found)} panels; ask for one output": None}
        below = _legend(page, list(notes), columns)
        page.set_size_inches(_WIDTHS[columns], sum(heights) + below + _HEAD)
        shown_title = plain_text(title, int(13 * _WIDTHS[columns]))
        page.suptitle(shown_title, x=0.01, ha="left")
    return page


def _break_lines(text: str, width: int, most: int) -> str:
    """A text in lines, cut where there would be too many."""
    return "\n".join(textwrap.wrap(plain_text(text, 200), width, max_lines=most, placeholder="…"))


def _handle_colour(handle: Any) -> str:
    """Return the colour of a line or an area in a legend; empty of anything else."""
    from matplotlib.colors import to_hex
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    if isinstance(handle, Line2D):
        return to_hex(handle.get_color())
    return to_hex(handle.get_facecolor()) if isinstance(handle, Patch) else ""


def _legend(page: Drawing, notes: list[str], columns: int) -> float:
    """Put one legend, with the notes above its entries, below all panels; return its height."""
    found: dict[str, dict[str, tuple[Any, list[Axes]]]] = {}
    for axes in page.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            looks = found.setdefault(label, {})
            looks.setdefault(_handle_colour(handle), (handle, []))[1].append(axes)
    shared = [panels for looks in found.values() if len(looks) > 1 for _, panels in looks.values()]
    marked = [axes for axes in page.axes if any(axes in panels for panels in shared)]
    letters = {axes: f"({chr(ord('a') + number)})" for number, axes in enumerate(marked)}
    for axes, letter in letters.items():
        axes.set_title(f"{letter} {axes.get_title(loc='left')}")
    handles = {
        " ".join([label, *(letters[axes] for axes in panels if len(looks) > 1)]): handle
        for label, looks in found.items()
        for handle, panels in looks.values()
    }
    width = int(_WIDTHS[columns] * _CHARACTERS)
    lines = [line for note in notes for line in textwrap.wrap(plain_text(note, 300), width)]
    if not handles and not lines:
        return 0.0
    longest = max(map(len, handles), default=1)
    across = max(1, min(len(handles), width // (longest + 7)))
    page.legend(
        handles.values(),
        handles.keys(),
        loc="outside lower left",
        ncols=across,
        title="\n".join(lines) or None,
        alignment="left",
    )
    return 0.16 * (len(lines) + -(-len(handles) // across)) + 0.15
