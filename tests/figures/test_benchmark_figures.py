"""Figures of a benchmark of methods, from an archive that is kept."""

import gzip
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from uqpen.archive.read import open_archive
from uqpen.core.errors import FigureError, UnknownNameError
from uqpen.figures import OF_BENCHMARKS
from uqpen.figures.page import available, figure, panels

KEPT = Path(__file__).parents[1] / "data" / "comparisons" / "schema_1.nc.gz"


@pytest.fixture(scope="module")
def benchmark(tmp_path_factory):
    path = tmp_path_factory.mktemp("kept") / "kept.nc"
    path.write_bytes(gzip.decompress(KEPT.read_bytes()))
    return open_archive(path)


def test_it_has_figures_of_its_own(benchmark):
    assert list(available(benchmark)) == list(OF_BENCHMARKS)


def test_errors_are_those_of_the_archive(benchmark):
    found = panels(benchmark, "errors", output="y")
    panel = next(panel for panel in found if panel.title.startswith("y: mean: "))
    axes = Figure().subplots()
    notes = panel.draw_on_axes(axes)
    joined = [np.asarray(line.get_ydata()) for line in axes.lines if len(line.get_ydata()) == 2]
    guide, monte_carlo, latin_hypercube = joined
    for name, line in {"monte_carlo": monte_carlo, "latin_hypercube": latin_hypercube}.items():
        errors = benchmark[f"statistics/{name}/y/mean_error"].values[:, 0]
        np.testing.assert_allclose(line, 100 * errors)
    assert guide[1] == pytest.approx(monte_carlo[0] / np.sqrt(2)), "at twice the runs"
    assert "Bars: 95 % intervals of the error over the repeats." in notes
    _, labels = axes.get_legend_handles_labels()
    assert labels[:3] == ["monte_carlo", "latin_hypercube", "1/√runs"]


def test_rates_are_those_of_the_archive(benchmark):
    (panel,) = panels(benchmark, "rates")
    axes = Figure().subplots()
    notes = panel.draw_on_axes(axes)
    slope = float(benchmark["statistics/monte_carlo/y/mean_slope"].values[0])
    marked = [float(x) for line in axes.lines for x in np.ravel(line.get_xdata())]
    assert slope in marked
    assert "Dashed: −0.5, as errors fall with 1/√runs." in notes


def test_coverage_has_a_row_for_each_statistic(benchmark):
    (panel,) = panels(benchmark, "coverage")
    quantiles = ("0.2 % quantile", "5 % quantile", "median", "95 % quantile")
    assert panel.rows == ("mean", "sd", *quantiles, "P(> 5)")
    axes = Figure().subplots()
    notes = panel.draw_on_axes(axes)
    marks = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in axes.lines])
    assert (marks <= 100).all()
    lower, upper = axes.get_xlim()
    assert lower < marks.min() <= marks.max() < upper
    assert any(re.search(r"Shaded: shares from \d+ %, which 10 intervals", note) for note in notes)


def test_both_can_be_on_a_page(benchmark, tmp_path):
    figure(benchmark, "coverage", "errors").save(tmp_path / "both.svg")
    assert (tmp_path / "both.svg").read_text("utf-8").startswith("<?xml")


def test_mistakes_are_reported(benchmark):
    with pytest.raises(UnknownNameError, match="known: errors, rates, coverage"):
        panels(benchmark, "cdf")
    with pytest.raises(UnknownNameError, match='no output "xy"; did you mean "y"'):
        panels(benchmark, "errors", output="xy")
    with pytest.raises(FigureError, match="no source to select: found monte_carlo"):
        panels(benchmark, "errors", source="monte_carlo")
