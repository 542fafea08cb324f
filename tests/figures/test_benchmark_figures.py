"""Figures of a benchmark of methods, from an archive that is kept."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from uqpen.archive.read import open_archive
from uqpen.core.errors import FigureError, UnknownNameError
from uqpen.figures import BENCHMARK_FIGURES
from uqpen.figures.page import available, figure, panels
from uqpen.results.benchmark_entries import entries

KEPT = Path(__file__).parents[1] / "data" / "comparisons" / "schema_1.nc.gz"


@pytest.fixture(scope="module")
def benchmark(tmp_path_factory: pytest.TempPathFactory) -> xr.DataTree:
    path = tmp_path_factory.mktemp("kept") / "kept.nc"
    path.write_bytes(gzip.decompress(KEPT.read_bytes()))
    return open_archive(path)


def test_it_has_figures_of_its_own(benchmark: xr.DataTree) -> None:
    assert list(available(benchmark)) == list(BENCHMARK_FIGURES)


def test_errors_are_those_of_the_archive(benchmark: xr.DataTree) -> None:
    found = panels(benchmark, "errors", output="y")
    entry = next(entry for entry in entries(benchmark) if entry.label == "mean")
    panel = next(panel for panel in found if panel.title == "y: mean")
    axes = Figure().subplots()
    notes = panel.draw_on_axes(axes)
    joined = [np.asarray(line.get_ydata()) for line in axes.lines if len(line.get_ydata()) == 2]
    monte_carlo, latin_hypercube, guide = joined
    errors = 100 * entry.variable("error").values[..., 0]
    np.testing.assert_allclose(monte_carlo, errors[0])
    np.testing.assert_allclose(latin_hypercube, errors[1])
    assert guide[1] == pytest.approx(errors[0, 0] / np.sqrt(2)), "at twice the runs"
    assert "bars: 95 % intervals of the error over the repeats" in notes
    _, labels = axes.get_legend_handles_labels()
    assert labels == ["falls with 1/√runs", "monte_carlo", "latin_hypercube"]


def test_coverage_has_a_row_for_each_statistic_with_intervals(benchmark: xr.DataTree) -> None:
    (panel,) = panels(benchmark, "coverage")
    assert panel.rows == ("mean", "median", "P(> 5)")
    axes = Figure().subplots()
    notes = panel.draw_on_axes(axes)
    marks = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in axes.lines])
    assert (marks <= 100).all()
    lower, upper = axes.get_xlim()
    assert lower < marks.min() <= marks.max() < upper
    assert any(re.match(r"shaded: shares from \d+ %, which 10 intervals", note) for note in notes)


def test_both_can_be_on_a_page(benchmark: xr.DataTree, tmp_path: Path) -> None:
    figure(benchmark, "coverage", "errors").save(tmp_path / "both.svg")
    assert (tmp_path / "both.svg").read_text("utf-8").startswith("<?xml")


def test_mistakes_are_told(benchmark: xr.DataTree) -> None:
    with pytest.raises(UnknownNameError, match="known: errors, coverage"):
        panels(benchmark, "cdf")
    with pytest.raises(UnknownNameError, match='no output "xy"; did you mean "y"'):
        panels(benchmark, "errors", output="xy")
    with pytest.raises(FigureError, match="no source to select: found monte_carlo"):
        panels(benchmark, "errors", source="monte_carlo")
