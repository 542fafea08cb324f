"""Runs with weights: importance sampling, and points of a table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import xarray as xr
from drawn_samples import runs_of_values
from scipy import special

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.archive.structure import find_faults
from uqpen.core.labels import NOTE
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, number
from uqpen.designs.design import Design
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import statistics_tables
from uqpen.statistics import texts
from uqpen.statistics.analyze import analyze, analyze_failures
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.run_samples import sample_of
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis
from uqpen.testing import check_design

Y = QuantityOfInterest(
    Output("y", "m"), "m", thresholds=(Threshold("3 m", 3.0),), tolerance_contents=(0.95,)
)
RARE = float(special.ndtr(-3.0))


@dataclass(frozen=True)
class DefensiveShift(Design):
    """Importance sampling of the first random input's upper tail.

    Half of the draws have its probability moved to the tail, which bounds the weights by 2
    (Hesterberg, T. (1995). Technometrics 37, 185-194).
    """

    sampling = Sampling.INDEPENDENT

    runs: int = count()
    shift: float = number(above=0)

    def rounds(self, joint, stream):
        generator = stream.generator("points")
        unit = generator.random((self.runs, len(joint.random)))
        z = special.ndtri(unit[:, 0])
        z += np.where(generator.random(self.runs) < 0.5, self.shift, 0.0)
        unit[:, 0] = special.ndtr(z)
        ratio = np.exp(self.shift * z - self.shift**2 / 2)
        yield joint.points(unit, {}).assign_coords(weight=("run", 2 / (1 + ratio)))

    def run_count(self, joint):
        return self.runs


def importance_runs(seed, runs=1000):
    generator = np.random.default_rng(seed)
    z = generator.normal(size=runs) + np.where(generator.random(runs) < 0.5, 3.0, 0.0)
    return runs_of_values(z, weights=2 / (1 + np.exp(3 * z - 4.5)))


NORMAL = np.random.default_rng(3).normal(size=400)


@pytest.mark.parametrize("statistic", ["mean", "std", "skewness", "kurtosis", "effective_runs"])
def test_equal_weights_are_no_weights(statistic):
    weighted, plain = (
        analyze(runs_of_values(NORMAL, weights=w), [Y])["y"] for w in (np.full(400, 7.0), None)
    )
    np.testing.assert_allclose(weighted[statistic], plain[statistic], rtol=1e-12, equal_nan=True)


def test_equal_weights_give_clopper_and_pearsons_interval():
    weighted, plain = (
        analyze(runs_of_values(3 * NORMAL, weights=w), [Y])["y"]["exceedance"]
        for w in (np.full(400, 0.1), None)
    )
    np.testing.assert_allclose(weighted, plain, rtol=1e-9)


def test_a_whole_weight_is_that_many_equal_runs():
    copies = np.random.default_rng(1).integers(0, 4, 400)
    found = sample_of(runs_of_values(NORMAL, weights=copies.astype(float)), "y")
    repeated = np.repeat(NORMAL, copies)
    assert found.mean(found.values) == pytest.approx(repeated.mean(), rel=1e-12)
    assert found.effective_size == pytest.approx(copies.sum() ** 2 / (copies**2).sum())


def test_the_factor_of_the_weights_does_not_matter():
    weights = np.random.default_rng(2).random(400)
    one, other = (
        analyze(runs_of_values(NORMAL, weights=c * weights), [Y])["y"] for c in (1.0, 2.0**600)
    )
    for name, array in one.items():
        np.testing.assert_allclose(array, other[name], rtol=1e-9, equal_nan=True)


@pytest.mark.slow
def test_intervals_of_importance_sampling_cover():
    # 100 seeds: of intervals that hold in 95 %, fewer than 88 hold once in 680 times.
    truths = {"mean": 0.0, "exceedance": RARE, "quantile": float(special.ndtri(0.95))}
    quantity = replace(Y, quantiles=(0.95,))
    held, values = dict.fromkeys(truths, 0), []
    for seed in range(100):
        found = analyze(
            importance_runs(seed), [quantity], only=("moments", "exceedance", "quantiles")
        )
        for name, truth in truths.items():
            _, lower, upper = np.ravel(found["y"][name])
            held[name] += int(lower <= truth <= upper)
        values.append(float(found["y"]["exceedance"][0, 0]))
    assert all(88 <= each <= 100 for each in held.values()), held
    # One run in 741 has the event; of 1 000 equal draws the error would be 86 % of it.
    assert np.std(values) / RARE < 0.15
    assert np.mean(values) == pytest.approx(RARE, rel=4 * 0.15 / np.sqrt(100))


def test_what_takes_no_weights_says_so():
    found = analyze(importance_runs(1), [Y])["y"]
    for name in ("tolerance_limit", "first_order", "pearson", "partial_rank", "delta"):
        assert np.isnan(found[name]).all()
        assert set(np.ravel(found[name].coords[NOTE])) == {texts.NOT_WEIGHTED}
    assert np.isnan(found["cdf_band"].values[:, 1:]).all()
    assert np.isfinite(found["cdf"]).all()
    assert float(found["effective_size"][0]) == pytest.approx(550, rel=0.1)


def test_an_event_in_no_run_has_no_interval():
    quantity = replace(Y, thresholds=(Threshold("99 m", 99.0),))
    found = analyze(importance_runs(1), [quantity])["y"]["exceedance"]
    assert found.values[0].tolist() == [0.0] + 2 * [pytest.approx(np.nan, nan_ok=True)]
    assert found.coords[NOTE].item() == texts.CONSTANT_EVENT


def test_a_small_effective_size_has_no_interval():
    weights = np.where(np.arange(400) < 3, 1.0, 1e-9)
    mean = analyze(runs_of_values(NORMAL, weights=weights), [Y])["y"]["mean"]
    assert mean.values[0] == pytest.approx(NORMAL[:3].mean(), rel=1e-6)
    assert interval_text(mean, NOTE) == "weights: an effective sample size of 3 is too small"


def test_a_hidden_tail_is_reported_by_the_effective_size():
    weights = np.where(np.arange(400) < 100, 1.0, 1e-9)
    std = analyze(runs_of_values(NORMAL, weights=weights), [Y])["y"]["std"]
    expected = "weights: an effective sample size below 200 is too small to detect a heavy tail"
    assert interval_text(std, NOTE) == expected


def test_missing_runs_widen_a_weighted_probability():
    whole = importance_runs(4)
    failed = whole.copy(deep=True)
    failed["status"].values[::50] = 2
    one, other = (analyze(each, [Y])["y"]["exceedance"].values[0] for each in (whole, failed))
    assert other[2] - other[1] > 1.5 * (one[2] - one[1])
    found = analyze_failures(failed)
    assert float(found["probability"].sel(status="failed")[0]) == pytest.approx(0.02, abs=0.01)
    assert set(np.ravel(found["larger"].coords[NOTE])) == {texts.NOT_WEIGHTED}


def test_a_user_defined_analysis_declares_that_it_takes_weights():
    def spread(sample, quantity):
        estimate = Estimate.without_bounds(sample.mean(np.abs(sample.values)), "")
        yield "mean_size", estimate.to_array(units="m", long_name="mean size")

    analysis = UserDefinedAnalysis("a.py:spread", spread)
    unaware = analyze(importance_runs(1), [Y], user_defined=[analysis])["y"]["mean_size"]
    assert np.isnan(unaware).all()
    assert interval_text(unaware, NOTE) == texts.NOT_WEIGHTED
    spread.takes_weights = True  # type: ignore[attr-defined]
    aware = analyze(importance_runs(1), [Y], user_defined=[analysis])["y"]["mean_size"]
    assert float(aware[0]) == pytest.approx(np.sqrt(2 / np.pi), abs=0.1)


def study_with(design, folder):
    return uqpen.Study(
        model=lambda x, z: {"y": x + 0 * z},
        inputs={"x": uqpen.Normal("0 m", "1 m"), "z": uqpen.Uniform("1 s", "2 s")},
        outputs={"y": uqpen.OutputSpec("m", exceeds=["3 m"])},
        designs={"mine": design},
        seed=5,
        folder=folder,
    )


def test_a_user_defined_design_samples_a_rare_event(tmp_path):
    check_design(DefensiveShift(4000, 1.0))
    study = study_with(DefensiveShift(2000, 3.0), tmp_path)
    uqpen.make_archive(study, tmp_path / "rare.nc")
    tree = uqpen.open_archive(tmp_path / "rare.nc")
    _, lower, upper = tree["statistics/mine/y"]["exceedance"].values[0]
    assert lower < RARE < upper
    assert upper - lower < 0.5 * RARE
    assert tree["runs/mine"]["weight"].dims == ("run",)
    frame = long_table(tree)
    assert (frame["statistic"] == "effective_size").sum() == 1
    assert "effective_size" in str(archive_json(tree))
    uqpen.write_report(tree, tmp_path / "rare.html")


def test_a_table_gives_weights(tmp_path):
    runs = importance_runs(6, 300)
    rows = [f"{x},1,{w}" for x, w in zip(runs["y"].values, runs["weight"].values, strict=True)]
    (tmp_path / "points.csv").write_text("\n".join(["x [m],z [s],weight", *rows]))
    table = {"kind": "table", "file": "points.csv", "independent": True}
    tree = uqpen.run(study_with(table, tmp_path))
    np.testing.assert_array_equal(tree["runs/mine"]["weight"], runs["weight"])
    value = tree["statistics/mine/y"]["mean"].values[0]
    assert value == pytest.approx(
        float((runs["y"] * runs["weight"]).sum() / runs["weight"].sum()), rel=1e-12
    )


@pytest.mark.parametrize(
    ("weights", "found"),
    [
        (("1", "-2"), "found -2, expected weights of 0 or more"),
        (("0", "0"), "found 0 everywhere, expected some weight above 0"),
        (("1", "much"), 'line 3, column "weight": found "much", expected a number'),
    ],
)
def test_weights_that_are_none_are_refused(weights, found, tmp_path):
    rows = [f"0,1,{weight}" for weight in weights]
    (tmp_path / "points.csv").write_text("\n".join(["x [m],z [s],weight", *rows]))
    with pytest.raises(uqpen.StudyError, match="weight") as caught:
        study_with({"kind": "table", "file": "points.csv"}, tmp_path)
    assert found in str(caught.value)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda w: -w, "its weight is not finite, below 0, or 0 everywhere"),
        (lambda w: w * np.nan, "its weight is not finite, below 0, or 0 everywhere"),
        (lambda w: w.astype(str), "its weight is not a number for each run"),
    ],
)
def test_a_design_with_wrong_weights_is_refused(change, found, tmp_path):
    class Wrong(DefensiveShift):
        def rounds(self, joint, stream):
            points = next(super().rounds(joint, stream))
            yield points.assign_coords(weight=("run", change(points["weight"].values)))

    with pytest.raises(uqpen.StudyError, match=found):
        uqpen.run(study_with(Wrong(10, 1.0), tmp_path))


def test_weights_of_stratified_points_are_refused(tmp_path):
    class Stratified(DefensiveShift):
        sampling = Sampling.STRATIFIED

    with pytest.raises(uqpen.StudyError, match="weights are of independent draws"):
        uqpen.run(study_with(Stratified(10, 1.0), tmp_path))


@dataclass(frozen=True)
class WeightAsVariable(DefensiveShift):
    """Adds the weights as a variable, which would be ignored."""

    def rounds(self, joint, stream):
        for points in super().rounds(joint, stream):
            yield points.reset_coords("weight")


def test_a_weight_that_is_no_coordinate_is_refused(tmp_path):
    with pytest.raises(uqpen.StudyError, match=r"its weight is a variable .* a coordinate"):
        uqpen.run(study_with(WeightAsVariable(runs=50, shift=3.0), tmp_path))


def test_the_effective_size_stands_in_the_table(tmp_path):
    tree = uqpen.run(study_with(DefensiveShift(runs=500, shift=3.0), tmp_path))
    table = next(statistics_tables(tree))
    rows = dict(table.rows)
    (cell,) = rows["effective runs"]
    (source,) = table.columns
    found = float(tree[f"statistics/{source}/y"]["effective_size"][0])
    assert cell.startswith(f"{found:.4g}")
    assert texts.DIAGNOSTIC_OF_WEIGHTS in table.notes


def test_an_input_may_be_a_weight(study_of):
    study = study_of("weight", weight=(1.0, 2.0))
    assert "effective_size" not in uqpen.run(study)["statistics/some/y"]


def test_an_archive_with_wrong_weights_is_damaged(tmp_path):
    tree = uqpen.run(study_with(DefensiveShift(10, 3.0), tmp_path))
    runs = tree["runs/mine"].to_dataset()
    tree["runs/mine"] = xr.DataTree(runs.assign_coords(weight=-runs["weight"]))
    assert "/runs/mine: a weight that is none" in set(find_faults(tree))
