"""From a study to a tree: known answers, and nothing that depends on how it was computed."""

import re
from pathlib import Path

import numpy as np
import pytest

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics

STUDIES = Path(__file__).parents[1] / "studies"


@pytest.fixture(scope="module")
def concrete(whole_concrete):
    return uqpen.open_archive(whole_concrete)


def figure(tree, design, output, name, **at):
    return bounds(tree[f"statistics/{design}/{output}"][name].sel(at))


def bounds(array):
    return {str(bound): float(array.sel(bound=bound)) for bound in ("estimate", "lower", "upper")}


@pytest.mark.slow
def test_the_tables_of_the_page_are_those_that_are_printed(concrete):
    tables = {table.title: table for table in output_tables(concrete)}
    page = (STUDIES.parent / "docs" / "concrete.md").read_text(encoding="utf-8")
    shown = re.findall(r"```text\n(.*?)```", page, flags=re.DOTALL)
    assert len(shown) == 3
    for block in shown:
        table = tables[block.splitlines()[0]]
        for label, cells in table.rows:
            row = rf"^{re.escape(label)}\s+{re.escape(cells[0])}\s+{re.escape(cells[1])}(\s|$)"
            assert re.search(row, block, re.MULTILINE), (label, cells[:2])


DESIGNS = ["monte_carlo", "latin_hypercube"]  # of one size
TRUTHS = [
    ("penetration_depth", "mean", {}, 0.492739),
    ("penetration_depth", "quantile", {"probability": 0.5}, 0.466088),
    ("penetration_depth", "exceedance", {"threshold": "60 cm"}, 0.137167),
    ("projectile_residue", "mean", {}, 0.027075),
    ("termination", "share", {"category": "standstill"}, 0.319),
]


@pytest.mark.slow
@pytest.mark.parametrize("design", DESIGNS)
class TestConcrete:
    """The report's study against the truth of 25 million points of an independent code."""

    def test_its_intervals_hold_the_truth(self, concrete, design):
        for output, name, at, truth in TRUTHS:
            found = figure(concrete, design, output, name, **at)
            assert found["lower"] < truth < found["upper"], (output, name)
        mean = figure(concrete, design, "penetration_depth", "mean")
        # The width that 10 000 draws leave: 1.96 standard deviations over the root of 10 000.
        assert mean["upper"] - mean["lower"] < 2 * 0.0035

    def test_a_few_draws_are_inadmissible_and_say_so(self, concrete, design):
        probability = bounds(
            concrete[f"failures/{design}"]["probability"].sel(status="inadmissible")
        )
        assert probability["lower"] < 4.9e-4 < probability["upper"]
        attributes = concrete[f"statistics/{design}/penetration_depth"]["mean"].attrs
        assert attributes["runs_used"] + attributes["runs_inadmissible"] == 10_000
        assert attributes["conditional_on"] == "admissible inputs"

    def test_the_heavy_tail_is_owned_up_to(self, concrete, design):
        moments = concrete[f"statistics/{design}/penetration_depth"]
        std = moments["std"]
        assert np.isnan(std.sel(bound="upper"))
        assert "heavy tail" in std.attrs["note"]
        assert float(moments["kurtosis"][0]) > 6
        spread = figure(concrete, design, "penetration_depth", "half_spread")
        assert spread["lower"] < spread["estimate"] < spread["upper"]

    def test_every_lost_run_has_its_reason(self, concrete, design):
        runs = concrete[f"runs/{design}"]
        lost = np.flatnonzero(runs["status"].values)
        assert runs["lost_run"].values.tolist() == lost.tolist()
        possible = {"plasticity_radius > crater_radius", "plasticity_radius > 0"}
        assert set(runs["lost_reason"].values) <= possible
        assert np.isnan(runs["penetration_depth"].values[lost]).all()

    def test_the_bound_that_holds_is_above_the_estimate(self, concrete, design):
        at = {"content": 0.95}
        held = figure(concrete, design, "penetration_depth", "tolerance_limit", **at)
        assert 0.710722 < held["upper"] < 0.73
        assert np.isnan(held["lower"])

    def test_the_cdf_holds_the_truth_in_its_band(self, concrete, design):
        cdfs = concrete[f"statistics/{design}/penetration_depth"]
        assert cdfs.sizes["rank"] == 1001
        values = cdfs["cdf_value"].values
        assert (np.diff(values) >= 0).all()
        band = cdfs["cdf_band"].values
        for truth, p in ((0.352828, 0.05), (0.466088, 0.5), (0.710722, 0.95), (0.95292, 0.99)):
            at = np.searchsorted(values, truth)
            assert band[at, 1] <= p <= band[at, 2]


