"""Contract tests of figures and sections of the report from outside the package."""

from __future__ import annotations

import xarray as xr

from uqpen.core.errors import UqpenError
from uqpen.figures.figure_file import figure_bytes
from uqpen.figures.outside_figures import FigureFunction
from uqpen.figures.page import figure
from uqpen.report.outside_sections import SectionFunction
from uqpen.report.page import report_page

__all__ = ["check_figure", "check_section"]


def check_figure(function: FigureFunction, tree: xr.DataTree) -> None:
    """Check the contract of a figure.

    It has panels for the archive, which can be drawn; they are the same each time; and the archive
    is not changed.

    Parameters
    ----------
    function : callable
        Takes an `ArchiveView`, and yields panels.
    tree : DataTree
        An archive that it has something to show of.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    before = tree.copy(deep=True)
    try:
        first, second = (figure_bytes(figure(tree, function), "svg") for _ in range(2))
    except UqpenError as error:
        raise AssertionError(str(error)) from None
    assert tree.identical(before), "a figure does not change the archive"
    assert first == second, "a figure is the same each time"


def check_section(function: SectionFunction, tree: xr.DataTree) -> None:
    """Check the contract of a section of the report.

    It has blocks for the archive, which can be put on a page; they are the same each time; and the
    archive is not changed.

    Parameters
    ----------
    function : callable
        Takes an `ArchiveView`, and yields blocks.
    tree : DataTree
        An archive that it has something to show of.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    before = tree.copy(deep=True)
    try:
        first, second = (report_page(tree, [function]) for _ in range(2))
    except UqpenError as error:
        raise AssertionError(str(error)) from None
    assert 'id="own-1"' in first, "a section has something for this archive"
    assert tree.identical(before), "a section does not change the archive"
    assert first == second, "a section is the same each time"
