"""Contract tests of user-defined figures and sections of the report."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import xarray as xr

from uqpen.core.errors import UqpenError
from uqpen.figures.page import figure
from uqpen.figures.style import figure_bytes
from uqpen.figures.user_defined_figures import FigureFunction
from uqpen.report.page import SectionFunction, report_page

__all__ = ["check_figure", "check_section"]

DrawnT = TypeVar("DrawnT")


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
    _check_repetition(lambda: figure_bytes(figure(tree, function), "svg"), tree, "a figure")


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
    page = _check_repetition(lambda: report_page(tree, [function]), tree, "a section")
    assert 'id="own-1"' in page, "a section has something for this archive"


def _check_repetition(draw: Callable[[], DrawnT], tree: xr.DataTree, what: str) -> DrawnT:
    """Draw twice, check that both are the same and the archive is unchanged, and return one."""
    before = tree.copy(deep=True)
    try:
        first, second = draw(), draw()
    except UqpenError as error:
        raise AssertionError(str(error)) from None
    assert tree.identical(before), f"{what} does not change the archive"
    assert first == second, f"{what} is the same each time"
    return first
