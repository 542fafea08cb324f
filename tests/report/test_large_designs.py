"""Charts of a design with more runs than figures show are drawn from quantiles of all runs."""

import numpy as np
import pytest

import uqpen
from uqpen.charts.distributions import LargestRun, distribution_curves, exceedance_tail
from uqpen.charts.histograms import histogram
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number

RUNS, SHOWN = 4_000, 300


def _grown(x):
    if x > 2.5:
        raise ValueError("x is too large")
    return {"y": float(np.exp(x))}


@pytest.fixture(scope="module")
def archive():
    study = uqpen.Study(
        seed=3,
        model=uqpen.PythonModel(_grown, inputs={"x": "1"}, outputs={"y": "m"}),
        inputs={"x": "0 ± 1"},
        outputs={"y": {"unit": "cm"}},
        designs={"draws": uqpen.MonteCarlo(runs=RUNS)},
    )
    return uqpen.run(study)


@pytest.fixture
def view(archive, monkeypatch):
    """Return a view of the archive whose figures show few runs."""
    monkeypatch.setattr("uqpen.results.archive_view.RUNS_IN_MEMORY", SHOWN)
    return ArchiveView(archive, "")


@pytest.fixture
def completed(archive):
    """Return the completed runs in m; the largest is none of the first."""
    runs = archive["runs/draws"].to_dataset()
    values = runs["y"].values[runs["status"].values == 0]
    assert values[:SHOWN].max() < values.max()
    assert values.size < RUNS
    return values


def test_a_histogram_is_that_of_all_runs(view, completed):
    values = view.shown_values("draws", "y")
    shares = np.searchsorted(np.sort(completed), values, side="right") / completed.size
    np.testing.assert_allclose(shares, np.linspace(0, 1, 1001), atol=2e-3)
    assert values[[0, -1]].tolist() == [completed.min(), completed.max()]
    assert histogram(view, "y", "draws").title == f"draws, by {grouped_number(1001)} quantiles"


def test_the_largest_run_is_that_of_all_runs(view, completed):
    largest = LargestRun.of_design(view, "draws", "y")
    assert largest.runs == completed.size
    assert largest.value == pytest.approx(100 * completed.max())


def test_a_tail_is_that_of_all_runs(view, completed):
    (curve,) = distribution_curves(view, "y")
    values, band = exceedance_tail(curve)
    beyond = [np.mean(100 * completed > value) for value in values[:-1]]
    estimate, lower, upper = band[:-1].T
    np.testing.assert_allclose(estimate, beyond, atol=1.5e-3)
    assert ((lower <= beyond) & (beyond <= upper)).all()
    assert values[-1] == pytest.approx(100 * completed.max())
