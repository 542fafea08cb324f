"""Designs that move one input after the other: trajectories, and steps from the nominal point."""

import math
from pathlib import Path

import numpy as np
import pytest
from designed_runs import REQUESTED, estimates_of, joint_of, points, runs_of

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.archive.write import write
from uqpen.core.model import Bounds
from uqpen.designs.one_at_a_time import Morris, OneAtATime
from uqpen.distributions.univariate import Normal, Uniform
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.analyze import analyze
from uqpen.statistics.sensitivity.single_steps import mean_effect
from uqpen.study.load import parse_study

STUDIES = Path(__file__).parents[2] / "studies"


def figure(found, name, entry):
    return float(found[name].sel(input=entry, bound="estimate"))


def note(found, name, entry):
    return interval_text(found[name].sel(input=entry), "note")


class TestMorris:
    LAW = joint_of(
        {"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 1.0), "c": Uniform(0.0, 1.0), "f": 2.0}
    )

    def test_each_step_of_a_trajectory_moves_one_input_by_half_of_the_levels(self):
        drawn = points(Morris(20, levels=6), self.LAW)
        unit = np.stack([drawn[name].values for name in "abc"], axis=1).reshape(20, 4, 3)
        grid = np.arange(1, 7) / 7
        assert np.isclose(unit[..., None], grid).any(axis=-1).all()
        steps = np.diff(unit, axis=1)
        moved = drawn["moved_input"].values.reshape(20, 4)
        by = drawn["moved_by"].values.reshape(20, 4)
        assert (moved[:, 0] == -1).all()
        assert (by[:, 0] == 0).all()
        assert (np.sort(moved[:, 1:], axis=1) == [0, 1, 2]).all()
        for place in range(3):
            expected = np.eye(3)[moved[:, place + 1]] * by[:, place + 1, None]
            np.testing.assert_allclose(steps[:, place], expected, atol=1e-12)
        np.testing.assert_allclose(np.abs(by[:, 1:]), 3 / 7)
        assert drawn["block"].values.tolist() == np.repeat(np.arange(20), 4).tolist()
        assert drawn["position"].values.tolist() == [0, 1, 2, 3] * 20
        assert drawn["moved_input"].attrs["flag_meanings"] == "_none a b c"

    def test_starts_are_spread_over_all_levels_and_steps_over_both_directions(self):
        drawn = points(Morris(4000), self.LAW)
        starts = drawn["a"].values[drawn["position"].values == 0]
        _, counts = np.unique(np.round(starts, 9), return_counts=True)
        # Within five standard deviations of a binomial count.
        assert np.abs(counts - 1000).max() < 5 * math.sqrt(4000 * 0.25 * 0.75)
        assert abs((drawn["moved_by"].values > 0).sum() - 6000) < 5 * math.sqrt(12_000 / 4)

    def test_another_name_gives_other_trajectories_and_the_global_generator_is_left(self):
        before = np.random.get_state()[1].copy()  # noqa: NPY002 - what must not be touched
        assert not points(Morris(20), self.LAW).identical(points(Morris(20), self.LAW, "other"))
        np.testing.assert_array_equal(before, np.random.get_state()[1])  # noqa: NPY002

    def test_levels_of_an_unbounded_law_are_finite(self):
        drawn = points(Morris(50), joint_of({"a": Normal(0.0, 1.0)}))
        assert np.abs(drawn["a"].values).max() < 1

    def test_effects_are_salibs(self):
        from SALib.analyze import morris

        def function(a, b, c, f):
            return f * a + b**2 * c - 3 * a * c

        found = estimates_of(Morris(30), self.LAW, function)
        runs = runs_of(Morris(30), self.LAW, function)
        names = ["a", "b", "c"]
        problem = {"num_vars": 3, "names": names, "bounds": [[0, 1]] * 3}
        unit = np.stack([runs[name].values for name in names], axis=1)
        theirs = morris.analyze(problem, unit, runs["y"].values, num_levels=4, seed=1)
        # SALib's levels reach from 0 to 1, so that its step is 2/3; this one is 2/5.
        for figure_name in ("mu", "mu_star", "sigma"):
            for position, name in enumerate(names):
                expected = theirs[figure_name][position] * (2 / 3) / (2 / 5)
                assert figure(found, figure_name, name) == pytest.approx(expected, rel=1e-10)

    def test_a_linear_effect_is_known_and_has_no_scatter(self):
        found = estimates_of(Morris(10), self.LAW, lambda a, b, c, f: 3 * a - 2 * b + 0 * c)
        assert figure(found, "mu", "a") == pytest.approx(3.0, rel=1e-12)
        assert figure(found, "mu", "b") == pytest.approx(-2.0, rel=1e-12)
        assert figure(found, "mu_star", "b") == pytest.approx(2.0, rel=1e-12)
        assert figure(found, "mu_star", "c") == 0.0
        assert figure(found, "sigma", "a") == pytest.approx(0.0, abs=1e-12)
        assert "show no scatter" in note(found, "mu", "a")

    def test_an_effect_with_the_period_of_half_the_law_is_seen(self):
        study = parse_study(
            'seed = 1\n[model]\nuse = "ishigami"\n[inputs]\n'
            + "".join(
                f"x{i} = {{ uniform = {{ lower = {-math.pi}, upper = {math.pi} }} }}\n"
                for i in (1, 2, 3)
            )
            + '[designs.morris]\nkind = "morris"\ntrajectories = 20\n'
        )
        found = SourceStatistics(uqpen.run(study)).statistics("morris", "y")
        # 7 (sin²(π/5) - sin²(3π/5)) over a step of 2/5, up or down.
        exact = 7 * abs(math.sin(math.pi / 5) ** 2 - math.sin(3 * math.pi / 5) ** 2) / 0.4
        assert figure(found, "mu_star", "x2") == pytest.approx(exact, rel=1e-9)

    def test_intervals_of_the_mean_size_cover(self):
        function = lambda a, b, c, f: np.exp(a) * (1 + b) - c**2  # noqa: E731
        runs = runs_of(Morris(600), self.LAW, function)
        # Exactly: the mean over all places of the grid.
        level = np.arange(1, 5) / 5
        whole = function(level[:, None, None], level[None, :, None], level[None, None, :], 2.0)
        truth = np.abs(whole[2:] - whole[:2]).mean() / 0.4
        held = 0
        for start in range(0, runs.sizes["run"], 40):
            found = analyze(runs.isel(run=slice(start, start + 40)), REQUESTED)
            reported = found["y"]["mu_star"].sel(input="a")
            held += bool(reported.sel(bound="lower") <= truth <= reported.sel(bound="upper"))
        # Of 60 with ten trajectories each; benchmarks/elementary_effects_coverage.py measures 93 %
        # to 98 %, and this is four standard errors below.
        assert held > 47

    def test_few_trajectories_carry_a_note(self):
        found = estimates_of(Morris(4), self.LAW, lambda a, b, c, f: a * b + c)
        assert "only 4 effects" in note(found, "mu_star", "a")

    def test_an_effect_that_is_rare_carries_a_note(self):
        effects = np.zeros(40)
        effects[:4] = 1.0, 1.0, 2.0, 3.0
        assert "only 4 of 40 effects differ from the others" in mean_effect(effects).note
        effects[4] = 1.0
        assert mean_effect(effects).note == ""

    def test_a_lost_run_takes_away_no_more_than_two_steps(self):
        lost = {7, 41}
        runs = runs_of(Morris(20), self.LAW, lambda a, b, c, f: 3 * a - 2 * b + c)
        first = runs["y"].values[0]
        assert math.isfinite(first)
        status = runs["status"].values.copy()
        values = runs["y"].values.copy()
        for run in lost:
            status[run], values[run] = 2, math.nan
        runs = runs.assign(status=("run", status, runs["status"].attrs), y=("run", values))
        found = analyze(runs, REQUESTED)["y"]
        notes = [note(found, "mu", name) for name in "abc"]
        reported = sum(
            int(text.split("; ")[-1].split(" of ")[0]) for text in notes if " of 20" in text
        )
        # Run 7 ends its trajectory; run 41 stands inside one.
        assert reported == 1 + 2
        assert figure(found, "mu", "a") == pytest.approx(3.0, rel=1e-12)

    @pytest.mark.parametrize("bad", [lambda: math.nan, lambda: 1 // 0], ids=["nan", "exception"])
    def test_lost_runs_are_counted_and_change_no_other_effect(self, bad):
        found = estimates_of(
            Morris(40),
            self.LAW,
            lambda a, b, c, f: bad() if min(a, b, c) > 0.5 else 3 * a - 2 * b + c,
            vectorized=False,
        )
        assert found["mu"].attrs["runs"] - found["mu"].attrs["runs_used"] > 0
        for name, effect in (("a", 3.0), ("b", -2.0), ("c", 1.0)):
            assert figure(found, "mu", name) == pytest.approx(effect, rel=1e-12)
            assert "of 40 effects are missing because a run failed" in note(found, "sigma", name)

    def test_inadmissible_runs_are_counted(self):
        joint = joint_of({"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 1.0)}, {"a": Bounds(lower=0.3)})
        found = estimates_of(Morris(40), joint, lambda a, b: a + b)
        assert found["mu"].attrs["runs_inadmissible"] > 0
        assert found["mu"].attrs["conditional_on"] == "admissible inputs"
        assert figure(found, "mu", "b") == pytest.approx(1.0, rel=1e-12)

    def test_with_no_run_left_there_is_no_figure(self):
        found = estimates_of(Morris(4), self.LAW, lambda a, b, c, f: a * math.nan)
        for name in ("mu", "mu_star", "sigma"):
            assert np.isnan(found[name].values).all()
            assert note(found, name, "a")


@pytest.mark.parametrize(("side", "response"), [("backward", 2 - 0.01), ("forward", 2 + 0.01)])
def test_a_difference_may_be_of_one_side(side, response):
    design = OneAtATime(0.01, difference=side)
    joint = joint_of({"a": Normal(3.0, 0.1)})
    assert points(design, joint).sizes["run"] == design.run_count(joint) == 2
    found = estimates_of(design, joint, lambda a: a**2)
    assert figure(found, "response", "a") == pytest.approx(response)
    assert "as the design says" in note(found, "response", "a")


class TestOneAtATime:
    LAW = joint_of({"a": Normal(2.0, 0.2), "b": Uniform(1.0, 5.0), "f": 4.0, "zero": 0.0})

    def test_points_are_the_nominal_one_and_two_for_each_random_input(self):
        drawn = points(OneAtATime(0.1), self.LAW)
        assert drawn.sizes["run"] == OneAtATime(0.1).run_count(self.LAW) == 5
        np.testing.assert_allclose(drawn["a"], [2, 1.8, 2.2, 2, 2])
        np.testing.assert_allclose(drawn["b"], [3, 3, 3, 2.7, 3.3])
        assert drawn["f"].dims == ()
        assert drawn["moved_input"].values.tolist() == [-1, 0, 0, 1, 1]
        assert drawn["moved_by"].values.tolist() == [0, -0.1, 0.1, -0.1, 0.1]

    @pytest.mark.parametrize("exponent", [-2.0, -0.5, 0.3, 1.0, 3.0])
    def test_the_response_of_a_power_law_is_its_exponent(self, exponent):
        found = estimates_of(OneAtATime(), self.LAW, lambda a, b, f, zero: 7 * a**exponent / b)
        # The third derivative leaves a term of the square of the step.
        allowed = abs(exponent * (exponent - 1) * (exponent - 2)) / 6 * 0.01**2 * 1.1 + 1e-12
        assert figure(found, "response", "a") == pytest.approx(exponent, abs=allowed)
        assert figure(found, "response", "b") == pytest.approx(-1.0, abs=1.1e-4)
        uncertainty = abs(figure(found, "response", "a")) * 0.1
        assert figure(found, "contribution", "a") == pytest.approx(uncertainty, rel=1e-9)
        uniform = abs(figure(found, "response", "b")) * (4 / math.sqrt(12)) / 3
        assert figure(found, "contribution", "b") == pytest.approx(uniform, rel=1e-9)
        assert note(found, "response", "a") == "a derivative at one point has no scatter"

    def test_fixed_inputs_are_moved_where_that_is_asked(self):
        design = OneAtATime(fixed=True)
        found = estimates_of(design, self.LAW, lambda a, b, f, zero: a * f**2)
        assert found["response"]["input"].values.tolist() == ["a", "b", "f"]
        assert figure(found, "response", "f") == pytest.approx(2.0, rel=1e-9)
        assert math.isnan(figure(found, "contribution", "f"))
        assert note(found, "contribution", "f") == "a fixed input has no uncertainty"

    def test_a_step_from_zero_is_relative_to_the_spread(self):
        joint = joint_of({"a": Normal(0.0, 2.0), "b": Uniform(1.0, 3.0)})
        half_spread = 2.0 * 0.9944578832097532
        drawn = points(OneAtATime(0.01), joint)
        np.testing.assert_allclose(
            drawn["a"].values[1:3], [-0.01 * half_spread, 0.01 * half_spread]
        )
        found = estimates_of(OneAtATime(), joint, lambda a, b: 10 + a)
        assert figure(found, "response", "a") == pytest.approx(half_spread / 10, rel=1e-9)
        assert figure(found, "contribution", "a") == pytest.approx(0.2, rel=1e-9)
        assert "its nominal value is 0" in note(found, "response", "a")
        assert "nominal value is 0" not in note(found, "response", "b")

    def test_a_negative_nominal_value_has_the_same_response(self):
        found = estimates_of(OneAtATime(), joint_of({"a": Normal(-2.0, 0.5)}), lambda a: 3 * a**3)
        assert figure(found, "response", "a") == pytest.approx(3.0, abs=1.1e-4)
        assert figure(found, "contribution", "a") == pytest.approx(0.75, rel=1e-3)

    def test_a_curved_response_says_so(self):
        found = estimates_of(OneAtATime(0.3), self.LAW, lambda a, b, f, zero: a**3 + 0 * b)
        assert "nonlinear" in note(found, "response", "a")
        assert "nonlinear" not in note(found, "response", "b")

    def test_a_step_that_lost_a_side_is_of_the_other(self):
        found = estimates_of(
            OneAtATime(),
            self.LAW,
            lambda a, b, f, zero: math.nan if a > 2 else 1 // 0 if b < 3 else a * b,
            vectorized=False,
        )
        assert found["response"].attrs["runs_not_finite"] == 1
        assert found["response"].attrs["runs_failed"] == 1
        assert figure(found, "response", "a") == pytest.approx(1.0, rel=1e-9)
        assert "from the step down only" in note(found, "response", "a")
        assert "from the step up only" in note(found, "response", "b")

    def test_a_step_out_of_the_models_domain_is_inadmissible(self):
        joint = joint_of({"a": Normal(2.0, 0.2), "b": Normal(1.0, 0.1)}, {"a": Bounds(upper=2.01)})
        found = estimates_of(OneAtATime(), joint, lambda a, b: a * b)
        assert found["response"].attrs["runs_inadmissible"] == 1
        assert "from the step down only" in note(found, "response", "a")

    def test_a_step_that_lost_both_sides_has_no_response(self):
        found = estimates_of(
            OneAtATime(), self.LAW, lambda a, b, f, zero: np.where(a == 2, a * b, math.nan)
        )
        assert math.isnan(figure(found, "response", "a"))
        assert math.isnan(figure(found, "contribution", "a"))
        assert note(found, "contribution", "a") == "both runs of the step failed"
        assert figure(found, "response", "b") == pytest.approx(1.0, rel=1e-9)

    @pytest.mark.parametrize(
        ("function", "reason"),
        [
            (
                lambda a, b, f, zero: np.where((a == 2) & (b == 3), math.nan, a),
                "nominal point failed",
            ),
            (lambda a, b, f, zero: (a - 2) * b, "the output is 0 at the nominal point"),
        ],
    )
    def test_without_a_nominal_output_there_is_no_response(self, function, reason):
        found = estimates_of(OneAtATime(), self.LAW, function)
        for name in ("response", "contribution"):
            assert np.isnan(found[name].values).all()
            assert reason in note(found, name, "a")

    def test_the_responses_of_the_concrete_study_are_the_reports(self):
        text = (STUDIES / "concrete.toml").read_text(encoding="utf-8").split("[designs.")[0]
        study = parse_study(f'{text}[designs.steps]\nkind = "one-at-a-time"\n')
        found = uqpen.run(study)["statistics/steps/penetration_depth"].to_dataset()
        # In per cent; Table 3.3 of the report has 42.3, 97.0, 52.8 and 59.4 by size.
        for name, response, contribution in (
            ("target_density", -42.0, 0.84),
            ("target_yield_limit", -95.9, 9.6),
            ("plasticity_radius", -52.7, 13.2),
            ("crater_radius", 59.4, 10.5),
        ):
            at = {"input": name, "bound": "estimate"}
            reported = found["response"].sel(at)
            assert 100 * float(reported) == pytest.approx(response, abs=0.1)
            reported = found["contribution"].sel(at)
            assert 100 * float(reported) == pytest.approx(contribution, abs=0.1)


@pytest.mark.parametrize("design", [Morris(4), OneAtATime()], ids=str)
def test_an_input_that_a_model_does_not_vary_has_no_figure(design):
    joint = joint_of({"a": Normal(2.0, 0.2), "b": Normal(3.0, 0.2)})
    runs = runs_of(design, joint, lambda a, b: a * b)
    # What another model makes of the points: a value of its own for one input.
    found = analyze(runs.assign(b=((), 3.0)), REQUESTED)["y"]
    assert {str(each["input"].item()) for each in found.values()} == {"a"}
    found = analyze(runs.drop_vars("a"), REQUESTED)["y"]
    assert {str(each["input"].item()) for each in found.values()} == {"b"}
    assert np.isfinite(next(iter(found.values())).isel(bound=0).item())


def test_an_output_may_have_the_name_of_another_and_of_a_statistic(tmp_path):
    names = ("y_mean", "y_sigma_note", "y_response", "y_contribution")
    model = uqpen.PythonModel(
        lambda x: {"y": x, **dict.fromkeys(names, 2 * x + x**2)},
        {"x": "1"},
        dict.fromkeys(("y", *names), "1"),
    )
    designs = {"steps": uqpen.OneAtATime()}
    tree = uqpen.run(uqpen.Study(model, {"x": uqpen.Normal(1.0, 0.1)}, designs=designs, seed=1))
    write(tree, tmp_path / "all.nc")
    steps = uqpen.open_archive(tmp_path / "all.nc")["statistics/steps"]
    # The response of x is 1; that of x² + 2 x at x = 1 is 4/3.
    for output, response in (("y", 1.0), *((name, 4 / 3) for name in names)):
        found = steps[output]["response"].sel(bound="estimate").values
        assert found == pytest.approx([response], rel=1e-9)