# Of the law given admissible draws, from an independent code.
INDICES = {
    "first_order": {
        "target_density": 0.0013,
        "target_yield_limit": 0.122,
        "plasticity_radius": 0.645,
        "crater_radius": 0.160,
    },
    "total_order": {
        "target_density": 0.0022,
        "target_yield_limit": 0.129,
        "plasticity_radius": 0.715,
        "crater_radius": 0.227,
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("order", INDICES)
def test_the_plastic_zone_decides_most_of_the_depths_variance(concrete, order):
    indices = concrete["statistics/sobol_indices/penetration_depth"][order]
    for name, exact in INDICES[order].items():
        _, lower, upper = indices.sel(input=name).values
        assert lower < exact < upper, name
    largest = int(indices.sel(bound="estimate").values.argmax())
    assert indices["input"].values[largest] == "plasticity_radius"
    assert "conditional on admissible inputs" in indices.attrs["estimand"]


@pytest.mark.slow
def test_the_depth_responds_as_the_report_says(concrete):
    steps = concrete["statistics/responses/penetration_depth"]
    response = steps["response"].sel(bound="estimate")
    for name, per_cent in (
        ("target_density", -42.0),
        ("target_yield_limit", -95.9),
        ("plasticity_radius", -52.7),
        ("crater_radius", 59.4),
    ):
        assert 100 * float(response.sel(input=name)) == pytest.approx(per_cent, abs=1.0)


@pytest.mark.slow
def test_runs_correct_the_surrogate_of_the_depth(concrete):
    moments = concrete["statistics/polynomial_chaos/penetration_depth"]
    _, lower, upper = moments["mean"].values
    # The mean of 25 million runs. 10 500 of them alone would leave ± 0.6 %.
    assert lower < 0.492739 < upper
    assert upper - lower < 0.004 * 0.492739
    assert moments["mean_equivalent_runs"] > 20_000
    # Its tail is heavier than any interval of it covers.
    assert moments["std"].attrs["interval_label"] == "none"


@pytest.mark.slow
def test_the_course_at_the_nominal_inputs_is_kept(concrete):
    course = concrete["trajectory"]
    assert float(course["penetration_depth"][-1]) == pytest.approx(0.4615719, abs=1e-7)
    assert float(course["length"][-1]) == pytest.approx(0.02327912, abs=1e-8)
    assert course["nose_velocity"].attrs["units"] == "m s-1"


@pytest.mark.slow
def test_the_study_stands_in_its_tree_verbatim(concrete):
    text = (STUDIES / "concrete.toml").read_text(encoding="utf-8")
    assert concrete.attrs["study_text"] == text
    assert concrete.attrs["model_name"] == "walker-anderson"
    assert concrete.attrs["version_uqpen"] == uqpen.__version__


def small(extra="", runs=300, constraint=""):
    return uqpen.parse_study(
        f"""
        seed = 1
        [model]
        use = "ishigami"
        [inputs]
        x1 = {{ uniform = {{ lower = -3, upper = 3 }} }}
        x2 = {{ uniform = {{ lower = -3, upper = 3 }} }}
        x3 = 1
        [constraints]
        keep = [{constraint}]
        [designs.a]
        kind = "monte-carlo"
        runs = {runs}
        {extra}
        """
    )


@pytest.mark.processor
def test_adding_a_design_changes_no_others_numbers():
    more = '[designs.aa]\nkind = "latin-hypercube"\nruns = 100'
    alone, beside = uqpen.run(small()), uqpen.run(small(more))
    for path in ("runs/a", "statistics/a", "statistics/a/y", "failures/a"):
        assert alone[path].to_dataset().identical(beside[path].to_dataset())


@pytest.mark.processor
@pytest.mark.slow
def test_where_batches_are_computed_changes_no_bit():
    def backwards(function, batches):
        return [function(batch) for batch in reversed(list(batches))]

    assert uqpen.run(small(runs=70_000), map=backwards).identical(uqpen.run(small(runs=70_000)))


def test_every_statistic_survives_the_loss_of_every_run():
    tree = uqpen.run(small(constraint="'x1 > 4'"))
    assert np.isnan(tree["statistics/a/y"]["mean"].values).all()
    assert tree["statistics/a/y"]["mean"].attrs["note"] == "no run completed"
    assert (
        float(tree["failures/a"]["probability"].sel(status="inadmissible", bound="estimate")) == 1.0
    )


@pytest.mark.parametrize("runs", [1, 2, 3, 10])
def test_a_handful_of_runs_gives_figures_or_says_why_not(runs):
    moments = uqpen.run(small(runs=runs))["statistics/a/y"]
    mean = moments["mean"]
    assert np.isfinite(mean.sel(bound="estimate"))
    assert np.isfinite(mean.sel(bound="upper")) == (runs > 1)
    assert runs > 1 or "scatter" in mean.attrs["note"]


PYTHON = """
seed = 1
[model]
python = "model_of_test.py:f"
vectorized = true
[model.inputs]
x = "1"
[model.outputs]
y = "1"
[inputs]
x = {{ uniform = {{ lower = 0, upper = 1 }} }}
[outputs.y]
exceeds = [0.5]
hold = [0.9]
[designs.mc]
kind = "monte-carlo"
runs = {runs}
[designs.lhs]
kind = "latin-hypercube"
runs = {runs}
replicates = {replicates}
"""


def python(folder, body, *, runs=1000, replicates=10):
    """The analysis of a function of x, which is uniform over (0, 1)."""
    source = f"import numpy as np\ndef f(x):\n    return {{'y': {body}}}\n"
    (folder / "model_of_test.py").write_text(source)
    text = PYTHON.format(runs=runs, replicates=replicates)
    return uqpen.run(uqpen.parse_study(text, folder=folder))


def test_missing_runs_widen_a_probability_by_what_they_could_have_been(tmp_path):
    # Of the values above a half, those above 0.9 are lost: what came back says 4/9, the truth 1/2.
    tree = python(tmp_path, "np.where(x > 0.9, np.nan, x)")
    for design in ("mc", "lhs"):
        probability = SourceStatistics(tree).statistics(design, "y")["exceedance"][0]
        estimate, lower, upper = probability.values
        assert estimate == pytest.approx(4 / 9, abs=0.06)
        assert lower < 0.5 < upper
        assert "any outcome of the missing runs" in interval_text(probability, "note")
        assert probability.attrs["missing"].endswith(" % of the admissible runs")


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_tiny_and_huge_outputs_have_their_moments(tmp_path, scale):
    moments = python(tmp_path, f"{scale} * (1 + x)")["statistics/mc/y"]
    mean, std = moments["mean"].values / scale, moments["std"].values / scale
    assert mean[1] < 1.5 < mean[2]
    assert std[1] < 12**-0.5 < std[2]
    assert float(moments["kurtosis"][0]) == pytest.approx(1.8, abs=0.1)


@pytest.mark.parametrize("constant", [2.0, 0.1])  # exact in binary, and not
def test_an_output_that_does_not_vary_has_an_interval_of_no_width(tmp_path, constant):
    tree = python(tmp_path, f"{constant} + 0 * x", runs=300)
    for design in ("mc", "lhs"):
        moments = tree[f"statistics/{design}/y"]
        assert moments["mean"].values.tolist() == [constant] * 3
        assert moments["std"].attrs["note"] == "the output does not vary"
        assert (moments["quantile"].values == constant).all()
        assert np.isnan(moments["skewness"].values[0])
        assert moments["skewness"].attrs["note"] == "the output does not vary"


def test_two_replicates_fall_back_on_order_statistics(tmp_path):
    # So jagged that strata do not help.
    tree = python(tmp_path, "(1e6 * x) % 1", runs=200, replicates=2)
    quantiles = SourceStatistics(tree).statistics("lhs", "y")["quantile"]
    assert np.isfinite(quantiles.values).all()
    assert "order statistics (binomial)" in quantiles["interval"].values


def test_runs_that_are_all_of_one_replicate_tell_no_error(tmp_path):
    # The first stratum of each hypercube is all that comes back: one run of each replicate.
    with pytest.warns(RuntimeWarning, match="10 of 200 runs of mc were made again: 9 differ"):
        # What hangs on the place in a batch is noise.
        tree = python(tmp_path, "np.where(np.arange(len(x)) < 20, x, np.nan)", runs=200)
    mean = tree["statistics/lhs/y"]["mean"]
    assert np.isnan(mean.values[1])
    assert mean.attrs["note"] == "all completed runs are of one replicate"


def test_how_a_figure_is_reported_does_not_depend_on_what_else_was_asked():
    def exceedance(limits):
        tree = uqpen.run(small(f"[outputs.y]\nexceeds = {limits}"))
        return SourceStatistics(tree).statistics("a", "y")["exceedance"]

    one = exceedance("[5]")
    more = exceedance("[5, 100]")
    for name in ("interval", "interval_label", "note"):
        assert interval_text(one[0], name) == interval_text(more[0], name)


def test_a_mean_that_hangs_on_a_handful_of_runs_says_so(tmp_path):
    mean = python(tmp_path, "1 / x**3", runs=20_000)["statistics/mc/y"]["mean"]
    assert "may not exist" in mean.attrs["note"]


@pytest.mark.parametrize(("runs", "is_doubted"), [(1000, True), (2000, False)])
def test_few_replicates_do_not_show_a_tail_that_their_mean_suffers_from(tmp_path, runs, is_doubted):
    mean = python(tmp_path, "x", runs=runs)["statistics/lhs/y"]["mean"]
    assert ("more frequent than" in mean.attrs.get("note", "")) == is_doubted


def test_points_of_unknown_origin_give_no_interval_and_say_why(tmp_path):
    (tmp_path / "points.csv").write_text("x1,x2\n" + "\n".join(f"{i / 50},1" for i in range(100)))
    study = """
        seed = 1
        [model]
        use = "ishigami"
        [inputs]
        x3 = 1
        [designs.mine]
        kind = "table"
        file = "points.csv"
        """
    given = uqpen.run(uqpen.parse_study(study, folder=tmp_path))["statistics/mine/y"]["mean"]
    assert np.isnan(given.sel(bound="lower"))
    assert "independent = true" in given.attrs["note"]
    drawn = uqpen.run(uqpen.parse_study(study + "independent = true", folder=tmp_path))
    assert np.isfinite(drawn["statistics/mine/y"]["mean"].sel(bound="lower"))
