"""The trust gate: every verdict on a surrogate's figures, and that none is ever passed by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.report.blocks import Text
from uqpen.report.sections.surrogates import surrogates
from uqpen.results.archive_view import ArchiveView
from uqpen.results.output_tables import output_tables
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


def mean(value: float, lower: float, upper: float, missing: str = "") -> Statistics:
    estimate = Estimate(value, lower, upper, "by hand", "nominal")
    array = estimate.to_array(units="1", long_name="mean")
    return {"mean": array.assign_attrs({"missing": missing} if missing else {})}


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


def test_all_runs_with_an_interval_count() -> None:
    silent = mean(1.0, float("nan"), float("nan"))
    assert verdict(1.4, silent, mean(1.1, 0.9, 1.3))[0] == "refused"
    assert verdict(1.0, mean(1.1, 0.9, 1.3), silent, mean(1.05, 0.95, 1.15)) == (
        "checked",
        "inside the intervals of runs_0, runs_2 at one joint level",
    )
    assert verdict(1.0, mean(1.1, 0.9, 1.3), mean(3.0, 2.9, 3.1)) == (
        "refused",
        "outside the interval of runs_1 at the joint level of 2 designs",
    )


def test_intervals_of_several_runs_are_of_one_joint_level() -> None:
    # Outside 95 % intervals of ± 1 by a tenth: one of four may be so by chance, a single one not.
    off, near = mean(0.0, -1.0, 1.0), mean(1.0, 0.0, 2.0)
    assert verdict(1.1, off)[0] == "refused"
    assert verdict(1.1, off, near, near, near)[0] == "checked"
    assert verdict(1.5, off, near, near, near)[0] == "refused"


@pytest.mark.parametrize("designs", [1, 4])
def test_right_figures_are_not_refused_more_often_by_more_runs(designs: int) -> None:
    rng = np.random.default_rng(3)
    refused = 0
    for _ in range(1000):
        # Student's t with as many degrees of freedom as 16 replicates leave.
        errors = rng.normal(size=designs) * 0.1
        halves = 2.131 * 0.1 * np.sqrt(rng.chisquare(15, designs) / 15)
        found = [mean(e, e - half, e + half) for e, half in zip(errors, halves, strict=True)]
        refused += verdict(0.0, *found)[0] == "refused"
    # 5 % of 1 000 to three standard deviations; Bonferroni is at most that.
    assert refused <= 50 + 21


def test_runs_that_lack_failed_ones_are_of_another_population() -> None:
    lacking = mean(1.1, 0.9, 1.3, missing="4.6 % of the admissible runs")
    assert verdict(1.4, lacking) == verdict(1.0, lacking)
    assert verdict(1.4, lacking) == (
        "not comparable",
        "failed runs are missing from runs_0, but not from the surrogate",
    )
    whole = mean(1.4, 1.3, 1.5)
    assert verdict(1.4, lacking, whole) == ("checked", "inside the interval of runs_1")
    assert verdict(1.6, lacking, whole)[0] == "refused"


def test_what_no_runs_tell_is_unchecked() -> None:
    assert verdict(1.0) == ("unchecked", "no independent runs to compare with")
    silent = mean(1.0, float("nan"), float("nan"))
    assert verdict(1.0, silent) == ("unchecked", "no independent runs give an interval for it")


def test_what_is_not_a_number_stays_without_a_verdict() -> None:
    assert verdict(float("nan"), mean(1.1, 0.9, 1.3))[0] == "none"


@pytest.mark.parametrize(
    ("beyond", "note"),
    [
        (0.01, "no independent runs give an interval for it"),
        (
            0.2,
            "20 % of the variance is outside the training range of the surrogate; "
            "no independent runs give an interval for it",
        ),
    ],
)
def test_a_spread_of_an_extrapolated_tail_is_unchecked_where_no_runs_tell(
    beyond: float, note: str
) -> None:
    told = Estimate(2.0, 1.0, 3.0, "by hand", "nominal")
    silent = Estimate.without_bounds(2.0, "heavy tail")
    reach = {"y": TrainingRange(0.0, 9.0, beyond)}
    for estimate, expected in (
        (told, ("checked", "inside the interval of runs")),
        (silent, ("unchecked", note)),
    ):
        statistics = {"std": estimate.to_array(units="1", long_name="sd")}
        found = validate_surrogate(
            {"y": statistics}, [ValidationRuns("runs", {"y": statistics})], reach
        )["y"]["std"]
        assert (interval_text(found, "interval_label"), interval_text(found, "note")) == expected


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
    assert labels == ["checked", "refused", "checked"]
    assert str(array["note"].values[2]) == (
        "inside the interval of runs; outside the training range of the surrogate"
    )


def exceedance(value: float, lower: float, upper: float) -> Statistics:
    estimates = [Estimate(value, lower, upper, "by hand", "discrete")]
    array = Estimate.stack(estimates, "threshold", units="1", long_name="P")
    coordinates = {"threshold": ["12 m"], "threshold_value": ("threshold", [12.0])}
    return {"exceedance": array.assign_coords(coordinates)}


@pytest.mark.parametrize(
    ("runs", "expected"),
    [
        ((0.01, 0.002, 0.03), "checked"),
        ((0.05, 0.02, 0.1), "refused"),
        # No run reached it: what the surrogate says so far out is no better known by them.
        ((0.0, 0.0, 0.02), "unchecked"),
    ],
)
def test_beyond_the_training_range_runs_that_reach_it_decide(
    runs: tuple[float, float, float], expected: str
) -> None:
    found = validate_surrogate(
        {"y": exceedance(0.005, 0.005, 0.005)},
        [ValidationRuns("runs", {"y": exceedance(*runs)})],
        {"y": TrainingRange(0.0, 10.0, 0.0)},
    )["y"]["exceedance"]
    assert found["interval_label"].item() == expected
    assert ("outside the training range" in found["note"].item()) == (expected != "refused")


def test_the_error_of_drawing_a_rare_event_is_told() -> None:
    runs = [ValidationRuns("runs", {"y": exceedance(0.0, 0.0, 0.018)})]
    for sampled, note in (
        ((1e-4, 6e-5, 1.4e-4), "; sampling of the surrogate alone: 6e-05 to 0.00014"),
        ((0.01, 0.0099, 0.0101), ""),
    ):
        found = validate_surrogate({"y": exceedance(*sampled)}, runs, {"y": WIDE})
        array = found["y"]["exceedance"]
        assert array["note"].item() == f"inside the interval of runs{note}"


def index(value: float, half: float = np.nan) -> Statistics:
    estimates = [Estimate(value, value - half, value + half, "by hand", "nominal")]
    array = Estimate.stack(estimates, "input", units="1", long_name="first order")
    return {"first_order": array.assign_coords(input=["x"])}


@pytest.mark.parametrize(
    ("of_surrogate", "of_runs", "expected"),
    [
        (0.001, 9e-6, "checked"),
        (0.001, -0.002, "checked"),
        (0.01, 9e-6, "refused"),
        (0.52, 0.5, "refused"),
    ],
)
def test_shares_of_the_variance_that_differ_by_nothing_are_no_contradiction(
    of_surrogate: float, of_runs: float, expected: str
) -> None:
    runs = [ValidationRuns("runs", {"y": index(of_runs, 1e-6)})]
    found = validate_surrogate({"y": index(of_surrogate)}, runs, {"y": WIDE})
    assert found["y"]["first_order"]["interval_label"].item() == expected


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


NORMAL = "{ normal = { mean = 0, std = 1 } }"


def test_the_spread_of_an_exact_linear_surrogate_is_not_refused(study_of: MakeStudy) -> None:
    # Of a normal output 5.6 % of the variance is outside the range of 200 runs.
    text = DESIGNS.format(training=40).replace("2000", "100")
    tree = uqpen.run(study_of("a + 2 * b", text, a=NORMAL, b=NORMAL))
    std = tree["statistics/pce/y"]["std"]
    assert float(std[0]) == pytest.approx(5**0.5, abs=1e-12)
    assert std.attrs["interval_label"] == "unchecked"
    assert "of the variance is outside the training range" in std.attrs["note"]


def test_an_exact_surrogate_of_a_model_that_fails_in_a_corner_is_not_contradicted(
    study_of: MakeStudy,
) -> None:
    text = "[outputs.y]\nexceeds = [1.3]\n" + DESIGNS.format(training=100)
    corner = "np.where((a > 0.7) & (b > 0.7), np.nan, a + b)"
    tree = uqpen.run(study_of(corner, text, a=(0, 1), b=(0, 1)))
    assert "missing" in tree["statistics/runs/y"]["mean"].attrs
    found = SourceStatistics(tree).statistics("pce", "y")
    # Right figures of all inputs; the runs that came back have smaller ones.
    assert float(found["mean"][0]) == pytest.approx(1.0, abs=1e-9)
    for name in ("mean", "std", "quantile", "cdf_band", "first_order"):
        labels = np.ravel(found[name]["interval_label"].values)
        assert set(labels) == {"not comparable"}, name
    # This interval allows for any outcome of the failed runs.
    assert found["exceedance"]["interval_label"].values.tolist() == ["checked"]
    table = next(output_tables(tree))
    cells = dict(zip(table.columns, dict(table.rows)["mean"], strict=True))
    assert cells["pce"].startswith("1.000 not comparable")
    words = " ".join(
        block.text for block in surrogates(ArchiveView(tree, "")) if isinstance(block, Text)
    )
    assert " are not comparable: failed runs are missing from the independent runs" in words
    assert "0 are refused" in words


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
