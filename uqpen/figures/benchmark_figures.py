"""Figures of a benchmark of methods, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import xarray as xr

from uqpen.core.errors import FigureError, UnknownNameError
from uqpen.core.lookup import choices, resolve
from uqpen.figures import BENCHMARK_FIGURES
from uqpen.figures.panel import Panel
from uqpen.results.benchmark_entries import entries
from uqpen.results.benchmark_methods import check_benchmark

__all__ = ["available_benchmark_figures", "benchmark_panels"]


def available_benchmark_figures(tree: xr.DataTree) -> dict[str, str]:
    """Return the figures that an archive has data for, each with its description."""
    check_benchmark(tree)
    functions = {name: resolve(reference) for name, reference in BENCHMARK_FIGURES.items()}
    return {name: _title(each) for name, each in functions.items() if next(each(tree), None)}


def benchmark_panels(
    tree: xr.DataTree, name: object, *, output: str | None, source: str | None, model: str | None
) -> list[Panel]:
    """Return the panels of a figure of a benchmark of methods.

    Parameters and errors are those of `uqpen.figures.page.figure`. All methods are shown, so there
    is no source or model to select.
    """
    check_benchmark(tree)
    if name not in BENCHMARK_FIGURES:
        known = choices(str(name), BENCHMARK_FIGURES)
        raise UnknownNameError(f'no figure "{name}" of a benchmark of methods; {known}')
    for option, value in (("source", source), ("model", model)):
        if value is not None:
            raise FigureError(f"a benchmark of methods has no {option} to select: found {value}")
    outputs = list(dict.fromkeys(entry.output for entry in entries(tree)))
    if output is not None and output not in outputs:
        raise UnknownNameError(f'no output "{output}"; {choices(output, outputs)}')
    function = resolve(BENCHMARK_FIGURES[str(name)])
    found = [panel for panel in function(tree) if output in (None, panel.group)]
    if not found:
        raise FigureError(f'the archive has nothing for the figure "{name}"')
    return found


def _title(function: Callable[..., Any]) -> str:
    return (function.__doc__ or "").split("\n")[0].removesuffix(".")
