"""The trust gate: every verdict on a surrogate's figures, and that none is ever passed by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.surrogate.surrogate_statistics import TrainingRange
from uqpen.study.study import ValidatedStudy
from uqpen.trust import ValidationRuns, validate_surrogate

pytestmark = pytest.mark.slow

MakeStudy = Callable[..., ValidatedStudy]

# Of one output.
Statistics = dict[str, xr.DataArray]

WIDE = TrainingRange(-100.0, 100.0, 0.0)


def mean(value: float, lower: float, upper: float) -> Statistics:
    estimate = Estimate(value, lower, upper, "by hand", "nominal")
    return {"mean": estimate.to_array(units="1", long_name="mean")}


def verdict(
    figure: float, *validation_runs: Statistics, training_range: TrainingRange = WIDE
) -> tuple[str, str]:
    known = [ValidationRuns(f"runs_{i}", {"y": each}) for i, each in enumerate(validation_runs)]
    unsampled = mean(figure, float("nan"), float("nan"))
    found = validate_surrogate({"y": unsampled}, known, {"y": training_range})
    array = found["y"]["mean"]
    assert np.isnan(array.values[1:]).all()
    assert array.values[0] == figure or np.isnan(figure)
    return interval_text(array, "interval_label"), interval_text(array, "note")


def test_a_figure_inside_the_runs_interval_is_checked() -> None:
    assert verdict(1.0, mean(1.1, 0.9, 1.3)) == (
        "checked",
        "inside the interval of runs_0",
    )


def test_a_figure_outside_is_refused() -> None:
    assert verdict(1.4, mean(1.1, 0.9, 1.3)) == (
        "refused",
        "outside the interval of runs_0",
    )


def test_the_first_runs_with_an_interval_decide() -> None:
    silent = mean(1.0, float("nan"), float("nan"))
    assert verdict(1.4, silent, mean(1.1, 0.9, 1.3))[0] == "refused"
    assert verdict(1.0, mean(1.1, 0.9, 1.3), mean(3.0, 2.9, 3.1))[0] == "checked"


def test_what_no_runs_tell_is_unchecked() -> None:
    assert verdict(1.0) == ("unchecked", "no independent runs to compare with")
    silent = mean(1.0, float("nan"), float("nan"))
    assert verdict(1.0, silent) == ("unchecked", "no independent runs give an interval for it")


def test_what_is_not_a_number_stays_without_a_verdict() -> None:
    assert verdict(float("nan"), mean(1.1, 0.9, 1.3))[0] == "none"


@pytest.mark.parametrize(("beyond", "label"), [(0.01, "unchecked"), (0.2, "refused")])
def test_a_spread_that_no_runs_vouch_for_must_not_hang_on_an_extrapolated_tail(
    beyond: float, label: str
) -> None:
    vouched = Estimate(2.0, 1.0, 3.0, "by hand", "nominal")
    silent = Estimate.without_bounds(2.0, "heavy tail")
    reach = {"y": TrainingRange(0.0, 9.0, beyond)}
    for estimate, expected in ((vouched, "checked"), (silent, label)):
        statistics = {"std": estimate.to_array(units="1", long_name="sd")}
        found = validate_surrogate(
            {"y": statistics}, [ValidationRuns("runs", {"y": statistics})], reach
        )
        assert interval_text(found["y"]["std"], "interval_label") == expected


def quantiles(values: Mapping[float, float], half: float) -> Statistics:
    estimates = [Estimate(v, v - half, v + half, "by hand", "discrete") for v in values.values()]
    array = Estimate.stack(estimates, "probability", units="1", long_name="quantiles")
    return {"quantile": array.assign_coords(probability=list(values))}


def test_each_of_several_figures_is_judged_by_itself() -> None:
    surrogate = quantiles({0.05: 1.0, 0.5: 2.0, 0.99: 12.0}, 0.01)
    runs = quantiles({0.05: 1.05, 0.5: 2.5, 0.99: 12.0}, 0.1)
    found = validate_surrogate(
        {"y": surrogate},
        [ValidationRuns("runs", {"y": runs})],
        {"y": TrainingRange(0, 10, 0)},
    )
    array = found["y"]["quantile"]
    labels = array["interval_label"].values.tolist()
    assert labels == ["checked", "refused", "refused"]
    assert "outside the training range" in str(array["note"].values[2])


def test_statistics_that_share_a_dimension_keep_their_own_verdicts() -> None:
    def indices(first: float, total: float) -> Statistics:
        found = {}
        for name, value in (("first_order", first), ("total_order", total)):
            estimates = [Estimate(value, value - 0.1, value + 0.1, "by hand", "nominal")]
            array = Estimate.stack(estimates, "input", units="1", long_name=name)
            found[name] = array.assign_coords(input=["x"])
        return found

    validation = ValidationRuns("runs", {"y": indices(0.5, 0.6)})
    found = validate_surrogate({"y": indices(0.55, 0.9)}, [validation], {"y": WIDE})["y"]
    assert found["first_order"]["interval_label"].values.tolist() == ["checked"]
    assert found["total_order"]["interval_label"].values.tolist() == ["refused"]


DESIGNS = """
[designs.training]
kind = "latin-hypercube"
runs = {training}
[designs.runs]
kind = "monte-carlo"
runs = 2000
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
"""


def test_a_good_surrogate_is_checked_throughout(study_of: MakeStudy) -> None:
    text = "[outputs.y]\nexceeds = [1.2]\n" + DESIGNS.format(training=100)
    tree = uqpen.run(study_of("a * b + c", text, a=(0, 1), b=(0, 1), c=(0, 1)))
    found = tree["statistics/pce/y"]
    assert float(found["mean"][0]) == pytest.approx(0.75, abs=1e-12)
    assert float(found["std"][0]) == pytest.approx((19 / 144) ** 0.5, abs=1e-12)
    assert found["mean"].attrs["estimator"] == "from the coefficients"
    labels = [found[name].attrs["interval_label"] for name in ("mean", "std")]
    assert labels == ["checked", "checked"]
    assert found["first_order"][:, 0].values == pytest.approx([3 / 19, 3 / 19, 12 / 19])
    assert found["total_order"][:, 0].values == pytest.approx([4 / 19, 4 / 19, 12 / 19])
    assert found["exceedance"].attrs["interval_label"] == "checked"
    assert tree["statistics/pce/y"]["cdf_band"].attrs["interval_label"] == "checked"
    assert int(tree["surrogates/pce"].attrs["runs_spent"]) == 2100


def test_a_bad_surrogate_is_refused_and_never_given_bounds(study_of: MakeStudy) -> None:
    # A step has no polynomial: forty runs fit one that misses the lumps on either side.
    text = DESIGNS.format(training=40)
    tree = uqpen.run(study_of("np.where(a + b > 1.6, 10.0, 0.0)", text, a=(0, 1), b=(0, 1)))
    statistics = SourceStatistics(tree).statistics("pce", "y")
    labels = statistics["quantile"]["interval_label"].values.tolist()
    assert "refused" in labels
    assert tree["statistics/pce/y"]["cdf_band"].attrs["interval_label"] == "refused"
    assert {"mean", "quantile", "cdf", "cdf_band", "first_order"} <= set(statistics)
    for array in statistics.values():
        if "bound" in array.dims:
            assert np.isnan(array.sel(bound=["lower", "upper"])).all()


def test_a_surrogate_over_admissible_draws_is_sampled_and_says_so(study_of: MakeStudy) -> None:
    text = '[constraints]\nkeep = ["a > b"]\n' + DESIGNS.format(training=200)
    tree = uqpen.run(study_of("a + b", text, a=(0, 1), b=(0, 1)))
    mean_of_triangle = tree["statistics/pce/y"]["mean"]
    assert float(mean_of_triangle[0]) == pytest.approx(1.0, abs=1e-3)
    assert mean_of_triangle.attrs["estimator"].startswith("by sampling the surrogate at 32")
    first = tree["statistics/pce/y"]["first_order"]
    assert "conditional on admissible inputs" in first.attrs["estimand"]
    assert first[:, 0].values == pytest.approx([0.75, 0.75], abs=0.01)


def test_a_surrogate_that_cannot_be_fitted_says_why(study_of: MakeStudy) -> None:
    tree = uqpen.run(study_of("0 * a + 2.0", DESIGNS.format(training=50), a=(0, 1)))
    assert "does not vary" in tree["surrogates/pce/y"].attrs["not_fitted"]
    assert "pce/y" not in tree["statistics"]


@pytest.mark.parametrize(
    ("header", "independent", "check"),
    [
        ("a,b", "true", "points"),
        ("a,b", "false", "none"),  # of points of unknown origin nothing follows
        ("a,b,c", "true", "none"),  # nor of those that vary an input that the study fixes
    ],
)
def test_only_a_sample_of_the_studys_own_law_vouches_for_a_surrogate_unasked(
    study_of: MakeStudy, tmp_path: Path, header: str, independent: str, check: str
) -> None:
    rows = np.random.default_rng(1).random((300, header.count(",") + 1)).tolist()
    lines = [header, *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "points.csv").write_text("\n".join(lines))
    text = f"""
    [designs.points]
    kind = "table"
    file = "points.csv"
    independent = {independent}
    [designs.training]
    kind = "latin-hypercube"
    runs = 100
    [surrogates.pce]
    kind = "polynomial-chaos"
    design = "training"
    """
    tree = uqpen.run(study_of("a + b + c", text, a=(0, 1), b=(0, 1), c=0.5))
    assert tree["surrogates/pce"].attrs["check"] == check


def test_what_sampling_leaves_open_is_not_held_against_a_surrogate() -> None:
    sampled = mean(1.4, 1.2, 1.6)
    found = validate_surrogate(
        {"y": sampled}, [ValidationRuns("runs", {"y": mean(1.1, 0.9, 1.3)})], {}
    )
    assert interval_text(found["y"]["mean"], "interval_label") == "checked"
