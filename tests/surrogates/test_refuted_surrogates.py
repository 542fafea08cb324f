"""Surrogates that runs refute: no surface has a figure of theirs, and each says why."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from scipy.spatial.distance import cdist

import uqpen
from uqpen.charts.source_comparison import compared_statistics
from uqpen.core.errors import SettingsError
from uqpen.core.labels import BOUND, NOTE
from uqpen.rehearsal.rehearsed_study import open_rehearsed
from uqpen.report.blocks import Alerts, Findings, Quote
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.surrogates.diagnostics import refuted_outputs
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.output_surrogate import OutputSurrogate
from uqpen.surrogates.separate_fits import OutputFit

pytestmark = pytest.mark.slow


def two_stages(a, b):  # type: ignore[no-untyped-def]
    """A delay that the second stage rules at low temperatures, which few runs have."""
    temperature = 980 + 40 * a
    first = 1e-5 * np.exp(9000 * (1 / temperature - 1e-3))
    return {"y": first + 1e-4 * np.exp(60_000 / temperature - 66.7) + 1e-9 * b}


def waves(a, b):  # type: ignore[no-untyped-def]
    return {"y": np.sin(13 * a) * np.cos(10 * b)}


def jump(a, b):  # type: ignore[no-untyped-def]
    return {"y": float(a + 0.2 * b > 1.2)}


def resonance(a, b):  # type: ignore[no-untyped-def]
    ratio = 1 + 0.1 * a
    return {"y": 1 / np.hypot(1 - ratio**2, 0.02 * ratio) + 0.1 * b}


def bow(a, b):  # type: ignore[no-untyped-def]
    return {"y": a + 0.8 * a**2 + 0.01 * b}


def dip(a, b):  # type: ignore[no-untyped-def]
    return {"y": (a + 0.1 * b) ** 2 + 1e-9}


@dataclass(frozen=True, eq=False)
class KernelFit(OutputFit):
    points: np.ndarray
    weights: np.ndarray

    def predict(self, points):
        return Prediction(_kernel(points, self.points) @ self.weights)


@dataclass(frozen=True)
class LongLength(OutputSurrogate):
    """An interpolation whose correlation length is far too long for the waves."""

    output_fit = KernelFit

    def fit_output(self, points, values, rng):
        nugget = 1e-9 * np.eye(len(points))
        return KernelFit(points, np.linalg.solve(_kernel(points, points) + nugget, values))


def _kernel(left, right):
    return np.exp(-cdist(left, right, "sqeuclidean") / 8)


@dataclass(frozen=True, eq=False)
class RootFit(OutputFit):
    lowest: float

    def predict(self, points):
        with np.errstate(invalid="ignore"):
            return Prediction(np.sqrt(points[:, 0] - self.lowest))


@dataclass(frozen=True)
class Root(OutputSurrogate):
    """A law that has no value below the training runs."""

    output_fit = RootFit

    def fit_output(self, points, values, rng):
        return RootFit(float(points[:, 0].min()))


LOG = {"y": "log"}
LEAST_SQUARES = partial(uqpen.PolynomialChaos, method="least-squares", order=6)
CASES = {
    "beyond the training runs": (two_stages, "many", partial(uqpen.PolynomialChaos, transform=LOG)),
    "overfit": (waves, None, LEAST_SQUARES),
    "jump": (jump, "many", LEAST_SQUARES),
    "resonance": (resonance, "many", LEAST_SQUARES),
    "wrong transform": (dip, None, partial(LEAST_SQUARES, transform=LOG)),
    "wrong length": (waves, "many", LongLength),
    "not finite": (waves, "many", Root),
}


def study_of(name):
    model, check, surrogate = CASES[name]
    return uqpen.Study(
        model=model,
        inputs={"a": uqpen.Normal(0, 1), "b": uqpen.Normal(0, 1)},
        outputs={"y": uqpen.OutputSpec(exceeds=["0.5"])},
        designs={"few": uqpen.LatinHypercube(runs=30), "many": uqpen.MonteCarlo(runs=200)},
        surrogates={"cheap": surrogate(design="few", check=check)},
        seed=3,
    )


@pytest.fixture(scope="module", params=CASES)
def tree(request):
    return uqpen.run(study_of(request.param))


def numbers(content):
    """Yield the numbers of the estimates in JSON."""
    if isinstance(content, dict):
        for key, each in content.items():
            if key in ("estimate", "lower", "upper", "surrogate_estimate", "equivalent_runs"):
                yield each
            else:
                yield from numbers(each)


def test_no_estimate_is_a_number_and_all_have_the_reason(tree):
    found = SourceStatistics(tree).statistics("cheap", "y")
    assert {"mean", "quantile", "exceedance", "first_order", "shapley"} <= set(found)
    for array in found.values():
        assert np.isnan(array.values).all()
        if BOUND in array.dims:
            assert all("is refuted" in note for note in np.ravel(array.coords[NOTE].values))


def test_no_figure_of_theirs_is_in_any_table_or_file(tree):
    for table in output_tables(tree, everything=True):
        if "cheap" in table.columns and "runs" in [label for label, _ in table.rows]:
            place = table.columns.index("cheap")
            cells = {label: cells[place][:1] for label, cells in table.rows if label != "runs"}
            assert set(cells.values()) == {"–"}
        assert not table.title.startswith("cheap: y")  # the corrected ones beside its own
    content = archive_json(tree)["surrogates"]["cheap"]["outputs"]
    assert set(numbers(content)) == {None}
    rows = long_table(tree, functions=True)
    ours = rows[rows["source"] == "cheap"]
    numeric = ours[["estimate", "lower", "upper", "surrogate_estimate", "equivalent_runs"]]
    assert len(ours) > 10
    assert numeric.isna().all(axis=None)
    for compared in compared_statistics(ArchiveView(tree, ""), "y"):
        assert "cheap" not in compared.available_estimates


def test_the_page_says_it_and_asks_the_runs(tree):
    blocks = list(answer(ArchiveView(tree, "")))
    for block in blocks:
        assert "cheap" not in repr(block) or isinstance(block, Alerts)
    (alerts,) = (each.alerts for each in blocks if isinstance(each, Alerts))
    (alert,) = (each for each in alerts if each.about == "Refuted surrogate")
    assert alert.text.startswith("cheap, y: the surrogate is refuted: ")
    assert any(isinstance(each, Findings | Quote) for each in blocks)


def test_a_prediction_and_a_rehearsal_say_it(tmp_path, command_line):
    path = tmp_path / "delay.nc"
    uqpen.make_archive(study_of("beyond the training runs"), path)
    reason = r"cheap, y: the surrogate is refuted: the mean of its predictions is beyond all 230"
    surrogate = uqpen.open_archive(path).surrogate("cheap")
    with pytest.warns(uqpen.RefutationWarning, match=reason):
        surrogate(a=0.0, b=0.0)
    (tmp_path / "points.csv").write_text("a,b\n0,0\n")
    for command in (["predict", f"{path}:cheap", "points.csv"], ["run", f"{path}:cheap"]):
        reported = command_line(*command)
        assert reported.code == 0
        assert reason in " ".join(reported.err.split())
    with open_rehearsed(path) as rehearsed, pytest.raises(SettingsError, match="is refuted"):
        assert rehearsed.study


def test_a_poor_surrogate_has_only_figures_that_runs_correct():
    # A line in a explains 1 / (1 + 2 * 0.8**2) = 44 % of the variance.
    tree = uqpen.run(
        uqpen.Study(
            model=bow,
            inputs={"a": uqpen.Normal(0, 1), "b": uqpen.Normal(0, 1)},
            outputs={"y": uqpen.OutputSpec()},
            designs={"few": uqpen.LatinHypercube(runs=200)},
            surrogates={
                "line": uqpen.PolynomialChaos("few", method="least-squares", order=1),
                "bow": uqpen.PolynomialChaos("few", method="least-squares", order=2),
            },
            seed=2,
        )
    )
    statistics = SourceStatistics(tree)
    poor, good = (statistics.statistics(name, "y") for name in ("line", "bow"))
    assert np.isfinite(poor["mean"].values).all()
    assert np.isfinite(poor["quantile"].values).all()
    assert np.isnan(poor["shapley"].values).all()
    assert "% of the variance at runs left out, too little" in str(poor["shapley"][NOTE].values[0])
    np.testing.assert_allclose(good["shapley"].values[:, 0], [1, 0], atol=0.02)
    assert not refuted_outputs(tree["surrogates/line"])
